"""`auditor refresh`: what it learns from, what it puts in force, and how it ends."""

import fcntl
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from auditor.cli import run
from auditor.identification.refreshing import gate
from auditor.pipeline.labels import label_clean
from auditor.store import files
from auditor.store.calibrations import make_calibration
from auditor.store.log.chains import entries
from auditor.store.log.entry import EntryKind
from auditor.store.store import Store
from auditor.store.versions.history import EntryIntoForce, calibrations_in_force, histories, put_in_force
from tests.making.audits import Audit
from tests.making.fleets import add_drive
from tests.making.pages import HOSTILE, Page
from tests.making.small_drives import write_drive

VEHICLES = 3


@pytest.fixture(scope="module")
def first_night(tmp_path_factory):
    """A fleet of three vehicles, each of which drove on two days; nothing was judged, and nobody named anything."""
    store = Store.open(tmp_path_factory.mktemp("fleet") / "audit", create=True)
    for day in range(2):
        drive_for_a_day(store, day)
    return store.folder


def drive_for_a_day(store, day):
    for vehicle in range(VEHICLES):
        number = day * VEHICLES + vehicle
        add_drive(store, f"v{vehicle}d{day}.mcap", seed=number, vehicle=f"car{vehicle}", day=day)


@pytest.fixture(scope="module")
def three_days(first_night, tmp_path_factory):
    """The same fleet after a third day: enough that single drives do not decide what is unlike the others."""
    folder = shutil.copytree(first_night, tmp_path_factory.mktemp("three_days") / "audit")
    drive_for_a_day(Store.open(folder), 2)
    return folder


@pytest.fixture(scope="module")
def refreshed_later(three_days, tmp_path_factory):
    store = shutil.copytree(three_days, tmp_path_factory.mktemp("refreshed_later") / "audit")
    assert run(["refresh", "--store", str(store)]) == 0
    return store


@pytest.fixture(scope="module")
def refreshed(first_night, tmp_path_factory):
    """The same fleet after its first refresh."""
    store = shutil.copytree(first_night, tmp_path_factory.mktemp("refreshed") / "audit")
    assert run(["refresh", "--store", str(store)]) == 0
    return store


@pytest.fixture
def audit_of(tmp_path, capfdbinary):
    def copied(store):
        return Audit(shutil.copytree(store, tmp_path / "audit"), capfdbinary.readouterr)

    return copied


def kind_of(answer):
    lines = answer.out.decode().splitlines()
    assert len(lines) == 1, "one line of JSON"
    [kind] = json.loads(lines[0])["rig_kinds"]
    assert json.loads(lines[0])["exit"] == answer.code
    return kind


def in_force(audit):
    return [one.calibration_id for one in calibrations_in_force(Store.open(audit.store))]


def test_a_first_version_of_what_nobody_named_is_provisional_and_leaves_out_what_is_raised(three_days, audit_of):
    audit = audit_of(three_days)
    add_drive(Store.open(audit.store), "attacked.mcap", seed=50, vehicle="car9", day=4, attacked=(2,))
    answer = audit("refresh")
    kind = kind_of(answer)
    assert (answer.code, kind["decided"], kind["provisional"], kind["recordings"]) == (1, "promoted", True, 9)
    assert [one["recording"] for one in kind["look_at"]] == ["attacked.mcap"]
    assert in_force(audit) == [kind["calibration"]]
    rows = audit.ask("SELECT name, included, look_at, reason FROM calibration_recordings ORDER BY included, name")
    assert (rows[0]["name"], rows[0]["included"], rows[0]["look_at"]) == ("attacked.mcap", False, True)
    assert all(row["included"] for row in rows[1:])
    assert audit.ask("SELECT count(*) AS n FROM judgements WHERE in_incidents > 0") == [{"n": 1}], "it was judged"
    assert audit("calibration", "verify").code == 0
    assert "its calibration is provisional" in audit("judge", audit.store, store=False).err
    audit("calibration", "promote", kind["calibration"])
    assert "its calibration is provisional" not in audit("judge", audit.store, store=False).err


