"""Recordings that lack sensors are judged by a part of a calibration, as by one that was made without these sensors."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from decimal import Decimal

import numpy as np
import pytest

from auditor.identification.transfer import calibration_for
from auditor.model.checks import Check, rig_sensor_checks
from auditor.model.frames import PointCloud
from auditor.model.measurement import Statistic
from auditor.model.verdict import FINDINGS, Cause, Method
from auditor.pipeline.judge import Criteria, fitting_calibration, judge_measurement
from auditor.pipeline.judged import Judge, JudgeSettings
from auditor.pipeline.labels import label_attack
from auditor.pipeline.measure import measure_recording
from auditor.pipeline.measured import MeasureTask
from auditor.recordings import write_mcap
from auditor.store.calibrations import read_calibration, write_calibration
from auditor.store.queries import run_query, run_sql
from auditor.store.store import Store
from tests.making.calibrations import calibrate
from tests.making.removed_topics import without_sensors
from tests.making.scenes import plane_rig
from tests.making.small_drives import drive_frames

R = Decimal("0.01")
RIG = plane_rig((1.04, 0.74, 0.4, 0.0))
FRAMES, CLEAN = 14, 8
REMOVED = [(4,), (0, 2)]


def with_something_near(frames):
    """Frames with something before the cameras that is nearer than the matcher sees: the LiDAR masks it."""
    rng = np.random.default_rng(5)
    near = np.stack([np.full(900, 1.2), rng.uniform(-0.25, 0.05, 900), rng.uniform(-0.2, 0.2, 900)], axis=1)
    for frame in frames:
        images = {}
        for number, image in frame.images.items():
            pixels = image.pixels.copy()
            pixels[20:110, 150:230] = rng.integers(0, 256, (90, 80))
            images[number] = replace(image, pixels=pixels)
        points = np.vstack([frame.cloud.xyz_m, near.astype(np.float32)])
        yield replace(frame, images=images, cloud=PointCloud(frame.cloud.stamp_ns, points))


@pytest.fixture(scope="module")
def drives(tmp_path_factory):
    """A folder with two clean recordings and an attacked one of four cameras and a LiDAR."""
    folder = tmp_path_factory.mktemp("drives")
    attacked = {4: range(2, 5), 0: range(6, 9), 2: range(10, 13)}
    for name, hit in (("clean", None), ("quiet", None), ("attacked", attacked)):
        frames = drive_frames(RIG, FRAMES if hit else CLEAN, seed=len(name), attacked=hit)
        write_mcap(folder / f"{name}.mcap", RIG, with_something_near(frames))
    return folder


def measured(folder, name, store, sensors=()):
    """The measurement of a recording without some of its sensors."""
    path = folder / f"{name}.mcap"
    if sensors:
        path = without_sensors(path, folder / f"{name} without {sensors}.mcap", RIG, sensors)
    return measure_recording(MeasureTask(path, store), lambda *_: None).measurement_ids[0]


@pytest.fixture(scope="module")
def whole(drives):
    """The calibration of the whole rig, as it is read from its file."""
    store = drives / "whole"
    known = [measured(drives, name, store) for name in ("clean", "quiet")]
    calibration = calibrate([(Store.open(store), one) for one in known])
    assert any(one.unmasked for one in calibration.clean), "something near has been masked"
    write_calibration(calibration, drives / "whole.parquet")
    return read_calibration(drives / "whole.parquet")


def verdicts(store, measurement, calibration, criteria):
    judge_measurement(store, measurement, calibration, criteria)
    return run_sql(store, "SELECT * EXCLUDE judgement_id FROM verdicts ORDER BY frame").to_pylist()


@pytest.mark.parametrize("removed", REMOVED)
def test_verdicts_are_those_of_a_calibration_made_without_the_same_sensors(drives, whole, removed, tmp_path):
    store = tmp_path / "audit"
    without = [measured(drives, name, tmp_path / "clean", removed) for name in ("clean", "quiet")]
    own = calibrate([(Store.open(tmp_path / "clean"), one) for one in without])
    attacked = measured(drives, "attacked", store, removed)
    kept = Store.open(store)
    rig = kept.rig(kept.measurement(attacked).rig_id)
    assert calibration_for(own, rig) is own
    part = calibration_for(whole, rig)
    assert part.samples == own.samples
    checks = rig_sensor_checks(rig)
    for ours, theirs in zip(part.clean, own.clean, strict=True):
        assert np.array_equal(ours.statistics_of(checks), theirs.statistics_of(checks), equal_nan=True)
        assert ours.strengths.keys() == theirs.strengths.keys()
        assert all(np.array_equal(ours.strengths[one], theirs.strengths[one], equal_nan=True) for one in ours.strengths)
    findings = 0
    for criteria in (
        Criteria(R),
        Criteria(R, incidents_per_hour=100.0),
        Criteria(R, Method.PAPER),
    ):
        by_part = verdicts(kept, attacked, whole, criteria)
        assert by_part == verdicts(kept, attacked, own, criteria)
        findings += sum(row["kind"] in FINDINGS for row in by_part)
    assert findings > 0


def test_the_judgement_and_the_warnings_say_what_the_recording_lacks(drives, whole, tmp_path):
    store = tmp_path / "audit"
    attacked = measured(drives, "attacked", store, (0, 2))
    judged = Judge(Store.open(store), JudgeSettings(Criteria(R), whole)).judge(attacked)
    said = (
        "judged as a part of LiDAR + 4 cameras 320x120 f=300px b=0.30,0.34,0.40m: "
        "without the LiDAR, S_2 (320 x 120 at +0.30 m)"
    )
    assert said in judged.warnings
    assert judged.judgement.absent_sensors == ("LiDAR", "S_2 (320 x 120 at +0.30 m)")
    assert not judged.complete, "whoever attacks a sensor and removes its topic must not get a clean recording"
    sql = "SELECT absent_sensors, calibrated_as, transferred, calibration_id FROM judgements"
    [row] = run_sql(Store.open(store), sql).to_pylist()
    assert row["absent_sensors"] == list(judged.judgement.absent_sensors)
    assert row["calibrated_as"] == [1, 3, 4]
    assert (row["transferred"], row["calibration_id"]) == (False, whole.calibration_id)
    assert Store.open(store).calibration(whole.calibration_id).rig_kind == whole.rig_kind, "the whole one is kept"
    listed = run_sql(Store.open(store), "SELECT DISTINCT statistic FROM calibrations").column(0).to_pylist()
    assert set(listed) <= {*Statistic, *Check, *Cause}, "what serves parts alone is not listed"


def test_rates_in_sql_take_the_thresholds_of_the_sensors_that_are_there(drives, whole, tmp_path):
    store = Store.open(tmp_path / "audit", create=True)
    attacked = measured(drives, "attacked", tmp_path / "audit", (1,))
    judge_measurement(store, attacked, whole, Criteria(R, Method.PAPER))
    [one] = run_sql(store, "SELECT theta FROM judgements").to_pylist()
    assert run_query(store, "identification_rate", {"r": "0.01"}).num_rows == 0, "nobody said what was attacked"
    [recording] = store.recordings()
    for sensor, frames in {3: (2, 4), 0: (6, 8), 1: (10, 12)}.items():  # without S_1 the others move up
        label_attack(store, recording, "facula", sensor=sensor, first=str(frames[0]), last=str(frames[1]))
    rows = run_query(store, "identification_rate", {"r": "0.01"}).to_pylist()
    counted = {tuple(row["attacked"]): row["frames"] for row in rows}
    raised = run_sql(store, "SELECT count(*) AS n FROM verdicts WHERE contains(e, '1')").to_pylist()[0]["n"]
    assert counted == {(): FRAMES - 9, (3,): 3, (0,): 3, (1,): 3}
    assert sum((row["detected"] or 0) + (row["false_alarms"] or 0) for row in rows) == raised
    assert {row["transferred"] for row in rows} == {False}
    assert None not in one["theta"]


def test_a_calibration_of_the_rig_kind_goes_first_then_that_with_the_fewest_additional_sensors(drives, whole, tmp_path):
    kept = Store.open(tmp_path / "clean", create=True)
    clean = {
        sensors: calibrate([(kept, measured(drives, "clean", kept.folder, sensors))]) for sensors in ((1,), (1, 0))
    }
    store = tmp_path / "audit"
    attacked = measured(drives, "attacked", store, (0, 1))
    every = [clean[1,], clean[1, 0], whole]
    assert fitting_calibration(Store.open(store), attacked, every) is clean[1, 0]
    assert fitting_calibration(Store.open(store), attacked, [whole, clean[1,]]) is clean[1,]
    dated = replace(clean[1,], calibration_id="z", calibrated_at=datetime.now(UTC) + timedelta(days=999))
    assert fitting_calibration(Store.open(store), attacked, [dated, clean[1,], whole]) is clean[1,], "no date decides"
    more = measured(drives, "attacked", store)
    assert fitting_calibration(Store.open(store), more, [clean[1,], clean[1, 0]]) is None, "it has sensors without any"
