"""A calibration of many recordings is that of few, and any number of processes makes the same file."""

import shutil
from dataclasses import dataclass
from datetime import UTC, datetime
from decimal import Decimal
from pathlib import Path

import pytest

from auditor.errors import StoreError
from auditor.model.measurement import Statistic
from auditor.model.rig_kind import ComparedTo
from auditor.pipeline.calibrations import making
from auditor.pipeline.calibrations.clean import CleanMeasurements, choose_clean
from auditor.pipeline.calibrations.making import make
from auditor.pipeline.calibrations.versions import CalibrationEntry, keep_calibrated
from auditor.pipeline.clean_frames import clean_frames_of
from auditor.store import calibrations
from auditor.store.store import Store
from tests.making.fleets import add_drive
from tests.making.left_out import leave_one_out_paper, leave_one_out_robust

R = Decimal("0.05")
DRIVES, FRAMES = 6, 30


@dataclass(frozen=True)
class Made:
    """A calibration of the drives, as it was kept, and the bytes of its file."""

    store: Store
    kept: CalibrationEntry
    file: bytes


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Store:
    """Six measured drives, some of them attacked."""
    made = Store.open(tmp_path_factory.mktemp("many") / "audit", create=True)
    for seed in range(DRIVES):
        add_drive(made, f"{seed}.mcap", seed=seed, attacked=(2,) if seed in (1, 4) else (), frames=FRAMES)
    return made


def made_of(measured: Store, folder: Path, jobs: int) -> Made:
    store = Store.open(shutil.copytree(measured.folder, folder / "audit"))
    made = make(choose_clean([(store, known) for known in store.ids("measurements")], []), R, jobs=jobs)
    kept = keep_calibrated(store, made)
    return Made(store, kept, store.path("calibrations", made.calibration.calibration_id).read_bytes())


@pytest.fixture
def at_one_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Calibrations are made at one time."""

    class Clock(datetime):
        @classmethod
        def now(cls, tz: object = None) -> "Clock":
            return cls(2026, 1, 2, tzinfo=UTC)

    monkeypatch.setattr(calibrations, "datetime", Clock)


@pytest.mark.usefixtures("at_one_time")
@pytest.mark.parametrize("jobs", [1, 2])
def test_what_is_read_twice_by_any_number_of_processes_gives_the_file_of_what_is_read_once(
    measured: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, jobs: int
) -> None:
    once = made_of(measured, tmp_path / "once", 1)
    monkeypatch.setattr(making, "MOST_FRAMES_KEPT", DRIVES * FRAMES - 1)
    monkeypatch.setattr(making, "MOST_GIVEN_BACK", 2 * FRAMES)
    twice = made_of(measured, tmp_path / "twice", jobs)
    assert twice.file == once.file
    assert (twice.kept.left_out, twice.kept.left_out_by_paper) == (once.kept.left_out, once.kept.left_out_by_paper)
    assert twice.kept.version.recordings == once.kept.version.recordings
    assert twice.kept.version.resolves_r == once.kept.version.resolves_r


def test_recordings_are_judged_by_the_others_as_by_a_calibration_that_was_read(measured: Store, tmp_path: Path) -> None:
    made = made_of(measured, tmp_path, 1)
    calibration = made.store.calibration(made.kept.version.calibration_id)
    system = make(choose_clean([], [made.store]), R).asked.system
    assert list(made.kept.left_out) == leave_one_out_robust(calibration, system, R)
    assert list(made.kept.left_out_by_paper) == leave_one_out_paper(calibration, Statistic.GATED, R)
    assert any(one.findings for one in made.kept.left_out)


def test_few_recordings_are_read_once_and_many_twice(
    measured: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read: list[str] = []
    known = clean_frames_of

    def counted(store: Store, measurement: str, *more: object, **options: bool) -> object:
        read.append(measurement)
        return known(store, measurement, *more, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(making, "clean_frames_of", counted)
    made_of(measured, tmp_path / "few", 1)
    assert len(read) == DRIVES
    monkeypatch.setattr(making, "MOST_FRAMES_KEPT", 1)
    read.clear()
    made_of(measured, tmp_path / "many", 1)
    assert sorted(read) == sorted(2 * measured.ids("measurements"))


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_recording_that_is_damaged_is_told_and_no_calibration_stays(
    measured: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, jobs: int
) -> None:
    store = Store.open(shutil.copytree(measured.folder, tmp_path / "audit"))
    clean = choose_clean([(store, known) for known in store.ids("measurements")], [])
    monkeypatch.setattr(making, "MOST_FRAMES_KEPT", 1)
    made = make(clean, R, jobs=jobs)
    damaged = store.path("fault_features", store.ids("measurements")[3])
    damaged.write_bytes(damaged.read_bytes()[:-100])
    with pytest.raises(StoreError, match="no readable Parquet file"):
        keep_calibrated(store, made)
    assert store.ids("calibrations") == []
    with pytest.raises(StoreError, match="no readable Parquet file"):
        make(clean, R, jobs=jobs)


def test_what_changed_between_the_readings_is_refused(
    measured: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = Store.open(shutil.copytree(measured.folder, tmp_path / "audit"))
    monkeypatch.setattr(making, "MOST_FRAMES_KEPT", 1)
    made = make(choose_clean([(store, known) for known in store.ids("measurements")], []), R)
    one, other = (store.path("frames", known) for known in store.ids("measurements")[:2])
    one.write_bytes(other.read_bytes())
    with pytest.raises(StoreError, match="its id is not that of its content"):
        keep_calibrated(store, made)
    assert store.ids("calibrations") == []


@pytest.mark.parametrize(
    ("compared_to", "left"),
    [
        ([ComparedTo.CAMERAS, ComparedTo.PAST, ComparedTo.PAST], [0]),
        ([ComparedTo.PAST, ComparedTo.SCANS], [0, 1]),
        ([ComparedTo.CAMERAS, ComparedTo.PAST, ComparedTo.LIDARS], [0, 2]),
    ],
)
def test_pasts_are_left_out_of_a_file_only_beside_cameras_that_are_compared(
    monkeypatch: pytest.MonkeyPatch, compared_to: list[ComparedTo], left: list[int]
) -> None:
    groups = [CleanMeasurements((), ()) for _ in compared_to]
    of_group = {id(group): to for group, to in zip(groups, compared_to, strict=True)}
    monkeypatch.setattr(making, "_compared_to", lambda group: of_group[id(group)])
    kept = {id(group) for group in making.without_pasts(groups)}
    assert kept == {id(groups[place]) for place in left}
