"""Verifying a store: whatever was changed, removed, added or swapped in it is named."""

import contextlib
import json
import shutil
from dataclasses import replace

import pyarrow.parquet as pq
import pytest
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from auditor.cli import run
from auditor.errors import StoreError
from auditor.model.measurement import Counts, Region, Solid, Statistic
from auditor.store.log.chains import START, chain_paths, entries
from auditor.store.log.entry import Entry
from auditor.store.maintenance.hashes import changed, read_checked, write_checked
from auditor.store.maintenance.verify import verify, verify_hashes
from auditor.store.records import RecordingRecord
from auditor.store.schema import SCHEMA_VERSION
from auditor.store.store import Store
from auditor.store.tables import read_rows
from tests.making.bit_flips import draw_flips, flipped
from tests.making.several_lidars import REAR, ROOF
from tests.making.several_lidars import rig_of as several_lidars
from tests.making.stores import add_judgement, add_measurement, make_measurement, make_rig, new_store
from tests.store.kept import unpack


@pytest.fixture
def store(tmp_path):
    """A store of two drives, a calibration, judgements and an evaluation, as its own runs have left it."""
    return Store.open(unpack(SCHEMA_VERSION, tmp_path)[0])


def problems(store):
    return {problem.place: problem.what for problem in verify(store).grave}


def place(path):
    return f"{path.parent.name}/{path.name}"


def rewrite(path, change):
    """Write a chain anew with one entry changed and every hash right."""
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    change(lines)
    before, written = START, []
    for line in lines:
        line.pop("sha256")
        frame = {name: line.pop(name) for name in ("order", "at", "kind", "run", "pid", "before")}
        entry = Entry(**{**frame, "before": before}, what=line)
        written.append(entry.line)
        before = entry.sha256
    path.write_bytes(b"".join(written))


def test_a_store_that_nobody_touched_is_as_it_was_written(store, capsys):
    found = verify(store)
    assert found.problems == ()
    assert found.files > 20
    assert run(["verify", str(store.folder)]) == 0
    [line] = capsys.readouterr().err.splitlines()
    assert "everything is as it was written" in line


def test_a_sample_of_flipped_bits_is_found_one_by_one(store):
    for flip in draw_flips(store.folder, 60, seed=5):
        with flipped(flip) as where:
            assert where in {problem.place for problem in verify_hashes(store).grave}, flip
    assert verify(store).problems == ()


def test_a_removed_judgement_is_named(store, capsys):
    path = store.finished_paths("judgements")[0]
    path.unlink()
    (store.folder / "verdicts" / path.name).unlink()
    assert problems(store).keys() == {place(path)}
    assert run(["verify", str(store.folder)]) == 1
    out, err = capsys.readouterr()
    [line] = out.splitlines()
    assert "it is missing" in line
    assert "auditor judge" in line or "auditor scan" in line
    assert "1 problem" in err


def test_an_edited_row_is_named(store):
    path = store.finished_paths("verdicts")[0]
    table = pq.read_table(path)
    kinds = ["clean"] * len(table)
    changed = table.set_column(table.column_names.index("kind"), table.field("kind"), [kinds])
    pq.write_table(changed, path)
    assert problems(store).keys() == {place(path)}


def test_swapped_files_are_named(store):
    one, other = store.finished_paths("verdicts")[:2]
    content = one.read_bytes()
    one.write_bytes(other.read_bytes())
    other.write_bytes(content)
    assert problems(store).keys() == {place(one), place(other)}


def test_added_files_are_named(store):
    known = store.ids("measurements")[0]
    copy = store.folder / "labels" / ("0" * 64 + ".parquet")
    shutil.copy(store.finished_paths("labels")[0], copy)
    (store.folder / "pictures" / known / "99_S1.jpg").write_bytes(b"jpeg")
    (store.folder / "log" / "note.txt").write_text("x")
    (store.folder / "notes.txt").write_text("x")
    named = problems(store)
    assert named.keys() == {place(copy), f"pictures/{known}/99_S1.jpg", "log/note.txt", "notes.txt"}
    assert all("added" in what for what in named.values())


