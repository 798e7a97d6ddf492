"""Hostile and broken recordings, each with the number of messages to be recovered and the damage to be reported."""

import bz2
import sqlite3
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import lz4.frame
import numpy as np
import zstandard
from mcap.writer import CompressionType, Writer

from auditor.recordings import schemas, write_bag, write_db3, write_mcap
from auditor.recordings.recording import LABELS_NAME
from auditor.recordings.writers.messages import MessageMaker
from tests.making.forms import copy_bag
from tests.making.recorded_drives import chunk_ends, make_frames, make_rig, rechunk

MAGIC = b"\x89MCAP0\r\n"
HEADER = struct.pack("<BQII", 0x01, 8, 0, 0)
END = struct.pack("<BQI", 0x0F, 4, 0) + struct.pack("<BQQQI", 0x02, 20, 0, 0, 0) + MAGIC
RIG = make_rig(2)
FRAMES = make_frames(RIG, 4)
WHOLE = 1 + 4 * 5
MAKER = MessageMaker("cdr")
MEGA = 2**20


class Hostile(NamedTuple):
    """`make` writes it into a folder; at least `messages` must come out, and the report must match `damage`."""

    name: str
    make: Callable[[Path], Path]
    messages: int
    damage: str


def text(value: bytes) -> bytes:
    return struct.pack("<I", len(value)) + value


def record(opcode: int, body: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(body)) + body


def schema(number: int, name: bytes, data: bytes = b"", encoding: bytes = b"jsonschema") -> bytes:
    return record(0x03, struct.pack("<H", number) + text(name) + text(encoding) + text(data))


def channel(number: int, topic: bytes, of: int = 1, encoding: bytes = b"json") -> bytes:
    return record(0x04, struct.pack("<HH", number, of) + text(topic) + text(encoding) + text(b""))


def message(number: int, data: bytes = b"{}", time_ns: int = 5) -> bytes:
    return record(0x05, struct.pack("<HIQQ", number, 0, time_ns, time_ns) + data)


def chunk(packed: bytes, size: int, compression: bytes = b"zstd", crc: int = 0) -> bytes:
    head = struct.pack("<QQQI", 0, 0, size, crc) + text(compression)
    return record(0x06, head + struct.pack("<Q", len(packed)) + packed)


NAMED = schema(1, b"a") + channel(1, b"/a")
GOOD = NAMED + message(1)


def mcap(*parts: bytes, end: bytes = END) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        (folder / "a.mcap").write_bytes(MAGIC + HEADER + b"".join(parts) + end)
        return folder / "a.mcap"

    return make


def later(make: Callable[[], Callable[[Path], Path]]) -> Callable[[Path], Path]:
    """What takes long to make is made where it is written, not where all hostile files are listed."""

    def made(folder: Path) -> Path:
        return make()(folder)

    return made


def zeros(size: int) -> bytes:
    return zstandard.compress(bytes(size), 19)


def one(
    name: str, data: bytes, definition: bytes | None = None, encoding: str = "cdr", form: str = "ros2msg"
) -> Callable[[Path], Path]:
    """A file with one message of a schema."""
    values = MAKER.definition(name).encode() if definition is None else definition
    return mcap(
        schema(1, name.encode(), values, form.encode()),
        channel(1, b"/a", 1, encoding.encode()),
        message(1, data),
        message(1, data),
    )


def image(**fields: object) -> bytes:
    head = {"header": MAKER.header(5, "c"), "height": 4, "width": 4, "encoding": "mono8", "is_bigendian": 0, "step": 4}
    made = MAKER.store.types[schemas.IMAGE](**{**head, "data": np.zeros(16, np.uint8), **fields})
    return MAKER.serialise(schemas.IMAGE, made)


