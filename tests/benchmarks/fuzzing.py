"""A mutation loop over containers and payloads: `python -m tests.benchmarks.fuzzing --iterations 100000`.

Every iteration damages a small recording of one container, or one message of one schema, and reads all there is:
topics, messages, ground truth, metadata, headers, pixels, points, calibrations, transforms, frames. Anything raised but
our own errors, and anything that computes for more than --limit seconds or waits for twelve times as long, is printed
with the seed that repeats it (--seed N --iterations 1) and makes the exit code 1.
"""

import argparse
import base64
import gzip
import json
import random
import resource
import signal
import sys
import tempfile
import traceback
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from time import perf_counter, process_time

import cv2
import numpy as np

from auditor.errors import DecodingError
from auditor.model.frames import Message
from auditor.recordings import open_recording, schemas
from auditor.recordings.decoding import Decoders
from auditor.recordings.decoding.calibration_texts import calibrations_of
from auditor.recordings.decoding.pictures import decode_picture
from auditor.recordings.decoding.points.cloudini import of_cloudini
from auditor.recordings.decoding.points.compressed import of_draco
from auditor.recordings.decoding.points.ouster import sensor_of
from auditor.recordings.decoding.points.velodyne import calibration_of
from auditor.recordings.formats.datasets.argoverse import table_of
from auditor.recordings.formats.datasets.dgp import points_of_npz
from auditor.recordings.formats.datasets.pandaset import points_of_pickle
from auditor.recordings.recording import Definition
from auditor.recordings.writers.messages import MessageMaker
from tests.making.camchains import camchain
from tests.making.cloudini import cloudini
from tests.making.datasets import write_argoverse, write_dgp
from tests.making.forms import CONTAINERS
from tests.making.message_forms import FORMS, draco_cloud, drive, file_of
from tests.making.ouster import TOPIC, metadata, packet_message, packets
from tests.making.pickled_tables import LAYOUTS
from tests.making.reading_all import decode_all, read_all
from tests.making.recorded_drives import make_frames, make_rig
from tests.making.scenes import plane_rig
from tests.making.velodyne import packets_of_hdl_64e, scan_of, velodyne_scan
from tests.making.videos import ENCODERS, VIDEO, encoded, moving_picture, video_messages

INTERESTING = (
    b"\x00",
    b"\xff",
    b"\x7f",
    b"\x80",
    b"\x00" * 4,
    b"\xff" * 4,
    b"\xff" * 8,
    b"\x00\x00\x00\x80",
    b"\x00" * 64,
)
INTERESTING += tuple((1 << power).to_bytes(8, "little") for power in (16, 24, 31, 32, 40, 60, 63))
PART_SHARE = 0.1
CONTAINER_SHARE = 0.3
DEFINITION_SHARE = 0.03
_PATIENCE = 12  # a busy machine may let anything wait; what waits for ever is a hang all the same


class HangError(Exception):
    """An iteration took too long."""


def mutate(data: bytes, rng: random.Random) -> bytes:
    """One to eight changes: bits, bytes, numbers, cuts, holes, repetitions, swaps."""
    content = bytearray(data)
    for _ in range(rng.choice((1, 1, 1, 2, 3, 8))):
        if not content:
            break
        # Headers and ends hold the sizes: half of the changes go there.
        at = rng.randrange(len(content)) if rng.random() < 0.5 else rng.randrange(min(len(content), 256))
        at = len(content) - 1 - at if rng.random() < 0.2 else at
        span = rng.choice((1, 2, 4, 8, 32, 512))
        kind = rng.randrange(8)
        if kind == 0:
            content[at] ^= 1 << rng.randrange(8)
        elif kind == 1:
            content[at] = rng.randrange(256)
        elif kind == 2:
            number = rng.choice(INTERESTING)
            content[at : at + len(number)] = number
        elif kind == 3:
            del content[at:]
        elif kind == 4:
            del content[at : at + span]
        elif kind == 5:
            content[at:at] = content[at : at + span]
        elif kind == 6:
            content[at:at] = rng.randbytes(span)
        else:
            other = rng.randrange(len(content))
            content[at : at + span] = content[other : other + span]
    return bytes(content)