def test_what_no_row_finishes_was_left_by_a_killed_run_or_added(store, capsys):
    (store.folder / "verdicts" / ("0" * 32 + ".parquet")).write_bytes(b"half")
    assert problems(store) == {}
    assert run(["verify", str(store.folder)]) == 3
    assert "nobody reads it" in capsys.readouterr().out


def test_a_file_that_a_run_removed_and_that_is_there_again_is_named(store):
    recording = store.recordings()[0]
    path = store.path("recordings", recording.recording_id)
    content = path.read_bytes()
    run(["store", "remove", recording.name, "--store", str(store.folder), "--yes"])
    assert problems(store) == {}
    path.write_bytes(content)
    assert "removed it" in problems(store)[place(path)]


def test_an_edited_line_of_the_log_is_named(store):
    path = chain_paths(store.folder)[0]
    path.write_text(path.read_text().replace('"calibrate"', '"scan"', 1))
    assert "line 1" in problems(store)[place(path)]


def test_a_removed_line_of_the_log_is_named(store):
    path = chain_paths(store.folder)[0]
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join(lines[:1] + lines[2:]))
    assert "removed or replaced" in problems(store)[place(path)]


def test_a_chain_with_every_hash_right_is_named_where_another_chain_has_seen_it(store):
    [path] = chain_paths(store.folder)
    other = path.rename(path.with_name("another-host-0123456789abcdef.jsonl"))  # as of another machine
    store.write_recording(RecordingRecord("d" * 64, "d.mcap", "/logs/d.mcap"))
    assert problems(store) == {}
    content = other.read_bytes()
    rewrite(other, lambda lines: lines[0].update(user="somebody else"))
    assert "entries are gone" in problems(store)[place(other)]
    other.write_bytes(b"".join(content.splitlines(keepends=True)[:-1]))
    assert "entries are gone" in problems(store)[place(other)]
    other.unlink()
    assert "it is missing" in problems(store)[place(other)]


def test_a_log_that_is_gone_is_named(store):
    shutil.rmtree(store.folder / "log")
    assert list(problems(store)) == ["log"]


def test_whoever_writes_all_anew_is_found_by_the_signature_alone(store, tmp_path, capsys):
    private, public = keys(tmp_path)
    [path] = chain_paths(store.folder)
    assert run(["verify", str(store.folder), "--public-key", str(public)]) == 1
    assert run(["verify", str(store.folder), "--private-key", str(private)]) == 0
    assert run(["verify", str(store.folder), "--public-key", str(public)]) == 0
    rewrite(path, lambda lines: lines.pop() and lines[0].update(user="somebody else"))
    assert run(["verify", str(store.folder)]) == 0
    assert run(["verify", str(store.folder), "--public-key", str(public)]) == 1
    assert "nothing in it is signed by this key" in capsys.readouterr().out


def test_with_a_key_in_the_environment_every_run_signs_at_its_end(store, tmp_path, monkeypatch, capsys):
    private, public = keys(tmp_path)
    monkeypatch.setenv("AUDITOR_SIGNING_KEY", str(private))
    store.write_recording(RecordingRecord("d" * 64, "d.mcap", "/logs/d.mcap"))
    monkeypatch.delenv("AUDITOR_SIGNING_KEY")
    assert run(["verify", str(store.folder), "--public-key", str(public)]) == 0
    _, other = keys(tmp_path / "other")
    assert run(["verify", str(store.folder), "--public-key", str(other)]) == 1
    store.write_recording(RecordingRecord("e" * 64, "e.mcap", "/logs/e.mcap"))
    capsys.readouterr()
    assert run(["verify", str(store.folder), "--public-key", str(public)]) == 1
    assert "its last 3 entries are not signed" in capsys.readouterr().out
    monkeypatch.setenv("AUDITOR_SIGNING_KEY", str(public))
    assert run(["judge", str(store.folder)]) == 2
    assert "no private key" in capsys.readouterr().err