def cloud(**fields: object) -> bytes:
    points = MAKER.store.types["sensor_msgs/msg/PointField"]
    values = {
        "header": MAKER.header(5, "c"),
        "height": 1,
        "width": 4,
        "fields": [points(name=n, offset=4 * p, datatype=7, count=1) for p, n in enumerate("xyz")],
        "is_bigendian": False,
        "point_step": 12,
        "row_step": 48,
        "is_dense": True,
    }
    made = MAKER.store.types[schemas.POINT_CLOUD](**{**values, "data": np.zeros(48, np.uint8), **fields})
    return MAKER.serialise(schemas.POINT_CLOUD, made)


def video(data: bytes) -> bytes:
    """A foxglove.CompressedVideo in protobuf."""
    data = b"\0\0\1" + data
    length = bytes([len(data) >> 7 * n & 0x7F | 0x80 for n in range(4)]) + bytes([len(data) >> 28])
    return b"\x0a\x02\x08\x05\x1a" + length + data + b"\x22\x04h264"


def png(width: int, height: int, colour_type: int = 0, depth: int = 8) -> bytes:
    def part(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    row = 1 + width * {0: 1, 2: 3, 6: 4}[colour_type] * depth // 8
    packer, rows = zlib.compressobj(1), bytearray()
    for _ in range(height):
        rows += packer.compress(bytes(row))
    rows += packer.flush()
    head = struct.pack(">IIBBBBB", width, height, depth, colour_type, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + part(b"IHDR", head) + part(b"IDAT", bytes(rows)) + part(b"IEND", b"")


def jpeg_declaring(width: int, height: int) -> bytes:
    return (
        b"\xff\xd8\xff\xc0" + struct.pack(">HBHHB", 11, 8, height, width, 1) + b"\x01\x11\x00" + bytes(40) + b"\xff\xd9"
    )


def many_entries() -> bytes:
    return text(b"".join(text(b"%d" % number) + text(b"") for number in range(10**6)))


def channel_with_map() -> bytes:
    return record(0x04, struct.pack("<HH", 2, 1) + text(b"/b") + text(b"json") + many_entries())


def picture(data: bytes) -> bytes:
    return MAKER.compressed_image(data, "png", 5, "c")


def whole_mcap(folder: Path) -> bytearray:
    write_mcap(folder / "whole.mcap", RIG, FRAMES)
    rechunk(folder / "whole.mcap", folder / "small.mcap")
    return bytearray((folder / "small.mcap").read_bytes())


def changed_mcap(
    change: Callable[[bytearray, list[tuple[int, int, int]]], bytes | bytearray],
) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        content = whole_mcap(folder)
        (folder / "a.mcap").write_bytes(change(content, chunk_ends(folder / "small.mcap")))
        return folder / "a.mcap"

    return make


def _put(layout: str, at: int, value: int) -> Callable[[bytearray, int], bytearray]:
    def put(content: bytearray, start: int) -> bytearray:
        struct.pack_into(layout, content, start + at, value)
        return content

    return put


def sparse(folder: Path) -> Path:
    with (folder / "a.mcap").open("wb") as out:
        out.write(MAGIC + HEADER + GOOD)
        out.truncate(2**29)
    return folder / "a.mcap"


def indexes_to_one_chunk(folder: Path) -> Path:
    inside = GOOD + message(1) * 1000
    body = chunk(zstandard.compress(inside), len(inside), crc=zlib.crc32(inside))
    start = len(MAGIC + HEADER)
    index = (
        struct.pack("<QQQQI", 0, 9, start, len(body), 0)
        + struct.pack("<Q", 0)
        + text(b"zstd")
        + struct.pack("<QQ", 1, 1)
    )
    data_end = struct.pack("<BQI", 0x0F, 4, 0)
    summary_start = start + len(body) + len(data_end)
    footer = struct.pack("<BQQQI", 0x02, 20, summary_start, 0, 0) + MAGIC
    (folder / "a.mcap").write_bytes(MAGIC + HEADER + body + data_end + record(0x08, index) * 2000 + footer)
    return folder / "a.mcap"


def labels(data: bytes) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        with (folder / "a.mcap").open("wb") as out:
            writer = Writer(out, compression=CompressionType.NONE)
            writer.start("")
            writer.add_message(writer.register_channel("/a", "json", 0), 1, b"{}", 1)
            writer.add_attachment(0, 0, LABELS_NAME, "application/json", data)
            writer.finish()
        return folder / "a.mcap"

    return make


def endless_transforms() -> bytes:
    return struct.pack("<4xI", 2**32 - 1) + bytes(100)


def bag(change: Callable[[bytearray], bytes | bytearray], compression: str = "none") -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        write_bag(folder / "whole.bag", RIG, FRAMES)
        copy_bag(folder / "whole.bag", folder / "small.bag", compression, 8_000)
        (folder / "a.bag").write_bytes(change(bytearray((folder / "small.bag").read_bytes())))
        return folder / "a.bag"

    return make


def bag_header(**fields: bytes) -> bytes:
    return b"".join(text(name.encode() + b"=" + value) for name, value in fields.items())


def _bag_field(name: bytes, value: bytes, place: int = 1) -> Callable[[bytearray], bytearray]:
    """Overwrite a header field of the place-th record that has it."""

    def change(content: bytearray) -> bytearray:
        at = -1
        for _ in range(place):
            at = content.index(name + b"=", at + 1)
        content[at + len(name) + 1 : at + len(name) + 1 + len(value)] = value
        return content

    return change


def _bag_with(parts: bytes) -> Callable[[bytearray], bytes]:
    head = bag_header(op=b"\x03", index_pos=bytes(8), conn_count=bytes(4), chunk_count=bytes(4))
    return lambda _: b"#ROSBAG V2.0\n" + text(head) + text(b"") + parts


def bag_chunk(packed: bytes, size: int, compression: bytes) -> bytes:
    head = bag_header(op=b"\x05", compression=compression, size=struct.pack("<I", size))
    return text(head) + text(packed)


def db3(change: Callable[[bytearray], bytes | bytearray]) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        write_db3(folder / "drive", RIG, FRAMES)
        (folder / "a.db3").write_bytes(change(bytearray((folder / "drive" / "drive.db3").read_bytes())))
        return folder / "a.db3"

    return make


def _root_of_messages(content: bytearray) -> int:
    """The first page of the table `messages`: the row of the catalogue has its number just before its SQL."""
    at = content.index(b"messagesmessages")
    return content[at + 16]


def db3_sql(*statements: str) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        connection = sqlite3.connect(folder / "a.db3", isolation_level=None)
        for statement in statements:
            connection.execute(statement)
        connection.close()
        return folder / "a.db3"

    return make


def _loop(content: bytearray) -> bytearray:
    """Make the root of the messages its own child."""
    root = _root_of_messages(content)
    at = (root - 1) * 4096
    content[at : at + 12] = struct.pack(">BHHHBI", 5, 0, 0, 0, 0, root)
    return content


def overflow_loop(folder: Path) -> Path:
    """Messages of 100 kB whose every further page points at itself."""
    table = "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INT, timestamp INT, data BLOB)"
    content = bytearray(
        db3_sql(TOPICS, TOPIC, table, f"INSERT INTO messages VALUES(1, 1, 5, x'{'11' * 100_000}')")(folder).read_bytes()
    )
    for page in range(2, len(content) // 4096 + 1):
        at = (page - 1) * 4096
        if struct.unpack_from(">I", content, at)[0] == page + 1:
            struct.pack_into(">I", content, at, page)
    (folder / "a.db3").write_bytes(content)
    return folder / "a.db3"


TOPICS = "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT)"
TOPIC = "INSERT INTO topics VALUES(1, '/a', 'std_msgs/msg/String', 'cdr')"
ENDLESS = "WITH RECURSIVE n(x) AS (VALUES(1) UNION ALL SELECT x + 1 FROM n) SELECT count(*) FROM n"
DEFINITION_LOOP = b"sensor_msgs/Image a\n" + b"=" * 80 + b"\nMSG: sensor_msgs/Image\nsensor_msgs/Image a\n"


def yaml_bomb(folder: Path) -> Path:
    write_db3(folder / "drive", RIG, FRAMES)
    lines = ["a0: &a0 [x,x,x,x,x,x,x,x,x]"]
    lines += [f"a{n}: &a{n} [{','.join([f'*a{n - 1}'] * 9)}]" for n in range(1, 30)]
    (folder / "drive" / "metadata.yaml").write_text("\n".join(lines))
    return folder / "drive"


HOSTILE = (
    Hostile("mcap: empty", lambda f: _file(f, "a.mcap", b""), 0, "empty"),
    Hostile("mcap: only its first bytes", lambda f: _file(f, "a.mcap", MAGIC), 0, "cut"),
    Hostile("mcap: something else", lambda f: _file(f, "a.mcap", b"text" * 99), 0, "not an MCAP"),
    Hostile("mcap: zstd declares 4 GiB", mcap(GOOD, chunk(zeros(2**10)[:5] + b"\xff" * 8, 2**32)), 1, "at most"),
    Hostile(
        "mcap: frame and chunk disagree on 4 GiB",
        mcap(GOOD, chunk(b"\x28\xb5\x2f\xfd\xe0" + struct.pack("<Q", 2**32) + bytes(131_000), 2**20)),
        1,
        "another size",
    ),
    Hostile(
        "mcap: 21 chunks that unpack to 64 MiB each",
        later(lambda: mcap(GOOD, chunk(zeros(64 * MEGA), 64 * MEGA) * 21)),
        1,
        "too much",
    ),
    Hostile(
        "mcap: lz4 chunk that is longer than declared",
        later(lambda: mcap(GOOD, chunk(lz4.frame.compress(bytes(100 * MEGA)), MEGA, b"lz4"))),
        1,
        "longer than declared",
    ),
    Hostile(
        "mcap: a chunk longer than it declares",
        later(lambda: mcap(GOOD, chunk(zeros(50 * MEGA), 10))),
        1,
        "another size",
    ),
    Hostile("mcap: length of 2^60", mcap(GOOD, struct.pack("<BQ", 6, 2**60), end=b""), 1, "cut"),
    Hostile("mcap: length of 2^64 - 1", mcap(GOOD, struct.pack("<BQ", 5, 2**64 - 1), end=b""), 1, "cut"),
    Hostile("mcap: a tail of zeros", mcap(GOOD, bytes(10 * MEGA), end=b""), 1, "not read"),
    Hostile("mcap: 512 MiB of nothing", sparse, 1, "not read"),
    Hostile("mcap: 2,000 indexes of one chunk", indexes_to_one_chunk, 1001, ""),
    Hostile("mcap: a log time beyond int64", mcap(NAMED, message(1, time_ns=2**64 - 1)), 1, "out of range"),
    Hostile("mcap: an unknown channel", mcap(GOOD, message(9) * 1000), 1, "belong to no channel"),
    Hostile(
        "mcap: 65,536 unknown channels",
        later(lambda: mcap(GOOD, *(message(n) for n in range(2, 2**16)))),
        1,
        "more damaged places",
    ),
    Hostile("mcap: a message too short", mcap(GOOD, record(0x05, b"abc")), 1, "too short"),
    Hostile("mcap: unknown compression", mcap(GOOD, chunk(b"abc", 3, b"brotli")), 1, "unknown"),
    Hostile("mcap: a chunk in a chunk", mcap(GOOD, chunk(chunk(GOOD, len(GOOD), b""), 9 + 40 + len(GOOD), b"")), 1, ""),
    Hostile(
        "mcap: a chunk that ends inside a record",
        mcap(GOOD, chunk(GOOD[:-3], len(GOOD) - 3, b"")),
        1,
        "inside a record",
    ),
    Hostile("mcap: a wrong checksum", mcap(GOOD, chunk(GOOD, len(GOOD), b"", crc=1)), 1, "checksum"),
    Hostile(
        "mcap: 60,000 topics",
        later(lambda: mcap(GOOD, *(channel(n, b"/%d" % n) for n in range(2, 60_000)))),
        1,
        "more than 10000 topics",
    ),
    Hostile(
        "mcap: 50 MiB of definition",
        later(lambda: mcap(GOOD, schema(2, b"b", bytes(50 * MEGA)), schema(3, b"c", bytes(50 * MEGA)))),
        1,
        "too many",
    ),
    Hostile(
        "mcap: a million empty messages",
        later(lambda: mcap(NAMED, chunk(zstandard.compress(message(1, b"") * 10**6, 1), 31 * 10**6))),
        10**6,
        "",
    ),
    Hostile(
        "mcap: four million records of nothing",
        later(lambda: mcap(GOOD, chunk(zstandard.compress(record(0x80, b"") * 3_500_000, 1), 31_500_000))),
        1,
        "too many records",
    ),
    Hostile("mcap: a channel of a million metadata", later(lambda: mcap(GOOD, channel_with_map())), 1, ""),
    Hostile(
        "mcap: metadata of a million entries",
        later(lambda: mcap(GOOD, record(0x0C, text(b"auditor") + many_entries()))),
        1,
        "",
    ),
    Hostile(
        "mcap: a topic of 30 MB",
        later(lambda: mcap(GOOD, channel(2, b"x" * 30 * MEGA), message(2))),
        1,
        "more than 4096",
    ),
    Hostile(
        "mcap: summary behind the end",
        changed_mcap(lambda c, _: c[:-28] + struct.pack("<QQI", 2**63, 0, 0) + MAGIC),
        WHOLE,
        "end is damaged",
    ),
    Hostile(
        "mcap: a chunk's length lies",
        changed_mcap(lambda c, e: _put("<Q", 1, 2**60)(c, e[1][0])),
        WHOLE - 8,
        "left out",
    ),
    Hostile(
        "mcap: a chunk's size lies", changed_mcap(lambda c, e: _put("<Q", 25, 2**40)(c, e[1][0])), WHOLE - 8, "left out"
    ),
    Hostile(
        "mcap: a chunk overwritten",
        changed_mcap(lambda c, e: _put("<Q", 900, 2**63)(c, e[1][0])),
        WHOLE - 8,
        "checksum",
    ),
    Hostile("mcap: ground truth of two million lists", labels(b"[" + b"[]," * 2_000_000 + b"[]]"), 1, "ground truth"),
    Hostile("mcap: ground truth nested deep", labels(b"[" * 10**6), 1, "ground truth"),
    Hostile(
        "mcap: an image of 2^64 pixels", one(schemas.IMAGE, image(width=2**32 - 1, height=2**32 - 1)), 2, "not accepted"
    ),
    Hostile("mcap: an image whose step is 0", one(schemas.IMAGE, image(step=0)), 2, "step does not fit"),
    Hostile(
        "mcap: an image without its pixels",
        one(schemas.IMAGE, image(width=5000, height=4000, step=5000)),
        2,
        "declares",
    ),
    Hostile("mcap: an encoding of 1 MB", one(schemas.IMAGE, image(encoding="x" * MEGA)), 2, "not supported"),
    Hostile(
        "mcap: a PNG of 64,000,000 pixels",
        later(lambda: one(schemas.COMPRESSED_IMAGE, picture(png(8000, 8000, 6)))),
        2,
        "not accepted",
    ),
    Hostile(
        "mcap: a PNG of 16-bit RGBA at the limit",
        later(lambda: one(schemas.COMPRESSED_IMAGE, picture(png(6000, 4000, 6, 16)))),
        2,
        "",
    ),
    Hostile(
        "mcap: a JPEG that declares 65,535 x 65,535",
        one(schemas.COMPRESSED_IMAGE, picture(jpeg_declaring(65535, 65535))),
        2,
        "not accepted",
    ),
    Hostile(
        "mcap: a JPEG without a picture",
        one(schemas.COMPRESSED_IMAGE, picture(jpeg_declaring(4000, 3000))),
        2,
        "decoded whole",
    ),
    Hostile(
        "mcap: a cloud of 2^64 points",
        one(schemas.POINT_CLOUD, cloud(width=2**32 - 1, height=2**32 - 1)),
        2,
        "not accepted",
    ),
    Hostile("mcap: points of 0 bytes", one(schemas.POINT_CLOUD, cloud(point_step=0)), 2, "point_step does not fit"),
    Hostile(
        "mcap: points of 4 GiB", one(schemas.POINT_CLOUD, cloud(point_step=2**32 - 1)), 2, "point_step does not fit"
    ),
    Hostile("mcap: endless transforms", one(schemas.TRANSFORMS, endless_transforms()), 2, "does not fit"),
    Hostile(
        "mcap: a frame id of 60 MB",
        later(lambda: one(schemas.IMAGE, struct.pack("<4xIII", 0, 0, 60 * MEGA) + bytes(60 * MEGA))),
        2,
        "header",
    ),
    Hostile(
        "mcap: a definition that holds itself", one(schemas.IMAGE, image(), DEFINITION_LOOP), 2, "definition|defined"
    ),
    Hostile("mcap: a definition of 2^40 numbers", one("a/msg/A", b"\0\0\0\0abc", b"float64[1099511627776] a"), 2, ""),
    Hostile(
        "mcap: a well-known name for 2^40 numbers",
        one(schemas.IMAGE, image(), b"float64[1099511627776] a"),
        2,
        "otherwise",
    ),
    Hostile("mcap: a definition of 10 MB", one(schemas.IMAGE, image(), b"uint8 a\n" * 1_250_000), 2, "not accepted"),
    Hostile("mcap: ill-formed IDL", one(schemas.IMAGE, image(), b"module " * 10_000, form="ros2idl"), 2, "definition"),
    Hostile(
        "mcap: IDL of a thousand brackets",
        one(schemas.IMAGE, image(), b"module a { " * 2_000, form="ros2idl"),
        2,
        "definition",
    ),
    Hostile(
        "mcap: protobuf of endless fields",
        one("foxglove.PointCloud", b"\x78\x00" * 10**6, b"", "protobuf", ""),
        2,
        "fields",
    ),
    Hostile(
        "mcap: protobuf of endless transforms",
        one("foxglove.FrameTransforms", b"\x0a\x00" * 10**6, b"", "protobuf", ""),
        2,
        "fields",
    ),
    Hostile(
        "mcap: a protobuf schema of 10 MB",
        one("foxglove.RawImage", b"", b"\x0a\x00" * 5 * MEGA, "protobuf", "protobuf"),
        2,
        "schema",
    ),
    Hostile(
        "mcap: JSON of a million lists",
        one("foxglove.RawImage", b"[" + b"[]," * 10**6 + b"[]]", b"", "json", ""),
        2,
        "too many",
    ),
    Hostile("mcap: JSON nested deep", one("foxglove.RawImage", b"[" * 90_000, b"", "json", ""), 2, "not JSON"),
    Hostile(
        "mcap: JSON of one 40 MB text",
        later(lambda: one("foxglove.RawImage", b'{"data": "' + b"A" * 40 * MEGA + b'"}', b"", "json", "")),
        2,
        "not accepted",
    ),
    Hostile(
        "mcap: names that mean something elsewhere",
        mcap(schema(1, b"<script>"), channel(1, b"../../../etc/passwd\0'; DROP TABLE x; --\x1b[2J"), message(1)),
        1,
        "",
    ),
    Hostile(
        "mcap: a video that declares 2^34 pixels",
        one(
            "foxglove.CompressedVideo",
            video(bytes.fromhex("67420028f4") + b"\x00\x01\x00\x00\x40\x00" * 4),
            b"",
            "protobuf",
            "",
        ),
        2,
        "video|not accepted",
    ),
    Hostile(
        "mcap: a video of a million units",
        later(lambda: one("foxglove.CompressedVideo", video(b"\x67" + b"\0\0\1\x67" * 10**6), b"", "protobuf", "")),
        2,
        "units|video",
    ),
    Hostile("bag: something else", lambda f: _file(f, "a.bag", b"#ROSBAG V1.2\n" * 99), 0, "not a ROS 1 bag"),
    Hostile("bag: a header of 4 GiB", bag(_bag_with(b"\xff" * 400)), 0, "no records"),
    Hostile("bag: index of 2^32 chunks", bag(_bag_field(b"chunk_count", b"\xff" * 4)), WHOLE + 1, ""),
    Hostile("bag: index behind the end", bag(_bag_field(b"index_pos", b"\xff" * 8)), WHOLE + 1, "before its index"),
    Hostile("bag: index at its own start", bag(_bag_field(b"index_pos", struct.pack("<Q", 13))), WHOLE + 1, ""),
    Hostile("bag: a chunk that declares 4 GiB", bag(_bag_field(b"size", b"\xff" * 4, 2)), WHOLE - 8, "at most"),
    Hostile(
        "bag: bz2 that unpacks to 100 MiB",
        later(lambda: bag(_bag_with(bag_chunk(bz2.compress(bytes(60 * MEGA)), MEGA, b"bz2")))),
        0,
        "longer than declared",
    ),
    Hostile(
        "bag: 30 lz4 chunks of 60 MiB",
        later(lambda: bag(_bag_with(bag_chunk(lz4.frame.compress(bytes(60 * MEGA)), 60 * MEGA, b"lz4") * 30))),
        0,
        "left out",
    ),
    Hostile("bag: a chunk of zeros", bag(_bag_with(bag_chunk(bytes(MEGA), MEGA, b"none"))), 0, "left out"),
    Hostile(
        "bag: a million header fields",
        bag(_bag_with(text(text(b"op=\x02") + text(b"a=b") * 100_000) + text(b""))),
        0,
        "left out",
    ),
    Hostile("db3: something else", lambda f: _file(f, "a.db3", b"text" * 9999), 0, "not a SQLite"),
    Hostile("db3: a table that is its own child", db3(_loop), 0, "cannot be read"),
    Hostile("db3: rows that never end", overflow_loop, 0, "cut or too large"),
    Hostile("db3: a first page of noise", db3(lambda c: b"\xff" * 4096 + c[4096:]), WHOLE + 1, "first page"),
    Hostile("db3: page size of 512 where it is 4096", db3(lambda c: c[:16] + b"\x02\x00" + c[18:]), 0, ""),
    Hostile(
        "db3: a column that makes a gigabyte",
        db3_sql(
            TOPICS,
            TOPIC,
            "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INT, timestamp INT, data BLOB,"
            " b AS (zeroblob(1000000000)))",
            "INSERT INTO messages VALUES(1, 1, 5, x'00')",
        ),
        1,
        "",
    ),
    Hostile(
        "db3: endless views for tables", db3_sql(TOPICS, TOPIC, f"CREATE VIEW messages AS {ENDLESS}"), 0, "not a ROS 2"
    ),
    Hostile("rosbag2 folder: metadata.yaml of a billion laughs", yaml_bomb, WHOLE + 1, ""),
)


def _file(folder: Path, name: str, content: bytes) -> Path:
    (folder / name).write_bytes(content)
    return folder / name
