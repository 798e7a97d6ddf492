"""Seeded attacks of every kind in long logs: does each incident get its pictures, and what does picturing them take?

    python -m tests.benchmarks.incident_pictures [--minutes 60] [--attacks 50] [--logs 2] [--hertz 10] [--into FOLDER]

Writes logs of a textured plane, attacked in seeded places by every kind of attack in turn, calibrates on a clean one,
scans them, and looks at every incident. Prints how many incidents have pictures of all their sensors before, at and
after, how many have their strongest frame among them, the size of the pictures, and the peak memory of a process that
pictures a log over that of one that measures it.

A log repeats 60 frames under new stamps, and what is measured of a frame is kept for its repetitions: every message is
written, hashed, read, put together, judged and pictured, and each different frame measured once. The texture has large
grains of 16 levels, so that an hour of it fits a disk. Memory is measured without that, on the first two minutes.
"""

import argparse
import hashlib
import math
import multiprocessing
import shutil
import tempfile
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from auditor.cli import run
from auditor.lab.attacks.catalogue import ON_CAMERA, ON_LIDAR
from auditor.lab.attacks.kinds import AttackDraw
from auditor.measurement import measure
from auditor.measurement.disparity.matchers import Matcher
from auditor.measurement.frame import MeasuredFrame
from auditor.model.checks import rig_sensor_checks
from auditor.model.frames import Frame, PointCloud, SkippedFrame
from auditor.model.pictures import Content
from auditor.model.rig import LIDAR, Rig
from auditor.model.verdict import AttackLabel
from auditor.pipeline.measure import measure_recording
from auditor.pipeline.measured import MeasureTask
from auditor.pipeline.pictures import Frames, PictureTask, location_of, picture_frames
from auditor.recordings import write_mcap
from auditor.store.export import rows_of
from auditor.store.queries import run_sql
from auditor.store.store import Store
from tests.making.scenes import FOCAL, HEIGHT, WIDTH, plane_rig
from tests.making.small_drives import DAY_NS, FOUR_CAMERAS, START_NS, drive_frames

KINDS = (*((kind, False) for kind in ON_CAMERA), *((kind, True) for kind in ON_LIDAR))
ATTACKED_S = 3
DIFFERENT = 60
"""Frames that differ: a log repeats them under new stamps."""
_GRAIN_PX, _LEVELS, _NOISY_SHARE = 3, 16, 0.02
_EVERY_POINT = 3


def attacked(frame: Frame, rig: Rig, place: int, seed: int) -> Frame:
    """The frame under the attack of a place: the kinds take turns, cameras are drawn."""
    kind, on_lidar = KINDS[place % len(KINDS)]
    rng = np.random.default_rng([seed, place])
    drawing = AttackDraw(rng, "opaque", None)
    if on_lidar:
        assert frame.cloud is not None
        return replace(frame, cloud=ON_LIDAR[kind](drawing).apply(frame.cloud, rig))
    camera = rig.camera(int(rng.integers(1, rig.n + 1)))
    changed = ON_CAMERA[kind](drawing, camera).apply(frame.images[camera.number])
    return replace(frame, images={**frame.images, camera.number: changed})