def keys(folder):
    folder.mkdir(exist_ok=True)
    key = Ed25519PrivateKey.generate()
    pem, nothing = serialization.Encoding.PEM, serialization.NoEncryption()
    (folder / "private.pem").write_bytes(key.private_bytes(pem, serialization.PrivateFormat.PKCS8, nothing))
    public = key.public_key().public_bytes(pem, serialization.PublicFormat.SubjectPublicKeyInfo)
    (folder / "public.pem").write_bytes(public)
    return folder / "private.pem", folder / "public.pem"


# Changes in daily use


@pytest.fixture
def checked(store, capsys):
    """A store whose files have been looked at, so that only changes are looked at from now on."""
    assert run(["query", "summary", "--store", str(store.folder)]) == 0
    assert capsys.readouterr().err == ""
    return store


def verdict_flip(store, *, silent):
    wanted = [flip for flip in draw_flips(store.folder, 300) if flip.path.parent.name == "labels"]
    return next(flip for flip in wanted if flip.silent == silent)


def test_nothing_is_hashed_twice_that_did_not_change(checked):
    assert not changed(checked.folder, read_checked(checked.folder))
    write_checked(checked.folder, {})
    assert changed(checked.folder, read_checked(checked.folder))


def test_query_names_a_file_that_changed_since_it_was_last_checked(checked, capsys):
    with flipped(verdict_flip(checked, silent=False)) as where:
        for _ in range(2):
            run(["query", "contents", "--store", str(checked.folder)])
            [line] = [line for line in capsys.readouterr().err.splitlines() if where in line]
            assert "it is not as" in line
    assert run(["query", "contents", "--store", str(checked.folder)]) == 0
    assert capsys.readouterr().err == ""


def test_query_finds_with_verify_what_keeps_its_time(checked, capsys):
    with flipped(verdict_flip(checked, silent=True)) as where:
        run(["query", "summary", "--store", str(checked.folder)])
        assert where not in capsys.readouterr().err
        assert run(["query", "summary", "--verify", "--store", str(checked.folder)]) in {2, 3}
        assert where in capsys.readouterr().err


def altered(store):
    """One file of current verdicts that was altered."""
    [current, *_] = store.current_judgements().values()
    path = store.path("verdicts", current.judgement_id)
    path.write_bytes(path.read_bytes() + b" ")
    return place(path)


def test_judging_tells_first_what_is_altered_and_the_log_keeps_it(checked, capsys):
    run(["judge", str(checked.folder)])
    where = altered(Store(checked.folder))
    capsys.readouterr()
    assert run(["judge", str(checked.folder)]) in {3, 4}
    assert f"{where}: it is not as it was when" in capsys.readouterr().err
    assert verify(checked).problems == ()
    assert run(["verify", str(checked.folder)]) == 0
    assert f"a run found that it was altered, and wrote on: {where}" in capsys.readouterr().err


def test_a_refresh_of_an_altered_store_says_so_and_is_looked_at(checked, capsys):
    where = altered(Store(checked.folder))
    assert run(["refresh", "--store", str(checked.folder)]) in {1, 2}
    out, err = capsys.readouterr()
    assert f"{where}: it is not as it was when" in err
    assert "not as they were written" in json.loads(out)["failed"][0]["reason"]


def test_nothing_is_reported_from_an_altered_store(checked, capsys):
    page = checked.folder / "reports" / "index.html"
    assert run(["report", "--store", str(checked.folder)]) == 0
    assert problems(checked) == {}
    page.write_text("another page")
    assert "it is not as auditor report" in problems(checked)["reports/index.html"]
    with flipped(verdict_flip(checked, silent=True)) as where:
        capsys.readouterr()
        assert run(["report", "--store", str(checked.folder)]) == 2
        [line] = capsys.readouterr().err.splitlines()
        assert "it was altered" in line
        assert where in line
        assert page.read_text() == "another page"