def test_what_was_named_clean_makes_a_first_version_that_is_not_provisional(first_night, audit_of):
    audit = audit_of(first_night)
    store = Store.open(audit.store)
    for record in store.recordings()[:4]:
        label_clean(store, record)
    kind = kind_of(audit("refresh"))
    assert (kind["decided"], kind["provisional"], kind["recordings"]) == ("promoted", False, 4)
    assert {one["reason"] for one in kind["left_out"]} == {"the first version is made of what was named clean"}
    assert len(kind["left_out"]) == 2


def test_what_a_person_named_stays_named_also_where_the_store_has_it_no_longer(first_night, audit_of, tmp_path):
    audit, other = audit_of(first_night), Store.open(tmp_path / "other", create=True)
    add_drive(other, "short.mcap", seed=40, vehicle="car0", day=9, frames=12)
    assert kind_of(audit("refresh", other.folder, "--clean"))["recordings"] == 1
    kind = kind_of(audit("refresh"))
    assert kind["recordings"] == 7, "those of the store are judged clean by what was named, which stays"
    rows = audit.ask(f"""
        SELECT name, reason FROM calibration_recordings
        WHERE included AND calibration_id = '{kind["calibration"]}' AND name = 'short.mcap'
    """)
    assert rows == [{"name": "short.mcap", "reason": "named clean"}]
    assert not kind["provisional"]


def test_a_night_with_nothing_new_changes_nothing(refreshed, audit_of):
    audit = audit_of(refreshed)
    before = {path: path.read_bytes() for path in audit.store.rglob("*.parquet")}
    answer = audit("refresh")
    assert (answer.code, kind_of(answer)["decided"]) == (0, "nothing new")
    assert {path: path.read_bytes() for path in audit.store.rglob("*.parquet")} == before


def test_a_new_clean_night_is_promoted_and_names_its_parent(refreshed, audit_of):
    audit = audit_of(refreshed)
    [before] = in_force(audit)
    store = Store.open(audit.store)
    for vehicle in range(VEHICLES):
        add_drive(store, f"v{vehicle}d3.mcap", seed=30 + vehicle, vehicle=f"car{vehicle}", day=3)
    kind = kind_of(audit("refresh"))
    assert (kind["decided"], kind["recordings"], kind["new"], kind["before"]) == ("promoted", 9, 3, before)
    for share in (kind["by_others"], kind["planted_found_before"], kind["planted_found"]):
        assert 0 <= share["value"] <= share["high"] <= 1
        assert share["low"] < share["high"]
    assert in_force(audit) == [kind["calibration"]] != [before]
    [moved] = [one.what for one in entries(audit.store) if one.kind == EntryKind.IN_FORCE and one.what["instead_of"]]
    assert (moved["calibration"], moved["instead_of"], moved["how"]) == (kind["calibration"], before, "refreshed")
    assert audit.ask(f"SELECT parent FROM calibration_versions WHERE calibration_id = '{kind['calibration']}'") == [
        {"parent": before}
    ]
    assert audit("calibration", "rollback").code == 0
    again = kind_of(audit("refresh"))
    assert again["decided"] == "nothing new", "what was new in a version that was rolled back waits for a label"
    assert len(again["look_at"]) == 3
    assert in_force(audit) == [before]


def test_recordings_named_clean_that_have_findings_are_refused(refreshed, audit_of, tmp_path):
    audit, other = audit_of(refreshed), Store.open(tmp_path / "other", create=True)
    add_drive(other, "attacked.mcap", seed=51, vehicle="car9", day=5, attacked=(1,))
    before = in_force(audit)
    answer = audit("refresh", other.folder, "--clean")
    kind = kind_of(answer)
    assert (answer.code, kind["decided"]) == (4, "refused")
    assert "attacked.mcap was named clean, and others find" in kind["reasons"][0]
    assert in_force(audit) == before
    [waiting] = audit("calibration", "quarantine", "--format", "json").rows
    assert waiting["reason"] == kind["look_at"][0]["reason"]
    assert waiting["reason"].startswith("named clean, and others find ")
    states = [row["state"] for row in audit("calibration", "list", "--format", "json").rows]
    assert states == ["in force", "refused"]


