"""Labels for attacks that somebody else made: kept beside those of the recording, counted with them, never mixed up."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

from auditor.cli import run
from auditor.store.export import rows_of
from auditor.store.queries import run_query, run_sql
from auditor.store.store import Store
from tests.making.report_stores import PERIOD_NS, START_NS, add_recording, new_store
from tests.making.small_drives import THREE_CAMERAS, write_drive

SPANS = "SELECT sensor, topic, attack, from_ns, to_ns, given FROM labels ORDER BY given, from_ns"


@pytest.fixture
def store(tmp_path: Path) -> Store:
    kept = new_store(tmp_path)
    add_recording(kept, attacks=[((1,), 10, 19)], labelled=False)
    return kept


def label(store: Store, *arguments: str, recording: str = "drive.mcap") -> int:
    return run(["label", recording, *arguments, "--store", str(store.folder)])


def labels(store: Store) -> list[tuple[object, ...]]:
    return [tuple(row.values()) for row in rows_of(run_sql(store, SPANS))]


def test_frames_seconds_and_times_mean_the_same_span(store):
    spans = [
        ("10", "19"),
        ("1.0s", "1.9s"),
        ("2011-09-26T13:02:26.904Z", "2011-09-26T15:02:27.804+02:00"),
        ("2011-09-26T13:02:26.904", "1.900000000 s"),
    ]
    for first, last in spans:
        assert label(store, "--sensor", "S_1", "--attack", "laser", "--from", first, "--to", last) == 0
    expected = (1, "/right/image", "laser", START_NS + 10 * PERIOD_NS, START_NS + 19 * PERIOD_NS, True)
    assert labels(store) == [expected] * len(spans)


def test_without_a_span_it_is_the_whole_recording_and_nanoseconds_are_kept(store):
    [known] = store.recordings()
    store.write_recording(replace(known, to_ns=START_NS + 39 * PERIOD_NS))
    assert label(store, "--topic", "/velo/points", "--attack", "wall") == 0
    assert label(store, "--topic", "/velo/points", "--attack", "wall", "--to", "0.000000007s") == 0
    assert [row[3:5] for row in labels(store)] == [
        (START_NS, START_NS + 39 * PERIOD_NS),
        (START_NS, START_NS + 7),
    ]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--sensor", "S_9", "--attack", "laser"], "it has no sensor S_9; its sensors are S_0 (/velo/points), S_1"),
        (["--topic", "/nope", "--attack", "laser"], "it has no topic /nope"),
        (["--sensor", "S_1", "--attack", "laser", "--from", "40"], "there is no frame 40; its frames are 0 to 39"),
        (["--sensor", "S_1", "--attack", "laser", "--from", "9", "--to", "8"], "cannot end before it begins"),
        (["--sensor", "S_1", "--attack", "laser", "--from", "noon", "--to", "8"], "'noon' is no frame, no number of"),
        (["--sensor", "S_1", "--attack", "laser", "--from", "1.5", "--to", "8"], "12.5s"),
        (["--sensor", "S_1"], "an attack has a name"),
        (["--sensor", "S_1", "--topic", "/right/image", "--attack", "laser"], "either --sensor or --topic"),
        (["--clean", "--list"], "give one of --clean, --list and --remove"),
        ([], "describe an attack"),
        (["--remove", "1"], "it has no given label 1"),
    ],
)
def test_what_makes_no_sense_is_refused_and_nothing_is_kept(arguments, says, store, capfd):
    assert label(store, *arguments) == 2
    assert says in capfd.readouterr().err
    assert labels(store) == []


def test_a_recording_that_is_not_there_or_not_the_only_one_is_refused(store, capfd):
    assert label(store, "--list", recording="nope.mcap") == 2
    assert "the store has no such recording" in capfd.readouterr().err
    [known] = store.recordings()
    assert label(store, "--list", recording="/elsewhere/drive.mcap") == 0
    store.write_recording(replace(known, recording_id="f" * 64))
    assert label(store, "--list") == 2
    assert f"name one by its id: {known.recording_id[:12]}, ffffffffffff" in capfd.readouterr().err


def test_clean_and_attacked_exclude_each_other(store, capfd):
    assert label(store, "--clean") == 0
    assert labels(store) == [(None, None, None, None, None, True)]
    assert label(store, "--sensor", "S_1", "--attack", "laser", "--from", "1", "--to", "2") == 2
    assert "it was labelled as clean" in capfd.readouterr().err
    assert label(store, "--remove", "1") == 0
    assert "whether it was attacked is not known" in capfd.readouterr().err
    assert label(store, "--sensor", "S_1", "--attack", "laser", "--from", "1", "--to", "2") == 0
    assert label(store, "--clean") == 2
    assert "labels say that it was attacked" in capfd.readouterr().err


def test_the_list_shows_what_is_carried_and_what_was_given(store, capfd):
    add_recording(store, "carrying.mcap", attacks=[((2,), 3, 4)])
    assert (
        label(
            store, "--sensor", "S_1", "--attack", "a\nb\x1b[2J", "--from", "1", "--to", "2", recording="carrying.mcap"
        )
        == 0
    )
    lines = [re.split(r"\s{2,}", line.strip()) for line in capfd.readouterr().out.splitlines() if line.strip(" ─")]
    assert lines == [
        ["number", "topic", "sensor", "attack", "from", "to", "source"],
        ["-", "/middle/image", "S_2", "facula", "0.300s", "0.400s", "recording"],
        ["1", "/right/image", "S_1", r"a\nb\x1b[2J", "0.100s", "0.200s", "given"],
    ]


def test_the_identification_rate_counts_labelled_recordings_only(store):
    def frames() -> dict[tuple[int, ...], int]:
        rows = rows_of(run_query(store, "identification_rate", {"r": "0"}))
        return {tuple(row["attacked"]): row["frames"] for row in rows}

    assert frames() == {}
    assert label(store, "--sensor", "S_1", "--attack", "laser", "--from", "10", "--to", "19") == 0
    assert frames() == {(1,): 10, (): 30}
    add_recording(store, "unknown.mcap", labelled=False)
    assert frames() == {(1,): 10, (): 30}
    assert label(store, "--clean", recording="unknown.mcap") == 0
    assert frames() == {(1,): 10, (): 70}


def test_a_label_keeps_a_recording_from_being_calibrated_on(store, capfd):
    assert label(store, "--sensor", "S_1", "--attack", "laser", "--from", "1", "--to", "2") == 0
    add_recording(store, "clean.mcap", labelled=False)
    capfd.readouterr()
    run(["calibrate", str(store.folder), "-r", "0", "--store", str(store.folder)])
    assert "drive.mcap: left out: it was labelled as attacked" in capfd.readouterr().err


def test_a_scan_leaves_given_labels_alone_and_they_leave_the_carried_ones(tmp_path, capfd):
    drive = write_drive(tmp_path / "drive.mcap", count=12, positions_m=THREE_CAMERAS)
    attacked = tmp_path / "attacked.mcap"
    assert run(["attack", str(drive), str(attacked), "--on", "S_2", "--from", "0.5"]) == 0
    scan = ["scan", str(attacked), "--store", str(tmp_path / "audit"), "--measure-only", "--jobs", "1"]
    assert run(scan) == 3
    store = Store.open(tmp_path / "audit")
    carried = labels(store)
    assert [row[5] for row in carried] == [False]
    assert label(store, "--sensor", "S_0", "--attack", "wall", "--from", "2", "--to", "4", recording=str(attacked)) == 0
    [recording] = store.recordings()
    store.path("recordings", recording.recording_id).unlink()  # so that the next scan keeps it anew, with its labels
    assert run(scan) == 3
    assert [row[:3] for row in labels(store)] == [carried[0][:3], (0, "/points", "wall")]
