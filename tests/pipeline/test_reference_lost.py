"""A recording whose reference camera is unplugged beside a bogus wall, or whose LiDAR is blind, is never clean."""

from dataclasses import replace
from decimal import Decimal

import pytest

from auditor.cli import run
from auditor.model.frames import Presence, SensorState
from auditor.model.verdict import Method, VerdictKind
from auditor.pipeline.judge import Criteria
from auditor.pipeline.judged import Judge, JudgeSettings
from auditor.pipeline.measure import measure_recording
from auditor.pipeline.measured import MeasureTask
from auditor.recordings import write_mcap
from auditor.store.queries import run_query, run_sql
from auditor.store.store import Store
from tests.making.calibrations import calibrate
from tests.making.scenes import plane_rig
from tests.making.small_drives import drive_frames

FRAMES, LOST = 14, 5
WIDE, NARROW = (0.75, 0.4, 0.0), (0.6, 0.54, 0.0)


def frames_without_reference(rig, wall):
    """From LOST on the leftmost camera has no images, and behind a wall the LiDAR's points stand too near."""
    for frame in drive_frames(rig, FRAMES, seed=3, attacked={0: range(LOST, FRAMES)} if wall else {}):
        if frame.number < LOST:
            yield frame
            continue
        images = {sensor: image for sensor, image in frame.images.items() if sensor != 3}
        yield replace(frame, images=images, presence=frame.presence | {3: Presence(SensorState.MISSING)})


def judged(folder, positions_m, method=Method.ROBUST, r=Decimal(0), *, wall=True):
    rig, store = plane_rig(positions_m), folder / "audit"
    write_mcap(folder / "clean.mcap", rig, drive_frames(rig, FRAMES))
    write_mcap(folder / "lost.mcap", rig, frames_without_reference(rig, wall))
    clean, lost = (
        measure_recording(MeasureTask(folder / name, store), lambda *_: None).measurement_ids[0]
        for name in ("clean.mcap", "lost.mcap")
    )
    calibration = calibrate([(Store.open(store), clean)])
    found = Judge(Store.open(store), JudgeSettings(Criteria(r, method), calibration)).judge(lost)
    rows = run_sql(Store.open(store), "SELECT frame, kind, e, reason FROM verdicts ORDER BY frame").to_pylist()
    return found, rows, Store.open(store)


# One clean drive tells the robust method little of the next one.
@pytest.mark.parametrize(("method", "r"), [(Method.PAPER, Decimal(0)), (Method.ROBUST, Decimal("0.05"))])
def test_the_other_two_cameras_find_the_wall_and_name_nobody(tmp_path, method, r):
    found, rows, store = judged(tmp_path, WIDE, method, r)
    after = rows[LOST:]
    # The wall fills the view of two cameras: to the robust method they may be displaced as well.
    assert {row["kind"] for row in after} <= {VerdictKind.UNIDENTIFIED, VerdictKind.SUSPECT}
    assert {row["e"] for row in after} == {"---1"}
    assert all("judged without S_3" in row["reason"] for row in after)
    assert {len(row["e"]) for row in rows[:LOST]} == {3}
    assert found.found
    facts = run_query(store, "frame", {"frame": LOST, "recording": "lost.mcap"}).to_pylist()
    told = {(row["part"], row["item"]): row["note"] for row in facts}
    assert told["verdict", "reached with"] == "without S_3"
    assert "judged without S_3" in told["verdict", "kind"]


def test_two_cameras_too_close_together_to_check_the_lidar_leave_the_frames_unaudited(tmp_path):
    found, rows, _ = judged(tmp_path, NARROW, wall=False)
    assert {row["kind"] for row in rows[LOST:]} == {VerdictKind.NOT_AUDITABLE}
    reason = "S_3 missing: S_1 and S_2 lie too close together to check the LiDAR, and no third camera was there"
    assert {row["reason"] for row in rows[LOST:]} == {reason}
    assert not found.complete
    assert found.gaps[0] == "5 of 13 frames audited: nothing of camera_3 in 8 frames, the first 5 (0.5 s)"


def test_a_wall_that_they_cannot_check_is_left_unaudited_or_named_by_the_last_scan_and_never_clean(tmp_path):
    """Which of both hangs on whether so wide a wall is another place to the LiDAR."""
    _, rows, _ = judged(tmp_path, NARROW)
    assert {row["kind"] for row in rows[LOST:]} <= {VerdictKind.NOT_AUDITABLE, VerdictKind.UNIDENTIFIED}


def test_a_rig_of_two_cameras_too_close_together_to_check_its_lidar_is_not_audited(tmp_path):
    rig, store = plane_rig((0.06, 0.0)), tmp_path / "audit"
    write_mcap(tmp_path / "clean.mcap", rig, drive_frames(rig, 4))
    known = measure_recording(MeasureTask(tmp_path / "clean.mcap", store), lambda *_: None).measurement_ids[0]
    calibration = calibrate([(Store.open(store), known)])
    Judge(Store.open(store), JudgeSettings(Criteria(Decimal(0)), calibration)).judge(known)
    rows = run_sql(Store.open(store), "SELECT DISTINCT kind, e, reason FROM verdicts").to_pylist()
    reason = "S_1 and S_2 lie too close together to check the LiDAR, and no third camera was there"
    assert rows == [{"kind": "not_auditable", "e": "-", "reason": reason}]


LONE = plane_rig((0.0,))


@pytest.mark.parametrize("first", [0, 3])
@pytest.mark.parametrize("rig", [LONE.alone(0), LONE, plane_rig((0.6, 0.0)), plane_rig()], ids="0123")
def test_a_blind_lidar_is_no_attack_and_never_fully_audited(tmp_path, capfd, rig, first):
    frames = [
        replace(
            frame,
            images={sensor: image for sensor, image in frame.images.items() if sensor in rig.sensors},
            cloud=replace(frame.cloud, xyz_m=frame.cloud.xyz_m[: 0 if frame.number >= first else None]),
        )
        for frame in drive_frames(rig if rig.cameras else LONE, 6)
    ]
    write_mcap(tmp_path / "blind.mcap", rig, frames)
    least = ["--min-view", "0", "--min-coverage", "0"]
    assert run(["scan", str(tmp_path / "blind.mcap"), "--store", str(tmp_path / "audit"), "--jobs", "1", *least]) == 3
    told = "".join(capfd.readouterr())
    assert f"{6 - first} messages from {first / 10:.1f} s on: it shows nothing: no beam of it returned" in told
    assert "incident" not in told.replace("none with incidents", "")
