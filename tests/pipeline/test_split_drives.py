"""Split drives and changing calibrations through the whole chain: what is kept in the store."""

from dataclasses import replace
from itertools import chain, cycle
from pathlib import Path

import numpy as np
import pytest

from auditor.cli import run
from auditor.errors import RecordingError
from auditor.model.frames import Message
from auditor.pipeline.measure import measure_recording
from auditor.pipeline.measured import MeasureResult, MeasureTask
from auditor.pipeline.pictures import location_of
from auditor.recordings import Location, find_recordings, schemas
from auditor.recordings.parameters import CALIBRATION_CHANGES
from auditor.recordings.rigs.in_force import CHANGING, TOO_OFTEN
from auditor.store.queries import run_query
from auditor.store.store import Store
from tests.making.scenes import plane_rig
from tests.making.small_drives import PERIOD_NS, START_NS, drive_frames
from tests.making.split_drives import messages_of, some, write_messages, write_parts

RIG = plane_rig((0.6, 0.0), lidar=True)
RIGS = 3
"""Of the pair, and of each camera by its own past."""
COUNT = 6
ZOOMED = replace(
    RIG, cameras=tuple(replace(c, projection=np.diag([1.05, 1.05, 1.0]) @ c.projection) for c in RIG.cameras)
)


@pytest.fixture(scope="module")
def messages() -> list[Message]:
    return messages_of(".mcap", RIG, drive_frames(RIG, COUNT))


def measured(store: Path, location: Location) -> MeasureResult:
    return measure_recording(MeasureTask(location, store), lambda *_: None)


def tables(store: Path, one: MeasureResult) -> list[bytes]:
    """The stored frames of each measurement."""
    return [Store.open(store).path("frames", known).read_bytes() for known in one.measurement_ids]


def test_a_split_drive_is_kept_as_its_folder_is(tmp_path: Path, messages: list[Message]) -> None:
    parts = write_parts(tmp_path / "log", ".mcap", messages, (START_NS + 3 * PERIOD_NS - 1,))
    (by_files,) = find_recordings(parts).recordings
    from_files = measured(tmp_path / "a", by_files)
    (tmp_path / "log" / "metadata.yaml").write_text("rosbag2_bagfile_information:\n")
    from_folder = measured(tmp_path / "b", Location(tmp_path / "log"))
    assert from_files.recording_id == from_folder.recording_id
    assert from_files.measurement_ids == from_folder.measurement_ids
    assert tables(tmp_path / "a", from_files) == tables(tmp_path / "b", from_folder)
    kept = Store.open(tmp_path / "a").recording(from_files.recording_id)
    assert (kept.name, kept.files, kept.format) == ("drive", ("drive_0.mcap", "drive_1.mcap"), "mcap")
    assert kept.size_bytes == sum(part.stat().st_size for part in parts)


def test_cameras_and_lidar_in_two_files_are_measured_together(tmp_path: Path, messages: list[Message]) -> None:
    write_messages(tmp_path / "in" / "cams.mcap", some(messages, lambda m: m.schema != schemas.POINT_CLOUD))
    write_messages(tmp_path / "in" / "velo.mcap", some(messages, lambda m: m.schema == schemas.POINT_CLOUD))
    (location,) = find_recordings([tmp_path / "in"]).recordings
    done = measured(tmp_path / "a", location)
    store = Store.open(tmp_path / "a")
    assert store.measurement(done.measurement_ids[0]).measured == COUNT
    assert store.recording(done.recording_id).files == ("cams.mcap", "velo.mcap")


def test_two_rosbag2_folders_measured_together_are_said_to_be_and_are_found_again(
    tmp_path: Path, messages: list[Message]
) -> None:
    chosen = {"cams": lambda m: m.schema != schemas.POINT_CLOUD, "velo": lambda m: m.schema == schemas.POINT_CLOUD}
    for name, choose in chosen.items():
        write_messages(tmp_path / "in" / name / f"{name}_0.mcap", some(messages, choose))
        (tmp_path / "in" / name / "metadata.yaml").write_text("rosbag2_bagfile_information:\n")
    (location,) = find_recordings([tmp_path / "in"]).recordings
    done = measured(tmp_path / "a", location)
    assert [remark for remark in done.remarks if "one recording" in remark] == list(location.remarks)
    record = Store.open(tmp_path / "a").recording(done.recording_id)
    assert record.files == ("cams/cams_0.mcap", "velo/velo_0.mcap")
    assert location_of(record) == location
    with pytest.raises(RecordingError, match="not there any more"):
        location_of(replace(record, files=("../in/cams/cams_0.mcap", "/velo/velo_0.mcap")))


