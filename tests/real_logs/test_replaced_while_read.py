"""A recording that changes between hashing and measuring: no hash stands for the frames of other bytes."""

import hashlib
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from auditor.cli import run
from auditor.cli.exit_codes import Exit
from auditor.errors import RecordingError
from auditor.pipeline import measure
from auditor.pipeline.measure import measure_recording
from auditor.pipeline.measured import MeasureTask
from auditor.store.store import Store
from tests.making.audits import Audit
from tests.making.logs_of_strangers import NO_ATTACK, record, write
from tests.making.vehicles_of_strangers import VAN
from tests.making.ways_to_hide import MOMENTS, SEED, SPOT

Change = Callable[[Path, bytes], None]


def renamed_over(path: Path, other: bytes) -> None:
    beside = path.with_name("other")
    beside.write_bytes(other)
    beside.rename(path)


def overwritten(path: Path, other: bytes) -> None:
    """In place, with the same size and the same times as before."""
    times = path.stat()
    with path.open("r+b") as file:
        file.write(other)
    os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))


@pytest.fixture(scope="module")
def contents(tmp_path_factory: pytest.TempPathFactory) -> tuple[bytes, bytes]:
    """A clean and an attacked recording of the same moments, equally large."""
    folder = tmp_path_factory.mktemp("contents")
    clean, attacked = (
        write(folder / f"{number}.mcap", record(VAN, range(MOMENTS), attack=attack, seed=SEED)).read_bytes()
        for number, attack in enumerate((NO_ATTACK, SPOT))
    )
    assert len(clean) == len(attacked)
    return clean, attacked


@pytest.mark.parametrize(
    ("change", "when", "was_attacked"),
    [
        (renamed_over, "after the survey", True),
        (renamed_over, "after the first frame", False),
        (overwritten, "after the survey", False),
        (overwritten, "after the first frame", True),
    ],
)
def test_no_hash_stands_for_other_bytes(
    change: Change,
    when: str,
    was_attacked: bool,
    contents: tuple[bytes, bytes],
    audit: Audit,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    before, after = contents[was_attacked], contents[not was_attacked]
    path = tmp_path / "log.mcap"
    path.write_bytes(before)
    surveying, known = measure.survey, set(Store.open(audit.store).ids("measurements"))

    def survey(recording):
        surveyed = surveying(recording)
        if when == "after the survey":
            change(path, after)
        return surveyed

    def progress(_: str, done: int) -> None:
        if when == "after the first frame" and done == 1:
            change(path, after)

    monkeypatch.setattr(measure, "survey", survey)
    try:
        measured = measure_recording(MeasureTask(path, audit.store), progress)
    except RecordingError:
        assert set(Store.open(audit.store).ids("measurements")) == known, "a refused recording leaves no measurement"
        return
    assert measured.recording_id == hashlib.sha256(before).hexdigest()
    assert run(["judge", str(audit.store)]) == (Exit.FINDINGS if was_attacked else Exit.CLEAN)
