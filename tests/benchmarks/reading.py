"""The cost of reading: `python -m tests.benchmarks.reading`.

CPU seconds over a zstd MCAP file of ROS 2 images and clouds (real frames where AUDITOR_TEST_DATA is set, else noise and
ramps), rounds interleaved, medians of the ratios within each round. With --memory the peak memory above an idle process
while files of two lengths are read.
"""

import argparse
import hashlib
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from statistics import median
from time import process_time

import cv2
import numpy as np
from mcap.reader import NonSeekingReader
from mcap.records import Chunk
from mcap.stream_reader import StreamReader
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from auditor.model.frames import Frame
from auditor.model.rig import Rig
from auditor.recordings import open_recording, write_mcap
from auditor.recordings.decoding import Decoders
from tests.benchmarks.real_drives import frames
from tests.making.recorded_drives import make_frames, make_rig

PERIOD_NS = 10**8
ROUNDS = 7


def drive(count: int) -> tuple[Rig, Iterator[Frame]]:
    """Frames one period apart, real ones over and over where there are any."""
    if os.environ.get("AUDITOR_TEST_DATA"):
        rig, stream = frames("0009")
        kept = [frame for frame, _ in zip(stream, range(20), strict=False)]
    else:
        rig, kept = make_rig(3), make_frames(make_rig(3), 20)
    return rig, (_moved(kept[number % len(kept)], kept[0].stamp_ns + number * PERIOD_NS) for number in range(count))


def _moved(frame: Frame, stamp_ns: int) -> Frame:
    images = {number: replace(image, stamp_ns=stamp_ns) for number, image in frame.images.items()}
    return replace(frame, stamp_ns=stamp_ns, cloud=replace(frame.cloud, stamp_ns=stamp_ns), images=images)


def read_and_unpack(path: Path) -> None:
    """The floor: every chunk read and decompressed by zstandard, nothing else; hashed when opened and when read."""
    import zstandard  # noqa: PLC0415 - beside what it measures

    for _ in range(2):
        with path.open("rb") as stream:
            hashlib.file_digest(stream, "sha256")
    unpacker = zstandard.ZstdDecompressor()
    with path.open("rb") as stream:
        for record in StreamReader(stream, emit_chunks=True).records:
            if isinstance(record, Chunk):
                unpacker.decompress(record.data, max_output_size=record.uncompressed_size)


def ours(path: Path) -> None:
    """The container alone, CRCs checked; the file is hashed when it is opened, and each block compared when read."""
    with open_recording(path) as recording:
        for _ in recording.messages():
            pass


def ours_decoded(path: Path) -> None:
    """The same with pixels and points, as the next room gets them."""
    with open_recording(path) as recording:
        decoders = Decoders(recording.definition)
        for message in recording.messages():
            decoder = decoders.of(message.schema, message.encoding)
            if decoder is None:
                continue
            if decoder.kind == "image":
                decoder.pixels(message, colour=False)
            elif decoder.kind == "cloud":
                decoder.xyz_m(message)


def mcap_with_crc(path: Path) -> None:
    """mcap's own streaming reader with CRCs."""
    with path.open("rb") as stream:
        for _ in NonSeekingReader(stream, validate_crcs=True).iter_messages(log_time_order=False):
            pass


def rosbags_decoded(path: Path) -> None:
    """rosbags with its decoding, and pixels and points made arrays."""
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        for connection, _, data in reader.messages():
            if connection.msgtype.endswith(("Image", "PointCloud2")):
                message = reader.deserialize(data, connection.msgtype)
                if connection.msgtype.endswith("Image"):
                    message.data.reshape(message.height, message.step)
                else:
                    points = message.data.view("<f4").reshape(-1, message.point_step // 4)
                    xyz = np.ascontiguousarray(points[:, :3])
                    xyz[np.isfinite(xyz).all(axis=1)]


COSTS: tuple[Callable[[Path], None], ...] = (read_and_unpack, ours, ours_decoded, mcap_with_crc, rosbags_decoded)


def seconds(cost: Callable[[Path], None], path: Path) -> float:
    """CPU seconds of one reading."""
    started = process_time()
    cost(path)
    return process_time() - started


def print_costs(path: Path) -> None:
    """Print medians and ratios."""
    for cost in COSTS:
        cost(path)
    rounds = [{cost: seconds(cost, path) for cost in COSTS} for _ in range(ROUNDS)]
    for cost in COSTS:
        print(f"{cost.__name__:>16}: {1e3 * median(r[cost] for r in rounds):7.1f} ms")
    for name, ours_, theirs, bound in (
        ("CRC and decoding / hash twice, read and decompress", ours_decoded, read_and_unpack, 1.6),
        ("CRC and decoding / rosbags with decoding", ours_decoded, rosbags_decoded, 0.95),
        ("container with CRC / mcap with CRC", ours, mcap_with_crc, 1.7),
    ):
        ratios = [r[ours_] / r[theirs] for r in rounds]
        print(f"{name}: {median(ratios):.2f} ({min(ratios):.2f} to {max(ratios):.2f}; at most {bound})")


def peak_mb(path: Path) -> float:
    """Peak memory of a process that reads and decodes a file, above one that has only imported all it needs."""
    code = "import sys; from pathlib import Path; from tests.benchmarks import reading; {}; "
    # The kernel's ru_maxrss would count what the parent had when it started this process.
    code += "print(Path('/proc/self/status').read_text().split('VmHWM:')[1].split()[0])"
    peaks = []
    for work in ("open(sys.argv[1]).close()", "reading.ours_decoded(Path(sys.argv[1]))"):
        command = [sys.executable, "-c", code.format(work), str(path)]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        peaks.append(int(done.stdout) / 1024)
    return peaks[1] - peaks[0]


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--memory", action="store_true", help="also the peak memory for two lengths")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "drive.mcap"
        rig, stream = drive(60)
        write_mcap(path, rig, stream)
        print(f"{path.stat().st_size / 1e6:.0f} MB, 60 frames")
        print_costs(path)
        for count in (60, 600) if options.memory else ():
            rig, stream = drive(count)
            write_mcap(path, rig, stream)
            print(f"{path.stat().st_size / 1e6:.0f} MB: {peak_mb(path):.0f} MB above an idle process")


if __name__ == "__main__":
    main()