def test_what_waits_and_is_named_clean_without_a_look_keeps_its_reason(refreshed, audit_of, tmp_path):
    audit, other = audit_of(refreshed), Store.open(tmp_path / "other", create=True)
    for vehicle in (8, 9):
        add_drive(other, f"attacked{vehicle}.mcap", seed=50 + vehicle, vehicle=f"car{vehicle}", day=5, attacked=(1,))
    audit("refresh", other.folder)
    before = audit("calibration", "quarantine", "--format", "json").rows
    assert [row["reason"].split(":")[0] for row in before] == ["raised by the version in force"] * 2
    assert audit("refresh", other.folder, "--clean").code == 4
    assert audit("calibration", "quarantine", "--format", "json").rows == before
    left_out = [line for line in audit("refresh", other.folder).err.splitlines() if "left out: attacked" in line]
    assert [line.partition("): ")[2] for line in left_out] == [row["reason"] for row in before]


def test_thresholds_that_rise_far_at_once_are_held_until_a_person_promotes_them(refreshed, audit_of, monkeypatch):
    audit = audit_of(refreshed)
    store, before = Store.open(audit.store), in_force(audit)
    add_drive(store, "v0d6.mcap", seed=61, vehicle="car0", day=6, raised=0.05)
    monkeypatch.setattr(gate, "GATE", replace(gate.GATE, most_step=-10.0))
    answer = audit("refresh")
    kind = kind_of(answer)
    assert (answer.code, kind["decided"]) == (1, "held")
    assert "a threshold rises" in kind["reasons"][0]
    assert in_force(audit) == before
    assert audit("calibration", "promote", kind["calibration"][:8]).code == 0
    assert (kind_of(audit("refresh"))["decided"], in_force(audit)) == ("nothing new", [kind["calibration"]])


def test_a_vehicle_that_creeps_is_held_though_every_step_is_small(refreshed, audit_of, monkeypatch):
    audit = audit_of(refreshed)
    store = Store.open(audit.store)
    monkeypatch.setattr(gate, "GATE", replace(gate.GATE, most_step=9.0, most_creep=0.02, most_lost=1.0))
    decided = []
    for night in range(1, 9):
        for vehicle in range(VEHICLES):
            seed = 100 + night * VEHICLES + vehicle
            add_drive(
                store, f"n{night}v{vehicle}", seed=seed, vehicle=f"car{vehicle}", day=10 + night, raised=0.1 * night
            )
        decided.append(kind_of(audit("refresh")))
        if decided[-1]["decided"] != "promoted":
            break
    assert decided[-1]["decided"] == "held"
    assert "that a person confirmed last" in decided[-1]["reasons"][0]


def test_too_many_raised_recordings_refuse_the_night(refreshed, audit_of):
    audit = audit_of(refreshed)
    store = Store.open(audit.store)
    add_drive(store, "clean.mcap", seed=70, vehicle="car1", day=7)
    for number in range(6):
        add_drive(store, f"a{number}", seed=71 + number, vehicle=f"new{number}", day=7, attacked=(2,))
    answer = audit("refresh")
    assert (answer.code, kind_of(answer)["decided"]) == (4, "refused")
    kind = kind_of(answer)
    assert "more than 50%" in kind["reasons"][0]
    quarantine, label, _ = kind["to_do"]
    assert quarantine["command"] == f"auditor calibration quarantine --store {audit.store}"
    assert f"  {quarantine['what']}: {quarantine['command']}" in answer.err
    page = Page((audit.store / "reports" / "refresh.html").read_text())
    assert label["command"] in page.text
    assert run(label["command"].split()[1:]) == 0, "the command is one that runs"


