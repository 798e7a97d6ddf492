"""What a night with few new files among many known ones costs: `python -m tests.benchmarks.known_files`.

The store is that of `tests.benchmarks.fleet`: recordings of 1,000 frames, made by repeating measured ones. In the place
of each recording's file lies an MCAP with its topics, of 20 vehicles that record side by side, and the store says that
it was read from there. So all that a scan does with a known file it does here: list, compare with the files beside it,
look up by path, size, times and inode, and judge by what the store has. The new files are recordings of
`--new-frames` frames of three small cameras and a LiDAR; longer ones, or larger images, make the ratio smaller.

Prints the CPU seconds, of all processes, and the peak memory of: a scan of the new files into an empty store; one of
the folder where nothing is new, as a table and as JSON; one of the folder with the new files; and the same for
`refresh` where that is asked for.
"""

import argparse
import shutil
import tempfile
from collections.abc import Mapping
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

from mcap.writer import CompressionType, Writer

from auditor.measurement.disparity.matchers import find_matcher
from auditor.pipeline.measured import procedures_by, stamp_of
from auditor.recordings import write_mcap
from auditor.recordings.writers.messages import MessageMaker
from auditor.store.log.runs import logged
from auditor.store.packs.packing import pack
from auditor.store.records import Sighting
from auditor.store.store import Store
from tests.benchmarks.fleet import OF_FRAMES, cost, fill
from tests.making.scenes import plane_rig
from tests.making.small_drives import START_NS, drive_frames

VEHICLES = 20
POSITIONS_M = (0.6, 0.3, 0.0)
TOPICS = {
    "/points": "sensor_msgs/msg/PointCloud2",
    **{f"/camera_{number}": "sensor_msgs/msg/Image" for number in (1, 2, 3)},
    **{f"/camera_{number}/camera_info": "sensor_msgs/msg/CameraInfo" for number in (1, 2, 3)},
    "/tf_static": "tf2_msgs/msg/TFMessage",
}
_LENGTH_NS, _APART_NS = 100 * 10**9, 1000 * 10**9


def write_known(store: Store, logs: Path) -> None:
    """Write a small file for each recording of a store, and say in the store that it was read from there."""
    logs.mkdir()
    procedures = procedures_by(find_matcher("sgbm"))
    maker = MessageMaker("cdr")
    schemas = {name: maker.definition(name).encode() for name in TOPICS.values()}
    measured = {one.recording_id: one.measurement_id for one in store.measurements()}
    with logged(store.folder):
        for number, record in enumerate(sorted(store.recordings(), key=lambda one: one.name)):
            path = logs / record.name
            begin_ns = START_NS + number // VEHICLES * _APART_NS + number % VEHICLES * 10**9
            write_blank(path, begin_ns, schemas)
            stamp = stamp_of(path, procedures, None)
            seen = Sighting(record.name, str(path), datetime.now(UTC), stamp, (measured[record.recording_id],))
            store.write_recording(replace(record, sightings=(seen,)))
    pack(store)


def write_blank(path: Path, begin_ns: int, schemas: Mapping[str, bytes]) -> None:
    """An MCAP file with the topics and the length of a recording; its messages are empty, since nobody reads them."""
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE)
        writer.start("ros2")
        for topic, name in TOPICS.items():
            channel = writer.register_channel(topic, "cdr", writer.register_schema(name, "ros2msg", schemas[name]))
            for stamp_ns in (begin_ns, begin_ns + _LENGTH_NS):
                writer.add_message(channel, stamp_ns, b"", stamp_ns)
        writer.finish()  # type: ignore[no-untyped-call]  # mcap annotates all but this


def write_new(folder: Path, count: int, frames: int, after_ns: int) -> None:
    """Write recordings of so many frames that begin after all others, each a minute later than the one before."""
    folder.mkdir()
    rig = plane_rig(POSITIONS_M, True)
    for number in range(count):
        begin_ns = after_ns + (1 + number) * 60 * 10**9
        taken = drive_frames(rig, frames, seed=1000 * number, start_ns=begin_ns)
        write_mcap(folder / f"new_{number:03}.mcap", rig, taken, vehicle=f"car{number % VEHICLES}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--recordings", type=int, default=10_000)
    parser.add_argument("--new", type=int, default=50)
    parser.add_argument("--new-frames", type=int, default=20)
    parser.add_argument("--verbs", nargs="*", default=["scan"], choices=["scan", "refresh"])
    parser.add_argument("--store", type=Path, help="a store that tests.benchmarks.fleet left here; it is changed")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        folder, logs, new = options.store or Path(place) / "audit", Path(place) / "logs", Path(place) / "new"
        if options.store is None:
            fill(folder, options.recordings, 1000, [*OF_FRAMES[1:], "verdicts"])
            pack(Store.open(folder))
        store = Store.open(folder)
        write_known(store, logs)
        write_new(new, options.new, options.new_frames, max(one.to_ns or 0 for one in store.recordings()))
        for verb in options.verbs:
            _report(verb, store.folder, logs, new, Path(place))


def _report(verb: str, store: Path, logs: Path, new: Path, place: Path) -> None:
    alone = _said(f"{verb} of the new alone", [verb, str(new), "--store", str(place / f"{verb}.empty")])
    _said(f"{verb} of the known", [verb, str(logs), "--store", str(store)])
    if verb == "scan":
        _said("scan of the known, as JSON", [verb, str(logs), "--store", str(store), "--format", "json"])
    for path in new.iterdir():
        shutil.move(path, logs)
    together = _said(f"{verb} of the known and the new", [verb, str(logs), "--store", str(store)])
    print(f"{together / alone:.2f} times the new alone")


def _said(what: str, words: list[str]) -> float:
    seconds, memory, code = cost(words)
    print(f"{what:28} {seconds:7.2f} CPU s, {memory:5.0f} MB, exit {code}", flush=True)
    return seconds


if __name__ == "__main__":
    main()
