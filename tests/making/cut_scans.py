"""A drive cut at many places, every cut scanned by one command; tests/benchmarks/cuts.py prints it."""

from pathlib import Path
from typing import Any, NamedTuple

from auditor.cli import run
from auditor.recordings import write_bag, write_db3, write_mcap
from tests.making.audits import ask
from tests.making.forms import copy_bag
from tests.making.recorded_drives import rechunk
from tests.making.scenes import plane_rig
from tests.making.small_drives import drive_frames

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