def test_a_night_of_raised_recordings_alone_is_refused_once(refreshed_later, audit_of):
    audit = audit_of(refreshed_later)
    before = in_force(audit)
    for number in range(2):
        add_drive(Store.open(audit.store), f"a{number}", seed=71 + number, vehicle=f"new{number}", day=7, attacked=(2,))
    answer = audit("refresh")
    kind = kind_of(answer)
    assert (answer.code, kind["decided"], kind["calibration"]) == (4, "refused", None)
    assert kind["reasons"][0] == "2 of 2 new recordings are raised or unlike the others, more than 50%"
    assert "the version in force stays" in Page((audit.store / "reports" / "refresh.html").read_text()).text
    assert (audit("refresh").code, in_force(audit)) == (0, before), "nothing has come since"


def test_what_was_raised_waits_for_a_label_whatever_later_thresholds_say(first_night, audit_of, monkeypatch):
    audit = audit_of(first_night)
    store = Store.open(audit.store)
    add_drive(store, "attacked.mcap", seed=50, vehicle="car9", day=4, attacked=(2,))
    assert [one["recording"] for one in kind_of(audit("refresh"))["look_at"]] == ["attacked.mcap"]
    [waiting] = audit("calibration", "quarantine", "--format", "json").rows
    assert (waiting["name"], waiting["vehicle"], waiting["findings"]) == ("attacked.mcap", "car9", 12)
    assert "raised by the prior" in waiting["reason"]
    assert "attacked.mcap" in audit("calibration", "quarantine").out.decode()
    add_drive(store, "v1d8.mcap", seed=80, vehicle="car1", day=8)
    with monkeypatch.context() as patch:
        patch.setattr("auditor.identification.refreshing.drives.DriveScores.raised", lambda *_: "")
        kind = kind_of(audit("refresh"))
    assert (kind["decided"], [one["recording"] for one in kind["look_at"]]) == ("promoted", ["attacked.mcap"])
    assert audit("calibration", "quarantine", "--format", "json").rows == [waiting], "since when it waits is kept"
    assert audit("label", "attacked.mcap", "--sensor", "S_2", "--attack", "laser").code == 0
    assert audit("calibration", "quarantine", "--format", "json").rows == []
    assert audit.ask("SELECT name, labelled FROM quarantine") == [{"name": "attacked.mcap", "labelled": "attacked"}]
    audit("refresh")
    assert audit.ask("SELECT * FROM quarantine") == []
    assert "no recording waits for a person" in audit("calibration", "quarantine").err
    assert audit("store", "check", audit.store, store=False).code == 0


def test_a_drive_unlike_the_others_is_left_out_though_nothing_in_it_is_raised(refreshed_later, audit_of, monkeypatch):
    audit = audit_of(refreshed_later)
    add_drive(Store.open(audit.store), "odd.mcap", seed=65, vehicle="car7", day=6, raised=2.0)
    monkeypatch.setattr("auditor.identification.refreshing.drives.DriveScores.raised", lambda *_: "")
    kind = kind_of(audit("refresh"))
    [odd] = kind["look_at"]
    assert (kind["decided"], odd["recording"]) == ("nothing new", "odd.mcap")
    assert "that of others (p = " in odd["reason"]
    assert audit("label", "odd.mcap", "--clean").code == 0
    kind = kind_of(audit("refresh"))
    assert (kind["recordings"], kind["look_at"]) == (10, []), "a false alarm that somebody looked at teaches"


def test_what_ends_a_scan_in_findings_waits_though_it_is_like_the_others(refreshed_later, audit_of, monkeypatch):
    audit = audit_of(refreshed_later)
    add_drive(Store.open(audit.store), "alert.mcap", seed=66, vehicle="car7", day=6, attacked=(1,))
    monkeypatch.setattr("auditor.identification.refreshing.drives.DriveScores.raised", lambda *_: "")
    for name in ("differing", "influential"):
        monkeypatch.setattr(f"auditor.pipeline.refreshing.choosing.{name}", lambda *_: {})
    answer = audit("refresh")
    [alert] = kind_of(answer)["look_at"]
    assert (answer.code, alert["recording"]) == (1, "alert.mcap")
    assert alert["reason"].endswith("frames of it are in incidents or alerts")
    assert [one["reason"] for one in kind_of(audit("refresh"))["look_at"]] == [alert["reason"]], "it waits on"
    assert audit("label", alert["recording_id"][:8], "--clean").code == 0
    assert kind_of(audit("refresh"))["look_at"] == []


