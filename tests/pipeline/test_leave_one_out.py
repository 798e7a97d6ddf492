"""What a calibration says of its recordings is what a scan would say of each, judged by the others."""

from dataclasses import replace
from decimal import Decimal

import pytest

from auditor.identification.evidence_parameters import INCIDENTS
from auditor.model.frames import Presence, SensorState
from auditor.model.verdict import FINDINGS
from auditor.pipeline.judge import Criteria, judge_measurement, system_of
from auditor.pipeline.measure import measure_recording
from auditor.pipeline.measured import MeasureTask
from auditor.recordings import write_mcap
from auditor.store.queries import describe, run_query
from auditor.store.store import Store
from auditor.store.versions.history import put_first_in_force
from tests.making.calibrations import calibrate
from tests.making.left_out import leave_one_out_robust
from tests.making.scenes import plane_rig
from tests.making.small_drives import drive_frames

RIG = plane_rig((0.6, 0.3, 0.0))
R = Decimal("0.01")
FRAMES = 12


def frames(name):
    """Frames of one of three recordings: quiet ones, attacked ones, and ones in which sensors freeze or are missing."""
    attacked = {3: range(1, 5), 1: range(8, 14)} if name == "attacked" else None
    kept = list(drive_frames(RIG, FRAMES, seed=len(name), attacked=attacked))
    if name == "broken":
        for number in range(3, 7):
            images = kept[number].images
            kept[number] = replace(
                kept[number], images={**images, 2: replace(images[2], pixels=kept[2].images[2].pixels)}
            )
        for number in range(9, 11):
            presence = kept[number].presence | {0: Presence(SensorState.MISSING)}
            kept[number] = replace(kept[number], cloud=None, presence=presence)
    return kept


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """A store, and the measurement of each recording by its id."""
    folder, known = tmp_path_factory.mktemp("hold-out"), {}
    for name in ("quiet", "attacked", "broken"):
        path = folder / f"{name}.mcap"
        write_mcap(path, RIG, frames(name))
        done = measure_recording(MeasureTask(path, folder / "audit"), lambda *_: None)
        known[done.recording_id] = done.measurement_ids[0]
    return Store.open(folder / "audit"), known


def test_held_out_frames_and_incidents_are_those_of_a_scan(measured):
    store, known = measured
    everything = calibrate([(store, measurement) for measurement in known.values()])
    left_out = leave_one_out_robust(everything, system_of(RIG), R)
    found = {one.recording: (one.findings, one.incidents) for one in left_out}
    scanned = {}
    for recording, measurement in known.items():
        others = calibrate([(store, other) for other in known.values() if other != measurement])
        counts = judge_measurement(store, measurement, others, Criteria(R)).counts
        grades = run_query(store, "incidents", {"recording": recording})["grade"].to_pylist()
        scanned[recording] = sum(counts[kind] for kind in FINDINGS), grades.count("incident")
    assert found == scanned
    assert sum(raised > 0 for raised, _ in found.values()) == 2
    assert max(incidents for _, incidents in found.values()) > 1


def test_a_calibration_remembers_which_sensors_were_missing_or_frozen(measured):
    store, known = measured
    calibration = calibrate([(store, measurement) for measurement in known.values()])
    put_first_in_force(store, calibration)
    for one in (calibration, store.calibration(calibration.calibration_id)):
        missing, frozen = (
            [{s: flags.nonzero()[0].tolist() for s, flags in of_sensor.items()} for of_sensor in parts]
            for parts in zip(*((clean.missing, clean.frozen) for clean in one.clean), strict=True)
        )
        assert [part for part in missing if part] == [{0: [9, 10]}]
        assert [part for part in frozen if part] == [{2: [3, 4, 5, 6]}]
    listed = run_query(store, "thresholds", {"r": "0"}).to_pylist()
    assert {row["statistic"] for row in listed} == {"plain", "gated"}


def test_an_incident_s_gap_is_that_of_the_query():
    (gap,) = [one for one in describe("incidents").parameters if one.name == "gap_s"]
    assert float(gap.default) == INCIDENTS.gap_s
