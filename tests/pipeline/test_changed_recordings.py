"""A recording that is replaced, overwritten or cut while it is measured: it is refused, and nothing of it is kept."""

import hashlib
import os
from pathlib import Path

import pytest

from auditor.errors import RecordingError
from auditor.pipeline import measure
from auditor.pipeline.workers import Progress, run_all
from auditor.recordings import content
from auditor.store.store import Store
from tests.making.reading_all import count_reads
from tests.making.small_drives import THREE_CAMERAS, write_drive

FRAMES = 4


@pytest.fixture
def drives(tmp_path):
    """A recording that is clean, and one of the same moments that is attacked."""
    clean = write_drive(tmp_path / "drive.mcap", FRAMES, seed=1, positions_m=THREE_CAMERAS)
    attacked = write_drive(
        tmp_path / "attacked.mcap", FRAMES, seed=1, positions_m=THREE_CAMERAS, attacked={2: range(FRAMES)}
    )
    return clean, attacked


def replace(path: Path, other: Path) -> None:
    other.replace(path)


def overwrite(path: Path, other: Path) -> None:
    status = path.stat()
    with path.open("r+b") as out:
        out.write(other.read_bytes())
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))


def truncate(path: Path, other: Path) -> None:  # as the others
    os.truncate(path, path.stat().st_size // 2)


@pytest.mark.parametrize("change", [replace, overwrite, truncate])
@pytest.mark.parametrize("end", [False, True])
def test_a_recording_that_changes_between_hashing_and_the_end_of_measuring_is_refused(
    drives, tmp_path, monkeypatch, change, end
):
    clean, attacked = drives
    survey, measure_frames = measure.survey, measure._Measuring.frames

    def changing_at_start(recording):
        change(clean, attacked)
        return survey(recording)

    def changing_at_end(measuring):
        yield from measure_frames(measuring)
        change(clean, attacked)

    if end:
        monkeypatch.setattr(measure._Measuring, "frames", changing_at_end)
    else:
        monkeypatch.setattr(measure, "survey", changing_at_start)
    task = measure.MeasureTask(clean, tmp_path / "audit")
    with pytest.raises(RecordingError, match=r"changed while it was read.*scan it again"):
        measure.measure_recording(task, lambda *_: None)
    store = Store.open(tmp_path / "audit")
    assert not any(store.ids(table) for table in ("measurements", "recordings", "labels"))
    assert not list(store.folder.glob("frames/*.parquet"))
    assert not (store.folder / "pictures").exists()


def test_a_recording_is_read_for_its_hash_and_for_its_frames(tmp_path, monkeypatch):
    path = write_drive(tmp_path / "drive.mcap", 30, seed=1, positions_m=THREE_CAMERAS)
    monkeypatch.setattr(content, "_BLOCK_BYTES", 1 << 14)  # as small beside it as they are beside a drive
    read = count_reads(monkeypatch)
    measure.measure_recording(measure.MeasureTask(path, tmp_path / "store"), lambda what, done: None)
    # Its sensors are learnt from the beginning, which of a short recording is all of it, and is hashed meanwhile.
    # The clock is told by the first chunk.
    assert sum(read) < 2.1 * path.stat().st_size + 2**21


def hash_as_it_is_written(path: Path, _: Progress) -> str:
    hashed = content.FileContent(path)
    if path.name == "growing.mcap":
        with path.open("ab") as out:
            out.write(b"a record more")
    return hashed.sha256


def test_a_recording_that_grows_is_refused_by_the_process_that_reads_it_and_the_others_go_on(tmp_path):
    paths = [tmp_path / name for name in ("a.mcap", "growing.mcap", "z.mcap")]
    for path in paths:
        path.write_bytes(b"a record")
    outcomes = {one.item.name: one for one in run_all(hash_as_it_is_written, paths, 2, lambda *_: None)}
    assert outcomes["a.mcap"].result == outcomes["z.mcap"].result == hashlib.sha256(b"a record").hexdigest()
    assert "changed while it was read: nothing of this is kept; scan it again" in str(outcomes["growing.mcap"].error)
