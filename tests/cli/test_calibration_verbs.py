"""`auditor calibration`: versions that are listed, compared, promoted, rolled back and checked."""

import io
import json
import shutil
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import replace

import pytest

from auditor import __version__
from auditor.cli import calibration_tables, run
from auditor.lab.simulation.drives import make_drive
from auditor.model.verdict import JUDGING_VERSION
from auditor.pipeline import workers
from auditor.recordings import write_mcap
from auditor.store.store import Store
from auditor.store.tables import read_rows, write_rows
from auditor.store.versions.history import calibrations_in_force
from tests.making.audits import Audit
from tests.making.fleets import FRAMES, add_drive


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """Two stores of clean drives, measured: the second has one drive more, in which all statistics are higher."""
    folder = tmp_path_factory.mktemp("fleet")
    for name, extra in (("one", ()), ("two", (9,))):
        store = Store.open(folder / name, create=True)
        for day in range(3):
            add_drive(store, f"clean{day}.mcap", seed=day, day=day)
        for seed in extra:
            add_drive(store, "new.mcap", seed=seed, day=seed, raised=0.4)
    store = Store.open(folder / "audit", create=True)
    add_drive(store, "drive.mcap", seed=20, day=20, attacked=(2,))
    return folder


@pytest.fixture(scope="module")
def night(kept):
    """A store in which a first calibration is in force and judged by, and a second is a candidate."""
    said = io.StringIO()
    with redirect_stderr(said), redirect_stdout(io.StringIO()):
        assert run(["calibrate", str(kept / "one"), "--store", str(kept / "audit")]) == 0
        assert run(["judge", str(kept / "audit")]) == 1
        assert run(["calibrate", str(kept / "two"), "--store", str(kept / "audit")]) == 0
    first, second = [line for line in said.getvalue().splitlines() if line.startswith("calibration ")]
    assert "is in force for its rig kind: scans judge by it" in first
    assert "is a candidate" in second
    assert "auditor calibration promote" in second
    return kept / "audit"


@pytest.fixture
def audit(night, tmp_path, capfdbinary):
    return Audit(shutil.copytree(night, tmp_path / "audit"), capfdbinary.readouterr)


def versions(audit):
    return {row["state"]: row for row in audit("calibration", "list", "--format", "json").rows}


def verdict_files(store):
    return {path.name: path.read_bytes() for path in (store / "verdicts").iterdir()}


def test_a_later_calibration_is_a_candidate_until_it_is_promoted(audit):
    found = versions(audit)
    assert found.keys() == {"in force", "candidate"}
    assert found["candidate"]["parent"] == found["in force"]["calibration_id"]
    assert (found["in force"]["recordings"], found["candidate"]["recordings"]) == (3, 4)
    candidate = found["candidate"]["calibration_id"]
    assert audit("calibration", "promote", candidate[:8], "--reason", "looked at").code == 0
    [now] = calibrations_in_force(Store.open(audit.store))
    assert now.calibration_id == candidate
    assert audit.ask("SELECT reason FROM calibration_history WHERE in_force") == [{"reason": "looked at"}]
    assert "is confirmed" in audit("calibration", "promote", candidate[:8]).err


def test_a_candidate_can_be_judged_by_without_coming_into_force(audit):
    found = versions(audit)
    candidate = found["candidate"]["calibration_id"]
    audit("judge", audit.store, "--calibration", candidate[:10], store=False)
    assert audit.ask("SELECT calibration_id FROM judgements WHERE current") == [{"calibration_id": candidate}]
    audit("judge", audit.store, store=False)
    [by] = audit.ask("SELECT calibration_id FROM judgements WHERE current")
    assert by["calibration_id"] == found["in force"]["calibration_id"]


def test_a_rollback_gives_the_earlier_verdicts_byte_for_byte(audit):
    found, before = versions(audit), verdict_files(audit.store)
    [judged] = audit.ask("SELECT * EXCLUDE (judged_at) FROM judgements WHERE current")
    audit("calibration", "promote", found["candidate"]["calibration_id"])
    assert audit("judge", audit.store, store=False).code in (0, 1)
    [by] = audit.ask("SELECT calibration_id FROM judgements WHERE current")
    assert by["calibration_id"] == found["candidate"]["calibration_id"]
    (later,) = verdict_files(audit.store).keys() - before.keys()
    (audit.store / "verdicts" / next(iter(before))).unlink()  # so that it has to be written again
    rolled = audit("calibration", "rollback", "--reason", "a log was attacked")
    assert rolled.code == 0
    assert "1 measurements judged again" in rolled.err
    after = verdict_files(audit.store)
    assert {name: after[name] for name in before} == before
    assert later in after, "judgements stay"
    assert audit.ask("SELECT * EXCLUDE (judged_at) FROM judgements WHERE current") == [judged]
    assert versions(audit)["earlier"]["calibration_id"] == found["candidate"]["calibration_id"]


def test_without_a_version_of_before_nothing_is_rolled_back(audit):
    answer = audit("calibration", "rollback")
    assert answer.code == 2
    assert "there is no version of before" in answer.err