def originals(rig: Rig, seed: int) -> Iterator[Frame]:
    """The frames that differ; their texture can be compressed, and each camera has a little noise of its own."""
    rng = np.random.default_rng(seed)
    for frame in drive_frames(rig, DIFFERENT, seed=seed):
        depth_m = 15.0 - 9.0 * frame.number / DIFFERENT
        small = np.random.default_rng([seed, frame.number]).integers(0, _LEVELS, (HEIGHT // _GRAIN_PX + 1, WIDTH + 1))
        texture = np.kron(small, np.ones((_GRAIN_PX, _GRAIN_PX), dtype=np.int64))[:HEIGHT] * (255 // _LEVELS)
        images = {}
        for camera in rig.cameras:
            shift = round(FOCAL * float(camera.centre_m[0]) / depth_m)
            pixels = texture[:, WIDTH + shift : 2 * WIDTH + shift].astype(np.uint8)
            noisy = rng.random(pixels.shape) < _NOISY_SHARE
            pixels[noisy] = rng.integers(0, 256, int(noisy.sum()))
            images[camera.number] = replace(frame.images[camera.number], pixels=pixels)
        assert frame.cloud is not None
        yield replace(frame, images=images, cloud=PointCloud(frame.stamp_ns, frame.cloud.xyz_m[::_EVERY_POINT]))


def frames_of(rig: Rig, count: int, hertz: float, start_ns: int, attacks: int, seed: int) -> Iterator[Frame]:
    """A log: frames that are repeated under new stamps, attacked in as many places."""
    different = list(originals(rig, seed))
    each = count / max(attacks, 1)
    for number in range(count):
        original = different[number % DIFFERENT]
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


class Kept:
    """Objects that are kept, and what functions gave of them: a frame that comes again costs nothing twice."""

    def __init__(self) -> None:
        self._kept: dict[int, object] = {}

    def keep(self, one: object) -> None:
        self._kept[id(one)] = one

    def once(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """The function, called once for the same kept objects."""
        given: dict[tuple[int, ...], Any] = {}

        def called(*of: object) -> Any:
            key = tuple(map(id, of))
            if not all(one is None or self._kept.get(id(one)) is one for one in of):
                return function(*of)
            if key not in given:
                given[key] = function(*of)
                self.keep(given[key])
            return given[key]

        return called


def measure_repeated(log: Path, store: Path) -> None:
    """Measure a log: of frames that are repeated what was measured of the first."""
    known: dict[bytes, MeasuredFrame] = {}
    kept = Kept()

    def repeated(
        frames: Iterable[Frame | SkippedFrame], rig: Rig, matcher: Matcher
    ) -> Generator[SkippedFrame | MeasuredFrame]:
        kept.keep(rig_sensor_checks(rig))
        for item in frames:
            if isinstance(item, SkippedFrame):
                yield item
                continue
            key = content_of(item)
            counted, evidence = known.get(key) or measure(item, rig, matcher)
            if key not in known and len(known) < DIFFERENT:  # the attacked ones come once
                known[key] = counted, evidence
                for one in (evidence, counted.cells, counted.shares):
                    kept.keep(one)
            yield replace(counted, number=item.number, stamp_ns=item.stamp_ns, presence=item.presence), evidence

    with ExitStack() as patched:
        patched.enter_context(patch("auditor.pipeline.measure.measure_stream", repeated))
        for place in (
            "auditor.pipeline.measure.sensor_statistics",
            "auditor.measurement.fault_features.collect.feature_inputs",
            "auditor.measurement.fault_features.collect.fault_features_of",
        ):
            module, _, name = place.rpartition(".")
            patched.enter_context(patch(place, kept.once(getattr(import_module(module), name))))
        measure_recording(MeasureTask(log, store), lambda *_: None)


def content_of(frame: Frame) -> bytes:
    """A hash of what the sensors recorded."""
    digest = hashlib.blake2b()
    for _, image in sorted(frame.images.items()):
        digest.update(image.pixels.tobytes())
    if frame.cloud is not None:
        digest.update(frame.cloud.xyz_m.tobytes())
    return digest.digest()


def _peak_mb(function: str, folder: Path, log: Path) -> float:
    """The peak memory of a process of its own that does something with a log."""
    context = multiprocessing.get_context("spawn")
    with context.Pool(1) as pool:
        return float(pool.apply(_peak, (function, folder, log)))


def _peak(function: str, folder: Path, log: Path) -> float:
    if function == "measure":
        measure_recording(MeasureTask(log, folder / "memory"), lambda *_: None)
    elif function == "picture":
        store = Store.open(folder / "audit")
        [known] = [one for one in store.measurements() if store.recording(one.recording_id).name == log.name]
        frames: Frames = dict.fromkeys(range(0, known.measured, max(1, known.measured // 100)), ())
        where = location_of(store.recording(known.recording_id))
        picture_frames(PictureTask(where, store.folder, known.measurement_id, frames), lambda *_: None)
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return int(status.partition("VmHWM:")[2].split()[0]) / 1024


def measure_memory(folder: Path, log: Path, short: Path) -> str:
    """Peaks in MB, the program itself taken off: of picturing a log, and of measuring a short one."""
    bare = _peak_mb("nothing", folder, log)
    measuring, picturing = _peak_mb("measure", folder, short) - bare, _peak_mb("picture", folder, log) - bare
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
    lacking: list[str] = []
    for row in rows:
        own, known = examples[row["incident_id"]], row["strongest_measurement_id"] or row["measurement_id"]
        kept = {
            frame: {(one.sensor, one.content) for one in store.frame_pictures(known, frame)}
            for frame in set(own.values())
        }
        whole = all(due <= there for there in kept.values()) and {"before", "after", "clean"} <= own.keys()
        counted["whole"] += whole
        lacking += [] if whole else [row["incident_id"]]
        counted["strongest"] += row["strongest_frame"] in kept and bool(kept[row["strongest_frame"]])
    size = sum(path.stat().st_size for path in store.folder.glob("pictures/*/*.*.*"))
    yield f"{len(rows)} incidents; {counted['whole']} have all pictures; {counted['strongest']} their strongest frame"
    yield f"{len(found_places(store))} attacks are in an incident; without all pictures: {', '.join(lacking) or 'none'}"
    yield f"{size / 1e6:.1f} MB of pictures, {size / 1e6 / max(len(rows), 1):.2f} MB an incident"


def found_places(store: Store) -> set[tuple[str, str]]:
    """The attacks, by recording and kind, that some incident overlaps."""
    sql = """
        SELECT DISTINCT incident.name, label.attack || label.from_ns AS attack
        FROM incidents AS incident
        JOIN labels AS label
            ON label.recording_id = incident.recording_id
                AND label.from_ns <= incident.to_ns AND incident.from_ns <= label.to_ns
    """
    return {(row["name"], row["attack"]) for row in rows_of(run_sql(store, sql))}


def labels_of(rig: Rig, count: int, hertz: float, start_ns: int, attacks: int) -> Iterator[AttackLabel]:
    """The ground truth of a log: its places, whatever the sensor."""
    each = count / max(attacks, 1)
    for place in range(attacks):
        first = math.ceil(place * each + each / 2)
        last = first + max(1, round(ATTACKED_S * hertz)) - 1
        from_ns, to_ns = (start_ns + round(number * 1e9 / hertz) for number in (first, last))
        yield AttackLabel(rig.topic(LIDAR), KINDS[place % len(KINDS)][0], from_ns, to_ns, {})


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=60)
    parser.add_argument("--attacks", type=int, default=50)
    parser.add_argument("--logs", type=int, default=2)
    parser.add_argument("--hertz", type=float, default=10)
    parser.add_argument("--into", type=Path)
    given = parser.parse_args(arguments)
    folder = given.into or Path(tempfile.mkdtemp())
    folder.mkdir(exist_ok=True)
    rig, count = plane_rig(FOUR_CAMERAS, lidar=True), round(given.minutes * 60 * given.hertz)
    clean, short, store = folder / "clean.mcap", folder / "short.mcap", folder / "audit"
    write_mcap(clean, rig, frames_of(rig, DIFFERENT, 10, START_NS - DAY_NS, 0, 1))
    write_mcap(short, rig, frames_of(rig, min(count, 1200), given.hertz, START_NS - 2 * DAY_NS, 0, 1))
    logs = [folder / f"log_{seed}.mcap" for seed in range(given.logs)]
    run(["calibrate", str(clean), "--store", str(store)])
    for seed, log in enumerate(logs):
        start_ns = START_NS + seed * DAY_NS
        labels = labels_of(rig, count, given.hertz, start_ns, given.attacks)
        write_mcap(log, rig, frames_of(rig, count, given.hertz, start_ns, given.attacks, seed), labels)
        measure_repeated(log, store)
    run(["scan", *map(str, logs), "--store", str(store), "--jobs", "1"])
    print(f"{given.logs} logs of {given.minutes:g} min at {given.hertz:g} Hz, {given.attacks} attacks in each")
    for line in look(Store.open(store), rig):
        print(line)
    print(measure_memory(folder, logs[0], short))
    if given.into is None:
        shutil.rmtree(folder)


if __name__ == "__main__":
    main()