def test_one_road_every_day_is_learnt_from_a_few_times_and_conditions_are_kept(first_night, audit_of):
    audit = audit_of(first_night)
    store = Store.open(audit.store)
    for day in range(8):
        add_drive(
            store,
            f"road{day}.mcap",
            seed=60 + day,
            vehicle=f"truck{day}",
            day=10 + day,
            weather="rain" if day % 2 else None,
            place_deg=(49.0, 8.4),
        )
    kind = kind_of(audit("refresh"))
    assert kind["recordings"] == 11
    rows = audit.ask("SELECT reason, weather, time_of_day FROM calibration_recordings WHERE starts_with(name, 'road')")
    assert [row["reason"] for row in rows].count("5 others drove the same road") == 3
    assert {row["time_of_day"] for row in rows} == {"day", None}, "08:00 UTC in March; not read of those left out"
    assert {row["weather"] for row in rows} == {"rain", None}
    rates = audit.ask("SELECT condition, value, drives, enough FROM calibration_conditions ORDER BY condition, value")
    found = {(row["condition"], row["value"]): (row["drives"], row["enough"]) for row in rates}
    assert found["time of day", "day"] == (5, False)
    assert ("weather", "rain") in found
    shown = audit("calibration", "show", kind["calibration"]).out.decode()
    assert "Windows raised, each judged by others" in shown
    assert "too few to say" in (audit.store / "reports" / "refresh.html").read_text()


def test_some_that_cannot_be_measured_are_said_and_the_others_go_on(refreshed, audit_of, tmp_path):
    audit = audit_of(refreshed)
    (tmp_path / "broken.mcap").write_bytes(b"no recording")
    answer = audit("refresh", tmp_path / "broken.mcap")
    kind_of(answer)
    assert (answer.code, [Path(one["recording"]).name for one in json.loads(answer.out)["failed"]]) == (
        1,
        ["broken.mcap"],
    )


def test_of_two_refreshes_at_once_one_runs_and_the_other_says_so(refreshed, audit_of):
    audit = audit_of(refreshed)
    store = Store.open(audit.store)
    for vehicle in range(VEHICLES):
        add_drive(store, f"v{vehicle}d3.mcap", seed=30 + vehicle, vehicle=f"car{vehicle}", day=3)
    command = [sys.executable, "-m", "auditor", "refresh", "--store", str(audit.store)]
    both = [subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) for _ in range(2)]
    said = [one.communicate()[1].decode() for one in both]
    codes = sorted(one.returncode for one in both)
    assert codes in ([0, 0], [0, 2]), said
    assert (2 in codes) == any("another refresh of this store is running" in one for one in said)
    assert len(histories(store)[0].moves) == 2
    assert audit("verify", audit.store, store=False).code == 0


def test_a_file_that_may_not_grow_leaves_one_version_in_force_and_whole(refreshed, audit_of):
    audit = audit_of(refreshed)
    before = in_force(audit)
    add_drive(Store.open(audit.store), "v1d8.mcap", seed=80, vehicle="car1", day=8)

    def small_files():
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)

    command = [sys.executable, "-m", "auditor", "refresh", "--store", str(audit.store)]
    ended = subprocess.run(command, capture_output=True, text=True, check=False, preexec_fn=small_files)
    assert ended.returncode == 2
    assert "File too large" in ended.stdout + ended.stderr
    assert "Traceback" not in ended.stderr
    assert in_force(audit) == before
    assert audit("store", "check", audit.store, store=False).code == 0
    assert kind_of(audit("refresh"))["decided"] == "promoted"


def test_it_could_not_run_without_a_store_or_beside_another_refresh(refreshed, audit_of, tmp_path):
    audit = audit_of(refreshed)
    assert run(["refresh", "--store", str(tmp_path / "nowhere")]) == 2
    assert audit("refresh", "--clean").code == 2
    other = os.open(audit.store / "calibration_history", os.O_RDONLY)
    fcntl.flock(other, fcntl.LOCK_EX)
    answer = audit("refresh")
    os.close(other)
    assert answer.code == 2
    assert "another refresh of this store is running; wait until it has ended" in answer.err
    assert audit("refresh").code == 0


