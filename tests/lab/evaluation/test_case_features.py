"""What an evaluation keeps of a case is what a scan would measure of the attacked frame, and of the frame after it.

One camera is grey and two have colours.
"""

from dataclasses import replace
from itertools import chain

import numpy as np
import pytest

from auditor.identification.statistics import sensor_statistics
from auditor.lab.attacks.paper import BogusWall, Facula
from auditor.lab.evaluation.attacked_frame import AttackedFrame
from auditor.lab.evaluation.experiments import AttackCase, Experiment, all_triples
from auditor.lab.evaluation.features import FeaturesOfCases
from auditor.lab.evaluation.runner import InTime
from auditor.lab.simulation.drives import make_drive
from auditor.measurement import FaultFeatures, measure
from auditor.measurement.disparity.matchers import find_matcher
from auditor.model.checks import rig_sensor_checks
from auditor.model.fault_features import COLUMNS
from auditor.model.frames import Presence, SensorState
from auditor.model.measurement import CASE_BRIGHTNESS
from auditor.model.rig import LIDAR
from tests.making.scenes import moved

MATCHER = find_matcher("sgbm")
OFFSETS_M = {"on a line": None, "beside it": ((0.0, -0.1, 0.0), (0.0, 0.0, 0.15), (0.0, 0.0, 0.0))}
WALL, FACULA = BogusWall(range_m=6.0, lateral_m=0.2, seed=3), Facula(2000.0, 40.0, 200.0, 60.0)
SINGLE = Experiment("further", all_triples, lambda *_: iter(()))
LASTING = replace(SINGLE, name="intervals", together=10)
FRAMES = 4


@pytest.fixture(scope="module", params=OFFSETS_M, ids=list(OFFSETS_M))
def drive(request):
    made = make_drive(7, FRAMES, width_px=414, height_px=126, condition="clear", kinds=("grey", "colour", "colour"))
    offsets = OFFSETS_M[request.param]
    rig = moved(made.rig, offsets) if offsets else made.rig
    frames = list(replace(made, vehicle=replace(made.vehicle, rig=rig)).frames())
    gone = Presence(SensorState.MISSING)
    images = {s: image for s, image in frames[3].images.items() if s != 2}
    frames[3] = replace(frames[3], images=images, presence={**frames[3].presence, 2: gone})
    return rig, frames, [measure(frame, rig, MATCHER) for frame in frames]


def attacked(frame, rig, attacks):
    images = {s: attacks[s].apply(i) if s in attacks else i for s, i in frame.images.items()}
    return replace(frame, images=images, cloud=WALL.apply(frame.cloud, rig) if LIDAR in attacks else frame.cloud)


def scanned(drive, attacks, hit):
    """Features of each frame as a scan measures and stores them, where those of some numbers are attacked."""
    rig, frames, clean = drive
    watch, found = FaultFeatures(), []
    for frame, known in zip(frames, clean, strict=True):
        taken = measure(attacked(frame, rig, attacks), rig, MATCHER) if frame.number in hit else known
        measurement, evidence = taken
        fault_features = watch.update(evidence)
        pairs = [
            fault_features[pair].values if pair in fault_features else [np.nan] * len(COLUMNS) for pair in rig.pairs
        ]
        coverage = [measurement.coverage.get(s) for s in rig.sensors]
        found.append(
            (
                [s in measurement.fingerprints for s in rig.sensors],
                [measurement.fingerprints.get(s) for s in rig.sensors],
                [[one and getattr(one, name) for one in coverage] for name in CASE_BRIGHTNESS],
                [coverage[LIDAR].returns],
                list(chain.from_iterable(pairs)),
            )
        )
    return found


def kept(features):
    taken = features.fault_features
    return (
        features.present,
        features.fingerprint,
        list(features.brightness.values()),
        [features.returns],
        [np.nan if x is None else x for x in taken],
    )


def same(one, other):
    for mine, its in zip(one, other, strict=True):
        np.testing.assert_array_equal(np.array(mine, dtype=np.float64), np.array(its, dtype=np.float64))


@pytest.mark.parametrize("attacks", [{}, {LIDAR: WALL}, {1: FACULA}, {2: FACULA, 3: FACULA}], ids=repr)
def test_the_features_of_a_case_are_those_of_a_scan_and_so_are_those_of_the_frame_after_it(drive, attacks):
    rig, frames, _ = drive
    benches = [AttackedFrame(frame, rig, MATCHER) for frame in frames]
    for number in (0, 1, 2):
        before = benches[number - 1] if number else None
        now = InTime(benches[number], before, benches[number + 1])
        found = FeaturesOfCases().of(now, SINGLE, 0, AttackCase(attacks))
        benches[number].forget_attacks()
        expected = scanned(drive, attacks, {number})
        same(kept(found), expected[number])
        after = [np.nan if x is None else x for x in found.fault_features_after]
        if attacks:
            np.testing.assert_array_equal(after, expected[number + 1][-1])
        else:
            assert np.isnan(after).all()


@pytest.mark.parametrize("attacks", [{}, {LIDAR: WALL}, {1: FACULA}, {2: FACULA, 3: FACULA}], ids=repr)
def test_the_statistics_of_a_case_are_those_of_measuring_the_attacked_frame(drive, attacks):
    rig, frames, _ = drive
    for frame in frames[2:]:  # of the last S_2 is missing
        if set(attacks) <= {LIDAR, *frame.images}:
            measurement, _ = measure(attacked(frame, rig, attacks), rig, MATCHER)
            expected = sensor_statistics(rig_sensor_checks(rig), measurement.cells, measurement.shares)
            assert AttackedFrame(frame, rig, MATCHER).statistics(attacks) == expected


def test_inside_an_interval_the_frame_before_is_attacked_as_well(drive):
    rig, frames, _ = drive
    benches, taken, attacks = [AttackedFrame(frame, rig, MATCHER) for frame in frames], FeaturesOfCases(), {1: FACULA}
    expected = scanned(drive, attacks, range(3))
    for number in range(3):
        now = InTime(benches[number], benches[number - 1] if number else None, benches[number + 1])
        found = taken.of(now, LASTING, 0, AttackCase(attacks, "still"))
        benches[number].forget_attacks()
        same(kept(found), expected[number])
    assert kept(found)[-1] != kept(FeaturesOfCases().of(now, LASTING, 0, AttackCase(attacks, "still")))[-1]
