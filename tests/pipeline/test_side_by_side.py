"""What several processes judge is what one judges, byte for byte, and is told in the same order."""

import os
import shutil
from decimal import Decimal
from pathlib import Path

import pytest

from auditor.cli import run, summary
from auditor.errors import ThresholdsError
from auditor.pipeline import judged
from auditor.pipeline.calibrations import batch as side_by_side
from auditor.pipeline.calibrations.batch import judge_side_by_side
from auditor.pipeline.judge import Criteria
from auditor.pipeline.judged import JudgeSettings, judge_all
from auditor.store.log.chains import entries
from auditor.store.packs import packing
from auditor.store.store import Store
from tests.making.calibrations import calibrate
from tests.making.fleets import add_drive

R = Decimal("0.03")


@pytest.fixture
def store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Store:
    """Three measured drives, one of them attacked; a process is worth one of them."""
    monkeypatch.setattr(side_by_side, "WORTH_A_PROCESS", 1)
    made = Store.open(tmp_path / "audit", create=True)
    for seed, attacked in enumerate([(), (2,), ()]):
        add_drive(made, f"{seed}.mcap", seed=seed, attacked=attacked, frames=30)
    return made


def verdicts(store: Store) -> dict[str, bytes]:
    """The files of all verdicts, by their judgements."""
    return {known: store.path("verdicts", known).read_bytes() for known in store.ids("judgements")}


@pytest.mark.parametrize("named", [False, True])
def test_several_processes_judge_as_one_does(
    store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, named: bool
) -> None:
    monkeypatch.setattr(judged, "FEW", 0)  # this process reads all recordings at once, the others one by one
    known = store.ids("measurements")
    settings = JudgeSettings(Criteria(R), calibrate([(store, known[0])]) if named else None)
    other = Store.open(shutil.copytree(store.folder, tmp_path / "other"))
    alone = list(judge_all(other, known, settings))
    together = list(judge_side_by_side(store, known, settings, jobs=2))
    assert [(one.measurement_id, one.warnings, one.found) for one in together] == [
        (one.measurement_id, one.warnings, one.found) for one in alone
    ]
    assert any(one.found for one in together)
    assert len(verdicts(store)) == len(known)
    assert verdicts(store) == verdicts(other)
    last = [entry for entry in entries(store.folder) if entry.kind == "wrote"][-3:]
    assert len({entry.pid for entry in last}) == 2
    assert len({entry.run for entry in last}) == 1


def test_what_a_process_cannot_begin_with_is_raised(store: Store) -> None:
    calibration = calibrate([(store, store.ids("measurements")[0])])
    store.write_calibration(calibration)
    path = store.path("calibrations", calibration.calibration_id)
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(ThresholdsError, match="no calibration"):
        list(judge_side_by_side(store, store.ids("measurements"), JudgeSettings(Criteria(R), calibration), jobs=2))


def test_few_measurements_are_judged_in_this_process(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(side_by_side, "WORTH_A_PROCESS", 3)
    list(judge_side_by_side(store, store.ids("measurements"), JudgeSettings(Criteria(R)), jobs=2))
    assert {entry.pid for entry in entries(store.folder)} == {os.getpid()}


def test_the_verb_takes_how_many_processes(store: Store, capfd: pytest.CaptureFixture[str]) -> None:
    assert run(["judge", str(store.folder), "--jobs", "2", "--format", "csv"]) in (1, 3)
    assert len(capfd.readouterr().out.splitlines()) == 4
    last = [entry for entry in entries(store.folder) if entry.kind == "wrote"][-3:]
    assert len({entry.pid for entry in last}) == 2


def test_what_the_verb_writes_is_packed_before_it_is_shown(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    """Thousands of new files would each be opened by the tables."""
    monkeypatch.setattr(packing, "MANY_FILES", 2)
    shown: list[int] = []
    monkeypatch.setattr(summary, "show_audit", lambda *_, **__: shown.append(len([*store.folder.glob("verdicts/*")])))
    run(["judge", str(store.folder), "--jobs", "1"])
    assert shown == [0]
    assert len(store.ids("verdicts")) == 3