class Seeds:
    """Small recordings of every container, and one message of every schema and encoding in them."""

    def __init__(self, folder: Path) -> None:
        rig, self.files = make_rig(2), {}
        self.payloads: dict[str, tuple[Message, Definition | None, Decoders]] = {}
        self.parts: dict[str, tuple[bytes, Callable[[bytes], object], type[Exception]]] = {}
        for number, container in enumerate(CONTAINERS):
            for form in ("raw", "png", "jpeg") if number in {2, 9, 11, 12} else ("raw",):
                place = folder / f"{number}{form}"
                place.mkdir()
                path = container.write(place, rig, make_frames(rig, 2), form)
                self._messages(container.name, path)
                if path.is_dir():
                    path = max(path.glob("*.[md][cb]*"), key=lambda file: file.stat().st_size)
                log = path.with_name(f"{path.name}-wal")
                content = (path.read_bytes(), log.read_bytes() if log.exists() else b"")
                self.files[f"{container.name} {form}"] = ("".join(path.suffixes), *content)

    def add_videos(self) -> None:
        """Key pictures and others, where the extra `video` is installed."""
        if find_spec("av") is None:
            return
        for form in ENCODERS:
            packets = encoded([moving_picture(number) for number in range(2)], form=form)
            for number, message in enumerate(video_messages(packets, format=form)):
                self.payloads[f"{VIDEO} {form} {number}"] = (message, None, Decoders(lambda _: None))

    def add_packets(self) -> None:
        """A packet of an Ouster, and a scan of a Velodyne where the extra `lidar` is installed."""
        described = Decoders(lambda _: None, metadata={TOPIC: metadata()})
        self.payloads["ouster"] = (packet_message(next(packets(5))[1]), None, described)
        if find_spec("velodyne_decoder") is not None:
            self.payloads["velodyne"] = (velodyne_scan(4), None, Decoders(lambda _: None))
            made = packets_of_hdl_64e()
            calibration = {"/packets": calibration_of(made) or ""}
            self.payloads["hdl-64e"] = (scan_of(made[:4]), None, Decoders(lambda _: None, metadata=calibration))

    def add_parts(self, folder: Path) -> None:
        """Files of data sets and texts of calibrations, each with what reads it and what that may raise."""
        rig = plane_rig((0.6, 0.3, 0.0))
        frames = drive(rig, 1)
        npz = next(write_dgp(folder / "dgp", rig, frames).rglob("*.npz")).read_bytes()
        feather = next(write_argoverse(folder / "argoverse", rig, frames).rglob("lidar/*.feather")).read_bytes()
        self.parts = {
            "npz": (npz, points_of_npz, ValueError),
            "feather": (feather, table_of, ValueError),
            **{f"pickle {name}": (pickle, points_of_pickle, ValueError) for name, pickle in LAYOUTS.items()},
            "pickle packed": (gzip.compress(LAYOUTS["2.2.3, joined"]), points_of_pickle, ValueError),
            "camchain": (camchain(make_rig()).encode(), _calibrations, DecodingError),
            "hdl-64e text": (b"".join(one[-6:] for one in packets_of_hdl_64e()), _of_last_bytes, DecodingError),
            "ouster metadata": (metadata().encode(), _sensor, DecodingError),
            **{f"cloudini {number}": (packed, _cloudini, DecodingError) for number, packed in enumerate(_clouds())},
            "avif file": (file_of(moving_picture(3), "avif"), _picture, DecodingError),
        }
        if find_spec("DracoPy") is not None:
            maker = MessageMaker("cdr")
            _, data = draco_cloud(maker, frames[0].cloud.xyz_m[:50], 5)
            packed = bytes(maker.store.deserialize_cdr(data, schemas.COMPRESSED_CLOUD).compressed_data)
            self.parts["draco bare"] = (packed, partial(of_draco, most_points=10**6, topic=""), DecodingError)
        for form in ENCODERS if find_spec("av") is not None else ():
            first, second = encoded([moving_picture(number) for number in range(2)], form=form)
            self.parts[f"{form} key"] = (first, partial(_pictures, form, b""), DecodingError)
            self.parts[f"{form} next"] = (second, partial(_pictures, form, first), DecodingError)

    def add_forms(self, folder: Path) -> None:
        """A picture and a cloud of every form that recorders and drivers write."""
        rig = plane_rig((0.6, 0.3, 0.0))
        frames = drive(rig, 1)
        for number, form in enumerate(FORMS):
            if not form.is_there:
                continue
            place = folder / f"form_{number}"
            place.mkdir()
            with open_recording(form.write(place, rig, frames)) as recording:
                for message in recording.messages():
                    definition = recording.definition(message.schema)
                    decoders = Decoders(lambda _, definition=definition: definition)
                    decoder = decoders.of(message.schema, message.encoding)
                    if decoder is not None and decoder.kind in {"image", "cloud"}:
                        self.payloads.setdefault(f"{form.name}: {message.schema}", (message, definition, decoders))

    def keep(self, words: Sequence[str]) -> None:
        """Leave out what has none of these words in its name."""
        for known in (self.files, self.payloads, self.parts):
            for name in [name for name in known if not any(word in name for word in words)]:
                del known[name]

    def _messages(self, container: str, path: Path) -> None:
        with open_recording(path) as recording:
            for message in recording.messages():
                key = f"{message.schema} {message.encoding} {'idl' if 'idl' in container else ''}"
                definition = recording.definition(message.schema)
                decoders = Decoders(lambda _, definition=definition: definition)
                if decoders.of(message.schema, message.encoding) is not None:
                    self.payloads.setdefault(key, (message, definition, decoders))


def _clouds() -> list[bytes]:
    """Clouds of cloudini in each of its versions and encodings."""
    made = json.loads((Path(__file__).parents[1] / "recordings/decoding/cloudini_clouds.json").read_text())
    return [cloudini(np.ones((50, 3), np.float32)), *(base64.b64decode(one["data"]) for one in made)]


def _cloudini(data: bytes) -> object:
    return of_cloudini(data, 10**6, "")