def test_a_full_disk_leaves_the_version_in_force(refreshed, audit_of, monkeypatch):
    audit = audit_of(refreshed)
    before = in_force(audit)
    add_drive(Store.open(audit.store), "v1d8.mcap", seed=80, vehicle="car1", day=8)
    whole = files.PartFile.commit

    def full(part, announce=None):
        if "calibration" in str(part._target):
            with part.reporting():
                raise OSError(28, "No space left on device")
        return whole(part, announce)

    monkeypatch.setattr(files.PartFile, "commit", full)
    answer = audit("refresh")
    assert answer.code == 2
    assert "No space left" in answer.out.decode()
    monkeypatch.undo()
    assert in_force(audit) == before
    assert audit("store", "check", audit.store, store=False).code == 0
    assert kind_of(audit("refresh"))["decided"] == "promoted"


def test_killed_before_the_last_write_the_next_refresh_completes_it(refreshed, audit_of, monkeypatch):
    audit = audit_of(refreshed)
    before = in_force(audit)
    add_drive(Store.open(audit.store), "v1d8.mcap", seed=80, vehicle="car1", day=8)

    def killed(*_given, **_how):
        raise KeyboardInterrupt

    for name in ("write_calibration", "write_version", "put_in_force"):
        with monkeypatch.context() as patch:
            if name == "write_calibration":
                patch.setattr(Store, name, killed)
            else:
                patch.setattr(f"auditor.pipeline.refreshing.night.{name}", killed)
            assert audit("refresh").code == 130
        assert in_force(audit) == before
        assert audit("store", "check", audit.store, store=False).code == 0
    assert kind_of(audit("refresh"))["decided"] == "promoted"
    assert len(histories(Store.open(audit.store))[0].moves) == 2


def test_a_dry_run_writes_nothing_and_says_what_would_be(first_night, audit_of, tmp_path):
    audit = audit_of(first_night)
    before = {path: path.stat().st_mtime_ns for path in audit.store.rglob("*") if path.is_file()}
    write_drive(tmp_path / "new.mcap", 3, positions_m=(0.6, 0.3, 0.0))
    (tmp_path / "other.mcap").write_bytes(b"no recording")
    answer = audit("refresh", tmp_path / "new.mcap", tmp_path / "other.mcap", "--dry-run")
    kind = kind_of(answer)
    assert (kind["decided"], kind["in_force"], kind["recordings"]) == ("promoted", None, 6)
    planned = {Path(one["recording"]).name: one for one in json.loads(answer.out)["planned"]}
    assert planned["new.mcap"]["rig_kinds"] == ["LiDAR + 3 cameras 320x120 f=300px b=0.30,0.30m"]
    assert not planned["new.mcap"]["measured"]
    assert planned["other.mcap"]["error"]
    assert {path: path.stat().st_mtime_ns for path in audit.store.rglob("*") if path.is_file()} == before


def test_a_dry_run_before_the_first_night_makes_no_store(first_night, audit_of, tmp_path):
    audit, where = audit_of(first_night), tmp_path / "none yet"
    write_drive(tmp_path / "new.mcap", 3, positions_m=(0.6, 0.3, 0.0))
    answer = audit("refresh", tmp_path / "new.mcap", audit.store, "--clean", "--dry-run", "--store", where, store=False)
    kind = kind_of(answer)
    assert (kind["decided"], kind["recordings"], kind["in_force"]) == ("promoted", 6, None)
    assert "LiDAR + 3 cameras 320x120 f=300px b=0.30,0.30m: 1 recording given, 0 measured so far" in answer.err
    assert json.loads(answer.out)["store"] == str(where)
    assert not where.exists()
    assert audit("refresh", "--dry-run", "--store", where, store=False).code == 2