def test_what_cannot_be_read_of_an_altered_store_is_one_line(checked, capsys):
    for table in ("judgements", "rigs", "calibrations", "measurements", "recordings", "verdicts"):
        path = checked.finished_paths(table)[0]
        content = path.read_bytes()
        path.write_bytes(content[: len(content) // 2])
        for words in (["query", "summary"], ["judge"], ["label", "clean.mcap", "--list"]):
            run([*words, "--store", str(checked.folder)])
            out, err = capsys.readouterr()
            assert "Traceback" not in out + err
            assert "defect" not in out + err
        path.write_bytes(content)


# Plausibility


def test_counts_that_no_image_can_give_are_named_and_not_judged(tmp_path):
    store, rig = new_store(tmp_path), make_rig(3)
    frame = make_measurement(rig, 0)
    area = rig.cameras[0].width_px * rig.cameras[0].height_px
    for number, counts in enumerate((Counts(area + 1, 0, 0, 0, 0), Counts(10, 11, 0, 0, 0))):
        wrong = type(frame)(**{**vars(frame), "counts": tuple(counts for _ in frame.counts)})
        known = add_measurement(store, rig, [wrong], recording="ab"[number])
        assert f"frames/{known}.parquet" in problems(store)
        with pytest.raises(StoreError, match="more pixels"):
            store.load_errors(known, Statistic.PLAIN)


@pytest.mark.parametrize(
    ("rig", "view", "box_px", "plausible"),
    [
        (several_lidars(ROOF, REAR), 1, (0, 0, 0, 0), True),
        (several_lidars(ROOF, REAR), 1, (0, 0, 8, 8), False),
        (make_rig(3), 1, (0, 0, 8, 8), True),
        (make_rig(3), 1, (0, 0, 0, 0), False),
        (make_rig(3), 0, (0, 0, 0, 0), True),
        (make_rig(3), 0, (0, 0, 8, 8), False),
    ],
)
def test_regions_have_pixels_where_a_camera_looks_and_only_there(tmp_path, rig, view, box_px, plausible):
    store, thing = new_store(tmp_path), Solid((8.0, 0.0, 0.0), (2.0, 1.0, 0.1), 0.0)
    frame = replace(make_measurement(rig, 0), regions=(Region(0, view, box_px, 0.1, b"", 9, thing),))
    known = add_measurement(store, rig, [frame])
    assert (f"regions/{known}.parquet" not in problems(store)) is plausible


def test_a_store_of_synthetic_frames_is_plausible(tmp_path):
    store, rig = new_store(tmp_path), make_rig(3)
    known = add_measurement(store, rig, [make_measurement(rig, number) for number in range(3)])
    add_judgement(store, rig, known, "c1u")
    assert len({entry.run for entry in entries(store.folder)}) > 1
    assert verify_hashes(store).problems == ()


def test_a_name_that_is_no_text_any_more_is_told_in_one_line(store, capsys):
    path = store.finished_paths("verdicts")[0]
    content = path.read_bytes()
    for place in range(len(content) - 3000, len(content) - 8, 101):
        path.write_bytes(content[:place] + bytes([content[place] ^ 0x80]) + content[place + 1 :])
        with contextlib.suppress(StoreError):
            read_rows("verdicts", path)
    assert run(["verify", str(store.folder)]) == 1
    assert "Traceback" not in capsys.readouterr().err


def test_verdicts_that_cannot_be_read_are_one_problem_and_that_of_their_own_file(store):
    path = next(iter((store.folder / "verdicts").glob("*.parquet")))
    path.write_bytes(path.read_bytes()[:-9])
    assert list(problems(store)) == [place(path)]
    path.unlink()
    assert list(problems(store)) == [place(path)]
