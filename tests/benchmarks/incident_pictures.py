"""Seeded attacks of every kind in long logs: does each incident get its pictures, and what does picturing them take?

    python -m tests.benchmarks.incident_pictures [--minutes 60] [--attacks 50] [--logs 2] [--hertz 1] [--into FOLDER]

Writes logs of a textured plane, attacked in seeded places by every kind of attack in turn, calibrates on a clean one,
scans them, and looks at every incident. Prints how many incidents have pictures of all their sensors before, at and
after, how many have their strongest frame among them, the size of the pictures, and the peak memory of a process that
pictures a log over that of one that measures it.
"""

import argparse
import multiprocessing
import shutil
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from auditor.cli import run
from auditor.lab.attacks.catalogue import ON_CAMERA, ON_LIDAR, Drawing
from auditor.model.frames import Frame
from auditor.model.pictures import Content
from auditor.model.rig import LIDAR, Rig
from auditor.pipeline.measure import measure_recording
from auditor.pipeline.measured import MeasureTask
from auditor.pipeline.pictures.at_hand import location_of
from auditor.pipeline.pictures.incident_pictures import PictureTask, picture_frames
from auditor.recordings import write_mcap
from auditor.store import Store, rows_of, run_sql
from tests.making.scenes import plane_rig
from tests.making.small_drives import DAY_NS, FOUR_CAMERAS, START_NS, drive_frames

KINDS = (*((kind, False) for kind in ON_CAMERA), *((kind, True) for kind in ON_LIDAR))
ATTACKED_S = 3
DIFFERENT = 200
"""Frames that differ: a log repeats them under new stamps."""


def attacked(frame: Frame, rig: Rig, place: int, seed: int) -> Frame:
    """The frame under the attack of a place: the kinds take turns, cameras are drawn."""
    kind, on_lidar = KINDS[place % len(KINDS)]
    rng = np.random.default_rng([seed, place])
    drawing = Drawing(rng, "opaque", None)
    if on_lidar:
        assert frame.cloud is not None
        return replace(frame, cloud=ON_LIDAR[kind](drawing).apply(frame.cloud, rig))
    camera = rig.camera(int(rng.integers(1, rig.n + 1)))
    changed = ON_CAMERA[kind](drawing, camera).apply(frame.images[camera.number])
    return replace(frame, images={**frame.images, camera.number: changed})


def frames_of(rig: Rig, count: int, hertz: float, start_ns: int, attacks: int, seed: int) -> Iterator[Frame]:
    """A log: frames that are repeated under new stamps, attacked in as many places."""
    originals = list(drive_frames(rig, DIFFERENT, seed=seed))
    each = count / max(attacks, 1)
    for number in range(count):
        original = originals[number % DIFFERENT]
        stamp_ns = start_ns + round(number * 1e9 / hertz)
        frame = replace(
            original,
            number=number,
            stamp_ns=stamp_ns,
            images={sensor: replace(image, stamp_ns=stamp_ns) for sensor, image in original.images.items()},
            cloud=replace(original.cloud, stamp_ns=stamp_ns) if original.cloud is not None else None,
        )
        place, within = divmod(number, each)
        on = attacks and each / 2 <= within < each / 2 + max(1, ATTACKED_S * hertz)
        yield attacked(frame, rig, int(place), seed) if on else frame


def _peak_mb(function: str, folder: Path, log: Path) -> float:
    """The peak memory of a process of its own that does something with a log."""
    context = multiprocessing.get_context("spawn")
    with context.Pool(1) as pool:
        return float(pool.apply(_peak, (function, folder, log)))


def _peak(function: str, folder: Path, log: Path) -> float:
    if function == "measure":
        measure_recording(MeasureTask(log, folder / "memory"), lambda *_: None)
    elif function == "picture":
        store = Store.open(folder / "memory")
        [known] = store.measurements()
        frames = tuple(range(0, known.measured, max(1, known.measured // 100)))
        where = location_of(store.recording(known.recording_id))
        picture_frames(PictureTask(where, store.folder, known.measurement_id, frames), lambda *_: None)
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return int(status.partition("VmHWM:")[2].split()[0]) / 1024


def measure_memory(folder: Path, log: Path) -> str:
    """Peaks in MB, the program itself taken off."""
    bare = _peak_mb("nothing", folder, log)
    measuring, picturing = (_peak_mb(what, folder, log) - bare for what in ("measure", "picture"))
    return (
        f"peak of picturing 100 frames {picturing:.0f} MB, of measuring {measuring:.0f} MB: {picturing / measuring:.2f}"
    )


def look(store: Store, rig: Rig) -> Iterator[str]:
    """What the incidents have."""
    rows = rows_of(run_sql(store, "FROM incidents"))
    examples: dict[str, dict[str, int]] = {}
    for row in rows_of(run_sql(store, "FROM incident_examples")):
        examples.setdefault(row["incident_id"], {})[row["example"]] = row["frame"]
    due = {(camera.number, Content.COLOUR) for camera in rig.cameras} | {(LIDAR, Content.ABOVE), (LIDAR, Content.RANGE)}
    counted: Counter[str] = Counter()
    for row in rows:
        own, known = examples[row["incident_id"]], row["strongest_measurement_id"] or row["measurement_id"]
        kept = {
            frame: {(one.sensor, one.content) for one in store.frame_pictures(known, frame)}
            for frame in set(own.values())
        }
        counted["whole"] += all(due <= there for there in kept.values()) and {"before", "after"} <= own.keys()
        counted["strongest"] += row["strongest_frame"] in kept and bool(kept[row["strongest_frame"]])
    size = sum(path.stat().st_size for path in store.folder.glob("pictures/*/*.*.*"))
    yield f"{len(rows)} incidents; {counted['whole']} have all pictures; {counted['strongest']} their strongest frame"
    yield f"{size / 1e6:.1f} MB of pictures, {size / 1e6 / max(len(rows), 1):.2f} MB an incident"


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=60)
    parser.add_argument("--attacks", type=int, default=50)
    parser.add_argument("--logs", type=int, default=2)
    parser.add_argument("--hertz", type=float, default=1)
    parser.add_argument("--into", type=Path)
    given = parser.parse_args(arguments)
    folder = given.into or Path(tempfile.mkdtemp())
    folder.mkdir(exist_ok=True)
    rig, count = plane_rig(FOUR_CAMERAS, lidar=True), round(given.minutes * 60 * given.hertz)
    clean, logs, store = folder / "clean.mcap", [], str(folder / "audit")
    write_mcap(clean, rig, frames_of(rig, DIFFERENT, 10, START_NS - DAY_NS, 0, 1))
    for seed in range(given.logs):
        logs.append(folder / f"log_{seed}.mcap")
        write_mcap(logs[-1], rig, frames_of(rig, count, given.hertz, START_NS + seed * DAY_NS, given.attacks, seed))
    run(["calibrate", str(clean), "--store", store])
    run(["scan", *map(str, logs), "--store", store, "--jobs", "1"])
    print(f"{given.logs} logs of {given.minutes:g} min at {given.hertz:g} Hz, {given.attacks} attacks in each")
    for line in look(Store.open(store), rig):
        print(line)
    print(measure_memory(folder, logs[0]))
    if given.into is None:
        shutil.rmtree(folder)


if __name__ == "__main__":
    main()