def test_what_a_calibration_was_made_of_is_shown(audit):
    known = versions(audit)["candidate"]["calibration_id"]
    shown = audit("calibration", "show", known[:8]).out.decode()
    assert all(name in shown for name in ("clean0.mcap", "new.mcap", "given as clean", "candidate"))
    full = json.loads(audit("calibration", "show", known[:8], "--format", "json").out)
    assert len(full["used"]) == 4
    assert all(one["findings_by_others"] is not None and one["day"] for one in full["used"])
    assert full["frames"] == full["frames_by_others"] == 4 * FRAMES
    assert (full["auditor_version"], full["judging_version"]) == (__version__, JUDGING_VERSION)
    assert full["hours"] > 0
    assert full["rules"] in shown


def test_two_calibrations_are_compared_by_recordings_and_thresholds(audit):
    found = versions(audit)
    ids = [found[state]["calibration_id"][:10] for state in ("in force", "candidate")]
    text = audit("calibration", "diff", *ids).out.decode()
    assert "only in B" in text
    rises = [row["rise"] for row in audit("calibration", "diff", *ids, "--format", "json").rows]
    assert rises == sorted(rises, reverse=True)
    assert rises[0] > 0, "a drive of higher statistics raises thresholds"
    same = audit("calibration", "diff", ids[0], ids[0], "--format", "json").rows
    assert {row["rise"] for row in same} == {0}


def test_an_exported_calibration_is_judged_by_elsewhere(audit, tmp_path):
    found = versions(audit)["candidate"]["calibration_id"]
    assert audit("calibration", "export", found[:8], tmp_path / "fleet.thresholds").code == 0
    answer = audit("judge", audit.store, "--calibration", tmp_path / "fleet.thresholds", store=False)
    assert answer.code in (0, 1)
    (tmp_path / "other").write_text("something else")
    assert audit("calibration", "export", found[:8], tmp_path / "other").code == 2


def test_verify_finds_a_changed_calibration_and_makes_whole_ones_again(audit, kept):
    known = versions(audit)["in force"]["calibration_id"]
    assert audit("calibration", "verify").code == 0
    own = Audit(kept / "one", audit._printed)
    assert own("calibrate", kept / "one").code == 0
    assert "1 of them made again" in own("calibration", "verify").err
    path = Store.open(audit.store).path("calibrations", known)
    rows = read_rows("calibrations", path)
    rows[0]["stamps_ns"] = [stamp + 1 for stamp in rows[0]["stamps_ns"]]
    write_rows("calibrations", path, rows)
    answer = audit("calibration", "verify")
    assert answer.code == 3
    assert "was changed after it was made" in answer.out.decode()


def test_an_unknown_calibration_is_refused_with_what_lists_them(audit):
    for words in (("show", "ffff"), ("promote", ""), ("diff", "ffff", "ffff")):
        answer = audit("calibration", *words)
        assert (answer.code, "no calibration has that id; auditor calibration list" in answer.err) == (2, True), words
    assert "auditor: '': no calibration has that id; " in audit("calibration", "promote", "").err
    answer = audit("calibration", "rollback", "ffff")
    assert (answer.code, "name one that is in force" in answer.err) == (2, True)


def drive_of(folder, name, cameras):
    """A short clean recording of so many cameras beside a LiDAR."""
    drive = make_drive(2, 4, n_cameras=cameras, width_px=320, height_px=120)
    write_mcap(folder / name, drive.rig, drive.frames())
    return folder / name


def test_two_rig_kinds_into_one_file_are_refused_with_their_names_before_anything_is_measured(tmp_path, capfd):
    recordings = [str(drive_of(tmp_path, f"{cameras}.mcap", cameras)) for cameras in (3, 4)]
    store, out = tmp_path / "audit", tmp_path / "one.json"
    assert run(["calibrate", *recordings, "--store", str(store), "--out", str(out)]) == 2
    said = capfd.readouterr().err
    assert "--out: these recordings have 2 rig kinds (LiDAR + 3 cameras" in said
    assert "; LiDAR + 4 cameras" in said
    assert "measured" not in said
    assert not Store.open(store).measurements()
    assert not out.exists()


def test_the_rig_kinds_of_files_that_the_store_knows_are_not_read_again(tmp_path, capfd, monkeypatch):
    recordings = [str(drive_of(tmp_path, f"{cameras}.mcap", cameras)) for cameras in (3, 4)]
    calibrate = ["calibrate", *recordings, "--store", str(tmp_path / "audit")]
    assert run(calibrate) == 3  # two drives of the same stamps
    read = []
    monkeypatch.setattr(workers, "run_within", lambda *call: read.append(call))
    assert run([*calibrate, "--out", str(tmp_path / "one.json")]) == 2
    assert "--out: these recordings have 2 rig kinds (LiDAR + 3 cameras" in capfd.readouterr().err
    assert read == []


def test_a_calibration_of_what_cannot_be_measured_says_why(tmp_path, capfd):
    drive = make_drive(2, 3, n_cameras=2, width_px=320, height_px=120)
    rig = replace(drive.rig, lidar=None)
    write_mcap(tmp_path / "pair.mcap", rig, (replace(frame, cloud=None) for frame in drive.frames()))
    assert run(["calibrate", str(tmp_path / "pair.mcap"), "--store", str(tmp_path / "audit")]) == 2
    said = capfd.readouterr().err
    assert "no recording could be measured to calibrate on: no triple possible: 2 cameras look the same way" in said
    assert "no clean recording" not in said


def test_how_long_clean_recordings_are_is_said_in_a_unit_that_can_be_read():
    assert [calibration_tables._time(seconds / 3600) for seconds in (1.25, 90, 5400)] == ["1.25 s", "1.5 min", "1.5 h"]