def test_a_changed_calibration_is_a_second_measurement_and_both_are_told(
    tmp_path: Path, messages: list[Message], capfd: pytest.CaptureFixture[str]
) -> None:
    behind = list(drive_frames(RIG, COUNT, start_ns=START_NS + COUNT * PERIOD_NS))
    path = write_messages(tmp_path / "a.mcap", [*messages, *messages_of(".mcap", ZOOMED, behind)])
    done = measured(tmp_path / "audit", Location(path))
    store = Store.open(tmp_path / "audit")
    kept = [store.measurement(known) for known in done.measurement_ids]
    assert [one.measured for one in kept] == [COUNT, COUNT] * RIGS
    assert [one.skipped for one in kept] == [{}, {}] * RIGS
    assert [one.first_stamp_ns for one in kept].count(START_NS + COUNT * PERIOD_NS) == RIGS
    assert any("the calibration changes at 0.6 s" in warning for warning in done.calibration_warnings)
    again = measured(tmp_path / "audit", Location(path))
    assert (again.fresh, again.measurement_ids) == (False, done.measurement_ids)
    assert again.calibration_warnings == done.calibration_warnings
    assert run(["inspect", str(path)]) == 0
    assert "the calibration changes at 0.6 s" in capfd.readouterr().out


@pytest.mark.parametrize("every", [2, 11])
def test_frames_between_quick_changes_and_behind_too_many_are_told_with_what_to_do(
    tmp_path: Path, messages: list[Message], every: int
) -> None:
    changed = [
        messages_of(".mcap", rig, list(drive_frames(rig, 1, start_ns=START_NS + (COUNT + every * number) * PERIOD_NS)))
        for number, rig in zip(range(CALIBRATION_CHANGES.most + 2), cycle([ZOOMED, RIG]))
    ]
    path = write_messages(tmp_path / "a.mcap", [*messages, *chain(*changed)])
    measured(tmp_path / "audit", Location(path))
    rows = run_query(Store.open(tmp_path / "audit"), "not_audited", {}).to_pylist()
    told = [row for row in rows if row["what"] == "frames"]
    assert told
    assert {row["reason"] for row in told} == {CHANGING if every == 2 else TOO_OFTEN}
    assert all("--rig" in row["remedy"] for row in told)


def test_a_change_behind_the_last_frame_makes_no_measurement(tmp_path: Path, messages: list[Message]) -> None:
    behind = list(drive_frames(ZOOMED, 1, start_ns=START_NS + COUNT * PERIOD_NS))
    infos = some(messages_of(".mcap", ZOOMED, behind), lambda m: m.schema == schemas.CAMERA_INFO)
    path = write_messages(tmp_path / "a.mcap", [*messages, *infos])
    done = measured(tmp_path / "audit", Location(path))
    assert len(done.measurement_ids) == RIGS
    assert done.frames == COUNT * RIGS


def test_a_scan_of_the_parts_is_one_row_with_the_origin_of_the_first(
    tmp_path: Path, messages: list[Message], capfd: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "car7"
    parts = write_parts(folder, ".mcap", messages, (START_NS + 3 * PERIOD_NS - 1,))
    call = ["scan", *map(str, parts), "--measure-only", "--store", str(tmp_path / "audit"), "--jobs", "1"]
    assert run([*call, "--path-pattern", "{vehicle}/{drive}_0.mcap"]) == 3
    assert f"{folder / 'drive'}: {COUNT * RIGS} frames measured, by {RIGS} rigs" in capfd.readouterr().err.replace(
        "\n", " "
    )
    store = Store.open(tmp_path / "audit")
    (known,) = store.ids("recordings")
    kept = store.recording(known)
    assert (kept.name, kept.vehicle, kept.drive) == ("drive", "car7", "drive")


def test_a_missing_part_leaves_the_audit_incomplete(tmp_path: Path, messages: list[Message]) -> None:
    starts = [START_NS + number * PERIOD_NS - 1 for number in (2, 4)]
    parts = write_parts(tmp_path / "log", ".mcap", messages, starts)
    parts[1].unlink()
    (location,) = find_recordings([tmp_path / "log"]).recordings
    done = measured(tmp_path / "audit", location)
    assert done.damage == ("part 1 is missing between drive_0.mcap and drive_2.mcap",)
