"""Which numbers measure which rigs: a change of others leaves the measurements of a rig as they are."""

from dataclasses import replace

import pytest

from auditor.lab.simulation.drives import make_drive
from auditor.measurement import FaultFeatures, localise, measure_stream
from auditor.measurement.checks.found import MEASURED_BY, MEASURING
from auditor.measurement.disparity.matchers import find_matcher
from auditor.model.rig import LIDAR, Rig
from auditor.model.rig_kind import ComparedTo


@pytest.mark.parametrize(
    ("cameras", "compared_to"), [(0, ComparedTo.SCANS), (1, ComparedTo.PAST), (3, ComparedTo.CAMERAS)]
)
def test_a_rig_is_measured_by_no_other_numbers_than_those_that_its_version_is_bound_to(
    cameras: int, compared_to: ComparedTo, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = make_drive(2, 3, n_cameras=max(cameras, 1), width_px=620, height_px=188)
    rig, frames = made.rig, list(made.frames())
    if not cameras:
        rig, frames = Rig(rig.lidar, ()), [replace(one, images={}) for one in frames]
    assert rig.kind.compared_to is compared_to
    own, read, matcher = MEASURED_BY[compared_to], set(), find_matcher("sgbm")

    def reading(group: object, name: str) -> object:
        read.add(type(group).__name__)
        return object.__getattribute__(group, name)

    for group in MEASURING:
        monkeypatch.setattr(type(group), "__getattribute__", reading)
    features = FaultFeatures()
    for _, arrays in measure_stream(frames, rig, matcher):
        features.update(arrays)
        localise(arrays, {LIDAR, *rig.sensors[:2]}, rig)
    assert read
    assert read - {type(group).__name__ for group in own} == set()
