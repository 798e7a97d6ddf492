"""The same frames in every container and message form, by the real writers."""

import sqlite3
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from mcap.writer import CompressionType, IndexType, Writer
from rosbags.rosbag1 import Reader as BagReader
from rosbags.rosbag1 import Writer as BagWriter
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Reader as Rosbag2Reader
from rosbags.rosbag2 import Writer as Rosbag2Writer

from auditor.model.frames import Frame
from auditor.model.rig import Rig
from auditor.recordings import write_bag, write_db3, write_mcap
from auditor.recordings.writers.messages import Form, MessageMaker
from tests.making.foxglove_messages import messages_of, write_json, write_protobuf
from tests.making.idl import idl_definition
from tests.making.recorded_drives import rechunk

Write = Callable[[Path, Rig, list[Frame], Form], Path]


class Container(NamedTuple):
    """A container with the encoding of its messages; `write` gives the path of the recording it made in a folder."""

    name: str
    write: Write


def _mcap(compression: str, **settings: Any) -> Write:
    def write(folder: Path, rig: Rig, frames: list[Frame], form: Form) -> Path:
        write_mcap(folder / "whole.mcap", rig, frames, image=form)
        rechunk(folder / "whole.mcap", folder / "a.mcap", compression=compression, **settings)
        return folder / "a.mcap"

    return write


def _several_files(folder: Path, rig: Rig, frames: list[Frame], form: Form) -> Path:
    half = len(frames) // 2
    (folder / "drive").mkdir()
    (folder / "drive" / "metadata.yaml").write_text("rosbag2_bagfile_information:\n")
    write_mcap(folder / "drive" / "drive_0.mcap", rig, frames[:half], image=form)
    write_mcap(folder / "drive" / "drive_1.mcap", rig, frames[half:], image=form)
    return folder / "drive"


def _bag(compression: str) -> Write:
    def write(folder: Path, rig: Rig, frames: list[Frame], form: Form) -> Path:
        write_bag(folder / "whole.bag", rig, frames, image=form)
        if compression == "none":
            return folder / "whole.bag"
        return copy_bag(folder / "whole.bag", folder / "a.bag", compression)

    return write


def copy_bag(source: Path, target: Path, compression: str = "none", chunk_bytes: int = 12_000) -> Path:
    """The same messages in chunks of another size and compression, by rosbags' own writer."""
    unopened = BagWriter(target)
    unopened.chunk_threshold = chunk_bytes
    if compression != "none":
        unopened.set_compression(getattr(BagWriter.CompressionFormat, compression.upper()))
    with BagReader(source) as reader, unopened as writer:
        made = {
            c.id: writer.add_connection(c.topic, c.msgtype, msgdef=c.msgdef.data, md5sum=c.digest)
            for c in reader.connections
        }
        for connection, time_ns, data in reader.messages():
            writer.write(made[connection.id], time_ns, data)
    return target


def _ros1_in_mcap(folder: Path, rig: Rig, frames: list[Frame], form: Form) -> Path:
    write_bag(folder / "whole.bag", rig, frames, image=form)
    with BagReader(folder / "whole.bag") as reader, (folder / "a.mcap").open("wb") as out:
        writer = Writer(out, compression=CompressionType.LZ4)
        writer.start("ros1")
        channels: dict[int, int] = {}
        for connection, time_ns, data in reader.messages():
            if connection.id not in channels:
                name = connection.msgtype.replace("/msg/", "/")
                schema = writer.register_schema(name, "ros1msg", connection.msgdef.data.encode())
                channels[connection.id] = writer.register_channel(connection.topic, "ros1", schema)
            writer.add_message(channels[connection.id], time_ns, data, time_ns)
        writer.finish()
    return folder / "a.mcap"


def _idl_in_mcap(folder: Path, rig: Rig, frames: list[Frame], form: Form) -> Path:
    maker = MessageMaker("cdr")
    write_db3(folder / "drive", rig, frames, image=form)
    with Rosbag2Reader(folder / "drive") as reader, (folder / "a.mcap").open("wb") as out:
        writer = Writer(out)
        writer.start("ros2")
        channels: dict[int, int] = {}
        for connection, time_ns, data in reader.messages():
            if connection.id not in channels:
                definition = idl_definition(connection.msgtype, maker.store).encode()
                schema = writer.register_schema(connection.msgtype, "ros2idl", definition)
                channels[connection.id] = writer.register_channel(connection.topic, "cdr", schema)
            writer.add_message(channels[connection.id], time_ns, bytes(data), time_ns)
        writer.finish()
    return folder / "a.mcap"


