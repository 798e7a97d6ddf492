"""What a scan does with recordings that are cut, too dear, or of sensors that cannot be compared."""

import os
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from mcap.writer import CompressionType, Writer

from auditor.cli import run
from auditor.model.frames import Message
from auditor.recordings import open_recording, write_bag, write_db3, write_mcap
from auditor.safety.budget import MAX_BYTES
from tests.making.audits import ask
from tests.making.forms import copy_bag
from tests.making.recorded_drives import rechunk
from tests.making.scenes import plane_rig
from tests.making.small_drives import PERIOD_NS, START_NS, drive_frames, write_drive

KINDS = ("mcap", "bag", "db3")
CHUNK_BYTES = 250_000
IN_ONE_CHUNK = 3
"""Frames that the chunk or page that the cut goes through may hold, and those it tears apart."""


class Cut(NamedTuple):
    """One cut recording: the share of its bytes, and the output of the scan."""

    name: str
    share: float
    measured: int
    damage: int
    adds_up: bool


class CutScan(NamedTuple):
    """All cuts of one kind of container, in order, and how the command ended."""

    exit_code: int
    cuts: tuple[Cut, ...]


def scan_cuts(folder: Path, kind: str, frames: int, places: int) -> CutScan:
    """Scan a drive of so many frames, cut at so many places.

    Cuts of one drive hold each other's frames, and the views leave all but the longest out: its tables are asked.
    """
    rig = plane_rig((0.6, 0.3, 0.0))
    drive = list(drive_frames(rig, frames, seed=1))
    if kind == "mcap":
        write_mcap(folder / "large.mcap", rig, drive)
        whole = folder / "whole.mcap"
        rechunk(folder / "large.mcap", whole, chunk_bytes=CHUNK_BYTES, compression="ZSTD")
    elif kind == "bag":
        write_bag(folder / "large.bag", rig, drive)
        whole = copy_bag(folder / "large.bag", folder / "whole.bag", "lz4", CHUNK_BYTES)
    else:
        write_db3(folder / "whole", rig, drive)
        whole = folder / "whole" / "whole.db3"
    content, cuts = whole.read_bytes(), folder / "cuts"
    cuts.mkdir()
    names = [f"cut{place:02d}.{kind}" for place in range(1, places + 1)]
    for place, name in enumerate(names, start=1):
        (cuts / name).write_bytes(content[: len(content) * place // (places + 1)])
    store = folder / "audit"
    assert run(["calibrate", str(whole), "-r", "0", "--store", str(store)]) in (0, 3)
    scanned = [str(cuts / name) for name in names]
    code = run(["scan", *scanned, "-r", "0", "--method", "paper", "--pictures", "none", "--store", str(store)])
    sql = """
        SELECT name, measured, len(measurement.damage) AS damage, list_bool_and(list_transform(balance, lambda topic:
            topic.read = topic.used + topic.unused + topic.damaged
                + coalesce(list_sum(map_values(topic.skipped)), 0))) AS whole
        FROM stored_measurements AS measurement JOIN stored_recordings USING (recording_id)
    """
    rows: dict[str, dict[str, Any]] = {row["name"]: row for row in ask(store, sql)}
    nothing = {"measured": 0, "damage": 0, "whole": True}
    found = ((name, rows.get(name, nothing)) for name in names)
    return CutScan(
        code,
        tuple(
            Cut(name, place / (places + 1), row["measured"], row["damage"], row["whole"])
            for place, (name, row) in enumerate(found, start=1)
        ),
    )


FRAMES, PLACES = 8, 2


@pytest.mark.parametrize("kind", KINDS)
def test_the_frames_before_each_cut_are_audited_and_the_loss_is_printed(kind: str, tmp_path: Path) -> None:
    scan = scan_cuts(tmp_path, kind, FRAMES, PLACES)
    assert scan.exit_code == 3
    for cut in scan.cuts:
        assert cut.measured >= FRAMES * cut.share - IN_ONE_CHUNK, cut
        assert cut.adds_up
        assert cut.damage or not cut.measured, cut


def test_bags_without_cameras_say_what_is_missing_or_how_little_is_looked_at(
    real_data: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    source = real_data / "real_bags_without_cameras"
    assert run(["scan", str(source), "--store", str(tmp_path / "audit")]) == 3
    lines = [line for line in capfd.readouterr().err.splitlines() if line.strip()]
    [line] = [line for line in lines if "ros1_tilt_laser.bag" in line]
    assert "no triple possible: there are no camera images and no points" in line
    assert any("ros2_vlp16" in line and "by its own past alone" in line for line in lines), lines
    for name, said in (("ros1_tilt_laser.bag", "no triple possible"), ("ros2_vlp16", "LiDAR alone")):
        assert run(["inspect", str(source / name)]) == 3
        assert said in capfd.readouterr().out


@pytest.mark.parametrize(("left", "what"), [(8, "the recording"), (60, "this chunk")])
def test_of_a_recording_that_is_cut_before_its_first_message_the_cut_is_said(
    left: int, what: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = write_drive(tmp_path / "cut.mcap", count=2)
    os.truncate(path, left)
    for words in (["inspect", str(path)], ["scan", str(path), "--store", str(tmp_path / "audit")]):
        assert run(words) == 3
        said = " ".join("".join(capfd.readouterr()).split())
        assert f"no message is left in it: {what} is cut" in said
        assert "no camera images" not in said


def test_of_a_recording_in_one_chunk_that_is_too_large_the_limit_is_said(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path, channels = tmp_path / "one_chunk.mcap", dict[str, int]()
    with open_recording(write_drive(tmp_path / "drive.mcap", count=2)) as recording, path.open("wb") as out:
        writer = Writer(out, chunk_size=2 * MAX_BYTES, compression=CompressionType.ZSTD)
        writer.start("ros2")
        for message in [*recording.messages(), Message("/pad", "pad", "cdr", 0, bytes(MAX_BYTES))]:
            if message.topic not in channels:
                definition = recording.definition(message.schema)
                schema = writer.register_schema(message.schema, "ros2msg", definition.data if definition else b"")
                channels[message.topic] = writer.register_channel(message.topic, message.encoding, schema)
            writer.add_message(channels[message.topic], message.log_time_ns, bytes(message.data), message.log_time_ns)
        writer.finish()
    for words in (["inspect", str(path)], ["scan", str(path), "--store", str(tmp_path / "audit")]):
        assert run(words) == 3
        said = " ".join("".join(capfd.readouterr()).split())
        assert f"unpacked bytes; at most {MAX_BYTES} are accepted" in said
        assert "encoding of 8 or 16 bits" not in said


def test_a_recording_over_its_budget_is_one_line_and_leaves_nothing_half_done(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    store, long = tmp_path / "audit", write_drive(tmp_path / "long.mcap", count=40, positions_m=(0.6, 0.3, 0.0))
    assert run(["scan", str(long), "--store", str(store), "--time-limit", "0.4"]) == 3
    [line] = [line for line in capfd.readouterr().err.splitlines() if line.strip()]
    assert "took longer than 0.4 s" in line
    assert "long.mcap" in line
    of_rig = {"rigs", "triples", "sensor_checks", "inputs"}  # known before the first frame is measured
    assert {path.parent.name for path in store.rglob("[0-9a-f]*.parquet")} <= of_rig
    assert not list((store / "measurements").glob("*.parquet"))
    assert run(["scan", str(long), "--measure-only", "--store", str(store)]) == 3
    assert "40 frames measured" in capfd.readouterr().err


def test_vehicle_date_and_drive_come_from_the_path_from_options_and_from_the_recording(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    folder, store = tmp_path / "fleet" / "alder" / "2026-01-31", tmp_path / "audit"
    folder.mkdir(parents=True)
    for place, name in enumerate(("morning", "noon")):
        write_drive(folder / f"{name}.mcap", count=3, start_ns=START_NS + place * 3 * PERIOD_NS, seed=place)
    pattern = ["--path-pattern", "{vehicle}/{date}/*.mcap"]
    scan = ["scan", str(folder), "--measure-only", "--store", str(store)]
    known = "SELECT name, vehicle, CAST(date AS VARCHAR) AS date, drive, drive_id FROM recordings ORDER BY name"
    assert run(scan) == 3
    first, second = ask(store, known)
    assert (first["vehicle"], first["date"], first["drive"]) == (None, None, None)
    assert first["drive_id"] == second["drive_id"], "they follow each other"
    assert run([*scan, *pattern]) == 3
    assert [(row["vehicle"], row["date"]) for row in ask(store, known)] == [("alder", "2026-01-31")] * 2
    assert run([*scan, "--vehicle", "birch", "--drive", "0009"]) == 3
    found = [(row["vehicle"], row["date"], row["drive"]) for row in ask(store, known)]
    assert found == [("birch", "2026-01-31", "0009")] * 2, "what is not given again stays"
    assert run([*scan, "--path-pattern", "{date}/alder/*/*.mcap"]) == 2
    assert "is not a date" in capfd.readouterr().err
    assert run([*scan, "--path-pattern", "{colour}/*.mcap"]) == 2