def _of_last_bytes(data: bytes) -> object:
    return calibration_of(data[place : place + 6] for place in range(0, len(data) - 5, 6))


def _sensor(data: bytes) -> object:
    return sensor_of(data.decode("utf-8", "replace"))


def _picture(data: bytes) -> object:
    return decode_picture(memoryview(data), colour=True, size_px=None)


def _pictures(form: str, before: bytes, data: bytes) -> object:
    """The picture of a packet behind a whole one."""
    decoder = Decoders(lambda _: None).image(VIDEO, "protobuf")
    return [decoder.pixels(one, colour=False) for one in video_messages([before, data], format=form)]


def _calibrations(data: bytes) -> object:
    return calibrations_of(data.decode("utf-8", "replace"))


def one(seed: int, seeds: Seeds, folder: Path) -> str:
    """One iteration; what it was done to."""
    rng = random.Random(seed)
    if seeds.parts and (rng.random() < PART_SHARE or not seeds.payloads):
        name = rng.choice(list(seeds.parts))
        data, read, may_raise = seeds.parts[name]
        with suppress(may_raise):
            read(mutate(data, rng))
        return name
    if rng.random() < CONTAINER_SHARE and seeds.files:
        name = rng.choice(list(seeds.files))
        suffix, content, log = seeds.files[name]
        path, log_path = folder / f"a{suffix}", folder / f"a{suffix}-wal"
        path.write_bytes(mutate(content, rng) if not log or rng.random() < 0.3 else content)
        log_path.unlink(missing_ok=True)
        if log:
            log_path.write_bytes(mutate(log, rng))
        read_all(path)
        return name
    name = rng.choice(list(seeds.payloads))
    message, definition, decoders = seeds.payloads[name]
    if rng.random() < DEFINITION_SHARE and definition is not None:
        changed = Definition(definition.encoding, mutate(definition.data, rng))
        decode_all(message, Decoders(lambda _: changed))
    else:
        decode_all(replace(message, data=mutate(bytes(message.data), rng)), decoders)
    return name


def run(first: int, count: int, limit_s: float, only: str = "") -> bool:
    """Run on what has one of the words in its name, and print; True where nothing was found."""
    with tempfile.TemporaryDirectory(dir="/dev/shm" if Path("/dev/shm").is_dir() else None) as name:
        (Path(name) / "seeds").mkdir()
        seeds = Seeds(Path(name) / "seeds")
        seeds.add_videos()
        seeds.add_packets()
        seeds.add_parts(Path(name))
        seeds.add_forms(Path(name) / "seeds")
        if only:
            seeds.keep(only.split(","))
        idle_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        words = 3 if only else 1
        found, _ = looped(
            range(first, first + count), limit_s, lambda seed: " ".join(one(seed, seeds, Path(name)).split()[:words])
        )
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"peak memory {peak_mb - idle_mb:.0f} MB above the start")
    return found == 0


def looped(seeds: Sequence[int], limit_s: float, one: Callable[[int], str]) -> tuple[int, Counter[str]]:
    """Run an iteration of each seed, and print; the foreign exceptions and hangs, and how often each end came."""
    found, slowest, ends = 0, (0.0, 0), Counter[str]()
    signal.signal(signal.SIGPROF, _hang)
    signal.signal(signal.SIGALRM, _hang)
    started = perf_counter()
    for seed in seeds:
        before = process_time()
        signal.setitimer(signal.ITIMER_PROF, limit_s)
        signal.setitimer(signal.ITIMER_REAL, _PATIENCE * limit_s)
        try:
            ends[one(seed)] += 1
        except Exception:  # noqa: BLE001 - a foreign exception is what this looks for
            found += 1
            print(f"seed {seed}:\n{traceback.format_exc()}", flush=True)
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0)
            signal.setitimer(signal.ITIMER_REAL, 0)
        slowest = max(slowest, (process_time() - before, seed))
    seconds = perf_counter() - started
    print(
        f"{len(seeds)} iterations in {seconds:.0f} s ({len(seeds) / seconds:.0f} a second), {found} foreign exceptions "
        f"or hangs; slowest {slowest[0]:.2f} s (seed {slowest[1]})"
    )
    print(", ".join(f"{name}: {number}" for name, number in sorted(ends.items())))
    return found, ends


def _hang(_signal: int, _frame: object) -> None:
    raise HangError


def options_of(text: str | None, iterations: int) -> argparse.ArgumentParser:
    """The options of a mutation loop."""
    parser = argparse.ArgumentParser(description=text.splitlines()[0] if text else None)
    parser.add_argument("--iterations", type=int, default=iterations)
    parser.add_argument("--seed", type=int, default=0, help="number of the first iteration")
    parser.add_argument("--limit", type=float, default=5.0, help="seconds of computing that one iteration may take")
    return parser


def main() -> None:
    """Measure and print."""
    parser = options_of(__doc__, 10_000)
    parser.add_argument("--only", default="", help="words, with commas, of which names have one: av1,draco")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    sys.exit(0 if run(options.seed, options.iterations, options.limit, options.only) else 1)


if __name__ == "__main__":
    main()