def test_a_recording_of_a_day_that_has_not_come_is_not_learnt_from(first_night, audit_of):
    audit = audit_of(first_night)
    add_drive(Store.open(audit.store), "wrong clock.mcap", seed=44, vehicle="car5", day=50_000)
    kind = kind_of(audit("refresh"))
    assert (kind["decided"], kind["recordings"]) == ("promoted", 6)
    [wrong] = kind["look_at"]
    assert (wrong["recording"], "has not come yet" in wrong["reason"]) == ("wrong clock.mcap", True)
    audit("label", "wrong clock.mcap", "--clean")
    assert kind_of(audit("refresh"))["recordings"] == 7, "a person says that it is clean"


def test_metrics_and_the_page_say_the_same_whatever_a_recording_is_called(first_night, audit_of, tmp_path):
    audit = audit_of(first_night)
    add_drive(Store.open(audit.store), HOSTILE, seed=50, vehicle='ca"r\\1', day=4, attacked=(2,))
    assert audit("refresh", "--metrics", tmp_path / "auditor.prom").code == 1
    text = (tmp_path / "auditor.prom").read_text()
    assert "auditor_refresh_exit_code 1" in text
    assert 'decided="promoted"' in text
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    assert all(float(line.rsplit(" ", 1)[1]) >= 0 for line in lines if "creep" not in line)
    page = Page((audit.store / "reports" / "refresh.html").read_text())
    assert not [tag for tag, _ in page.elements if tag == "script"]
    assert "A new calibration is in force." in page.text
    assert "To be looked at" in page.text


def test_a_version_that_came_into_force_while_a_refresh_ran_is_not_replaced(refreshed, audit_of, monkeypatch):
    audit = audit_of(refreshed)
    store = Store.open(audit.store)
    [before] = calibrations_in_force(store)
    add_drive(store, "v1d8.mcap", seed=80, vehicle="car1", day=8)
    other = make_calibration(before.rig_kind, before.procedure, before.clean[:3])

    def late(kept, calibration, how, reason="", *, after=None):
        put_in_force(kept, other, EntryIntoForce.PROMOTED)
        put_in_force(kept, calibration, how, reason, after=after)

    monkeypatch.setattr("auditor.pipeline.refreshing.night.put_in_force", late)
    answer = audit("refresh")
    assert answer.code == 2
    assert "came into force meanwhile" in answer.out.decode()
    assert in_force(audit) == [other.calibration_id]


def test_attacked_recordings_are_named_with_their_reason_and_the_night_ends_with_findings(refreshed, audit_of):
    audit = audit_of(refreshed)
    store = Store.open(audit.store)
    add_drive(store, "short.mcap", seed=90, vehicle="car1", day=9, frames=12, attacked=(2,))
    add_drive(store, "told.mcap", seed=91, vehicle="car2", day=9, attacked=(2,))
    answer = audit("refresh")
    line = json.loads(answer.out.decode().splitlines()[0])
    [kind] = line["rig_kinds"]
    assert answer.code == 1
    assert {one["recording"] for one in line["found"]} == {"short.mcap", "told.mcap"}
    reasons = {one["recording"]: one["reason"] for one in kind["left_out"]}
    assert reasons["short.mcap"].startswith("12 frames, fewer than 20; ")
    assert {"short.mcap", "told.mcap"} <= {one["recording"] for one in kind["look_at"]}
    assert "left out: short.mcap (car1, 2026-03-10): 12 frames, fewer than 20" in answer.err
    assert "told.mcap (car2, 2026-03-10): to be looked at: raised by" in answer.err
    assert audit("refresh").code == 0, "the next night has nothing new, and the list of those that wait has them"
    assert {"short.mcap", "told.mcap"} <= {one["recording"] for one in kind_of(audit("refresh"))["look_at"]}


def test_a_short_recording_without_findings_is_named_and_does_not_end_the_night(refreshed, audit_of):
    audit = audit_of(refreshed)
    add_drive(Store.open(audit.store), "short.mcap", seed=92, vehicle="car1", day=9, frames=12)
    answer = audit("refresh")
    assert answer.code == 0
    assert "left out: short.mcap (car1, 2026-03-10): 12 frames, fewer than 20\n" in answer.err