def _rosbag2(plugin: StoragePlugin, *, bare: bool, packed: CompressionMode = CompressionMode.NONE) -> Write:
    def write(folder: Path, rig: Rig, frames: list[Frame], form: Form) -> Path:
        write_db3(folder / "whole", rig, frames, image=form)
        if plugin is StoragePlugin.SQLITE3 and not packed.value:
            return folder / "whole" / "whole.db3" if bare else folder / "whole"
        copy = Rosbag2Writer(folder / "copy", version=9, storage_plugin=plugin)
        copy.set_compression(packed, CompressionFormat.ZSTD)
        with Rosbag2Reader(folder / "whole") as reader, copy as writer:
            maker = MessageMaker("cdr")
            made = {c.id: writer.add_connection(c.topic, c.msgtype, typestore=maker.store) for c in reader.connections}
            for connection, time_ns, data in reader.messages():
                writer.write(made[connection.id], time_ns, data)
        return next((folder / "copy").glob("copy.*")) if bare else folder / "copy"

    return write


def _unclosed_db3(folder: Path, rig: Rig, frames: list[Frame], form: Form) -> Path:
    """A recorder with a write-ahead log crashed: what it wrote last lies beside its database."""
    write_db3(folder / "whole", rig, frames, image=form)
    source = sqlite3.connect(folder / "whole" / "whole.db3", isolation_level=None)
    recorder = sqlite3.connect(folder / "recorder.db3", isolation_level=None)
    recorder.execute("PRAGMA journal_mode=WAL")
    recorder.execute("PRAGMA wal_autocheckpoint=0")
    tables = [sql for (sql,) in source.execute("SELECT sql FROM sqlite_master WHERE sql IS NOT NULL")]
    for sql in tables:
        recorder.execute(sql)
    for table in ("topics", "message_definitions", "messages"):
        rows = source.execute(f"SELECT * FROM {table}").fetchall()
        for number, row in enumerate(rows):
            recorder.execute(f"INSERT INTO {table} VALUES ({','.join('?' * len(row))})", row)
            if table == "messages" and number == len(rows) // 2:
                recorder.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    for name in ("recorder.db3", "recorder.db3-wal"):
        (folder / name.replace("recorder", "crashed")).write_bytes((folder / name).read_bytes())
    source.close()
    recorder.close()
    return folder / "crashed.db3"


def _protobuf(compression: str) -> Write:
    def write(folder: Path, rig: Rig, frames: list[Frame], form: Form) -> Path:
        write_protobuf(folder / "a.mcap", messages_of(rig, frames, form), compression)
        return folder / "a.mcap"

    return write


def _json(folder: Path, rig: Rig, frames: list[Frame], form: Form) -> Path:
    write_json(folder / "a.mcap", messages_of(rig, frames, form))
    return folder / "a.mcap"


CONTAINERS = (
    Container("mcap ros2", _mcap("NONE")),
    Container("mcap ros2 lz4", _mcap("LZ4")),
    Container("mcap ros2 zstd", _mcap("ZSTD")),
    Container("mcap ros2 unchunked", _mcap("NONE", use_chunking=False, enable_data_crcs=True)),
    Container("mcap ros2 without index", _mcap("ZSTD", index_types=IndexType.NONE)),
    Container(
        "mcap ros2 without summary",
        _mcap("ZSTD", repeat_channels=False, repeat_schemas=False, index_types=IndexType.NONE),
    ),
    Container("mcap ros2, idl", _idl_in_mcap),
    Container("mcap ros2, several files", _several_files),
    Container("mcap ros1", _ros1_in_mcap),
    Container("mcap protobuf zstd", _protobuf("ZSTD")),
    Container("mcap protobuf lz4", _protobuf("LZ4")),
    Container("mcap json", _json),
    Container("bag", _bag("none")),
    Container("bag bz2", _bag("bz2")),
    Container("bag lz4", _bag("lz4")),
    Container("rosbag2 folder, db3", _rosbag2(StoragePlugin.SQLITE3, bare=False)),
    Container("rosbag2 bare db3", _rosbag2(StoragePlugin.SQLITE3, bare=True)),
    Container("rosbag2 folder, mcap", _rosbag2(StoragePlugin.MCAP, bare=False)),
    Container(
        "rosbag2 folder, db3, zstd files", _rosbag2(StoragePlugin.SQLITE3, bare=False, packed=CompressionMode.FILE)
    ),
    Container(
        "rosbag2 folder, db3, zstd messages",
        _rosbag2(StoragePlugin.SQLITE3, bare=False, packed=CompressionMode.MESSAGE),
    ),
    Container(
        "rosbag2 folder, mcap, zstd files", _rosbag2(StoragePlugin.MCAP, bare=False, packed=CompressionMode.FILE)
    ),
    Container(
        "rosbag2 folder, mcap, zstd messages", _rosbag2(StoragePlugin.MCAP, bare=False, packed=CompressionMode.MESSAGE)
    ),
    Container("rosbag2 bare db3.zstd", _rosbag2(StoragePlugin.SQLITE3, bare=True, packed=CompressionMode.FILE)),
    Container("db3 with a write-ahead log", _unclosed_db3),
)