@pytest.mark.parametrize(("count", "frames", "provisional"), [(3, 6, True), (2, 40, True), (3, 20, False)])
def test_a_first_version_of_too_few_recordings_is_provisional_whoever_names_them(
    count, frames, provisional, audit_of, tmp_path
):
    store = Store.open(tmp_path / "few", create=True)
    for n in range(count):
        add_drive(store, f"d{n}.mcap", seed=n, vehicle=f"car{n}", day=n + 1, frames=frames)
    audit = audit_of(tmp_path / "few")
    kind = kind_of(audit("refresh", audit.store, "--clean"))
    assert (kind["decided"], kind["provisional"]) == ("promoted", provisional)
    assert any("fewer than 3 recordings of 20 frames" in one for one in kind["reasons"]) == provisional
    assert ("its calibration is provisional" in audit("judge", audit.store, store=False).err) == provisional


def test_what_follows_from_a_version_that_a_person_calibrated_is_not_provisional_however_few(audit_of, tmp_path):
    store = Store.open(tmp_path / "two", create=True)
    add_drive(store, "d0.mcap", seed=0, vehicle="car0", day=1, frames=40)
    audit = audit_of(tmp_path / "two")
    assert audit("calibrate", audit.store).code == 0
    add_drive(Store.open(audit.store), "d1.mcap", seed=1, vehicle="car1", day=2, frames=40)
    kind = kind_of(audit("refresh"))
    assert (kind["decided"], kind["recordings"], kind["provisional"]) == ("promoted", 2, False)


@pytest.mark.parametrize(("recordings", "seem"), [(1, "1 recording seems"), (2, "2 recordings seem")])
def test_too_few_recordings_that_nobody_named_wait(recordings, seem, audit_of, tmp_path):
    store = Store.open(tmp_path / "few", create=True)
    for n in range(recordings):
        add_drive(store, f"d{n}.mcap", seed=n, vehicle=f"car{n}", day=n + 1, frames=40)
    answer = audit_of(tmp_path / "few")("refresh")
    assert kind_of(answer)["reasons"] == [f"{seem} clean, of 3 that are needed; or name some clean"]


def test_a_text_file_beside_a_recording_is_named_and_fails_no_night(audit_of, refreshed, tmp_path):
    folder = tmp_path / "night"
    folder.mkdir()
    write_drive(folder / "a.mcap", 6, seed=1, positions_m=(0.6, 0.3, 0.0))
    (folder / "a.mcap.truth.json").write_text('{"attacked": []}')
    audit = audit_of(refreshed)
    answer = audit("refresh", folder)
    assert json.loads(answer.out.decode().splitlines()[0])["failed"] == []
    assert answer.code == 0, answer.err
    assert "a.mcap.truth.json: it is text and no recording" in answer.err
    (folder / "a.mcap.bak").write_bytes((folder / "a.mcap").read_bytes())
    assert audit("refresh", folder).code == 1, "a copy may be a recording that nobody read"


def test_a_calibration_that_is_gone_is_told_every_time_until_one_is_put_in_force(refreshed, audit_of):
    audit = audit_of(refreshed)
    [known] = in_force(audit)
    path = Store.open(audit.store).path("calibrations", known)
    content = path.read_bytes()
    path.unlink()
    assert audit("refresh").code == 2
    verified = audit("calibration", "verify")
    assert (verified.code, f"{known}: its file is gone from the store" in verified.out.decode()) == (3, True)
    path.write_bytes(content)
    for history in (audit.store / "calibration_history").glob("*.parquet"):
        history.unlink()
    gone = f"calibration {known[:12]} came into force for"
    for _ in range(2):
        answer = audit("judge", audit.store, store=False)
        assert (answer.code in (3, 4), gone in answer.err) == (True, True)
        answer = audit("refresh")
        assert kind_of(answer)["decided"] == "held"
        assert gone in answer.err
    assert audit("calibration", "verify").code == 3
    assert audit("calibration", "promote", known).code == 0
    assert gone not in audit("judge", audit.store, store=False).err
    assert audit("calibration", "verify").code == 0
