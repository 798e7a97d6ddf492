"""ROS messages: this module decodes headers, which every message needs; rosbags' typestore decodes the rest."""

import re
import struct
from collections.abc import Callable
from functools import cache, lru_cache
from typing import Any

from rosbags.interfaces import Nodetype
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, TypesysError, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from auditor.errors import DecodingError
from auditor.model.frames import Message
from auditor.recordings import schemas
from auditor.recordings.decoding.interface import Header
from auditor.recordings.recording import Definition

_LIVOX_POINT = (
    "uint32 offset_time\nfloat32 x\nfloat32 y\nfloat32 z\nuint8 reflectivity\nuint8 tag\nuint8 line\n"  # 19 bytes
)
_LIVOX = (
    "std_msgs/Header header\nuint64 timebase\nuint32 point_num\nuint8 lidar_id\nuint8[3] rsvd\nCustomPoint[] points\n"
)
_COMPRESSED_CLOUD = (
    "std_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] fields\nbool is_bigendian\n"
    "uint32 point_step\nuint32 row_step\nuint8[] compressed_data\nbool is_dense\nstring format\n"
)

_FFMPEG_PACKET = (
    "std_msgs/Header header\nint32 width\nint32 height\nstring encoding\nuint64 pts\nuint8 flags\n"
    "bool is_bigendian\nuint8[] data\n"
)

_DRIVERS = {
    **{name.replace("CustomMsg", "CustomPoint"): _LIVOX_POINT for name in schemas.LIVOX},
    **dict.fromkeys(schemas.LIVOX, _LIVOX),
    schemas.VELODYNE: "std_msgs/Header header\nvelodyne_msgs/VelodynePacket[] packets\n",
    "velodyne_msgs/msg/VelodynePacket": "builtin_interfaces/Time stamp\nuint8[1206] data\n",
    **dict.fromkeys(schemas.OUSTER, "uint8[] buf\n"),
    schemas.COMPRESSED_CLOUD: _COMPRESSED_CLOUD,
    schemas.FFMPEG_PACKET: _FFMPEG_PACKET,
    schemas.FOXGLOVE_VIDEO: "builtin_interfaces/Time timestamp\nstring frame_id\nuint8[] data\nstring format\n",
}


@cache  # it compiles what serialises a type when it is first asked to
def known_types(encoding: str = "cdr") -> Typestore:
    """The definitions of ROS 1 (for the encoding 'ros1') or ROS 2; nothing is registered in it later."""
    store = get_typestore(Stores.ROS1_NOETIC if encoding == "ros1" else Stores.ROS2_HUMBLE)
    texts = dict(_DRIVERS)
    if encoding == "ros1":
        transforms = "geometry_msgs/TransformStamped[] transforms"
        texts |= dict.fromkeys((schemas.TRANSFORMS, schemas.TRANSFORMS_OLD), transforms)
    for name, text in texts.items():
        store.register(get_types_from_msg(text, name))
    return store


_CDR_HEAD = {b"\x00\x01": struct.Struct("<4xiII"), b"\x00\x00": struct.Struct(">4xiII")}
_OTHER_CDR = {bytes([0, kind]) for kind in (2, 3, 6, 7, 8, 9, 10, 11)}
"""The first bytes of other forms of CDR (DDS-XTypes 1.3, section 7.6.3.1.2)."""

_ROS1_HEAD = struct.Struct("<4xIII")
_MAX_FRAME_ID_BYTES = 1024

MAX_DEFINITION_BYTES = 2**17
"""The definition of CameraInfo with all its parts has 12 kB as text."""

_ROS1_NAMES = {"D": "d", "K": "k", "R": "r", "P": "p"}
"""The matrices of CameraInfo, which ROS 1 writes in capitals and ROS 2 does not."""

_IDL_RULER = "=" * 80 + "\n"
_TYPE_NAME = re.compile(r"[A-Za-z]\w{0,99}(/[A-Za-z]\w{0,99}){1,2}", re.ASCII)
_FIELD_NAME = re.compile(r"[A-Za-z]\w{0,99}", re.ASCII)

_PARSER_ERRORS = (
    TypesysError,
    AssertionError,
    AttributeError,
    KeyError,
    RecursionError,
    SyntaxError,
    TypeError,
    ValueError,
)
"""The errors that rosbags' parsers and code generators raise for damaged definitions."""

Types = dict[str, tuple[list[Any], list[tuple[str, Any]]]]
"""rosbags' parse trees: constants and fields by type name."""


def read_header(message: Message) -> Header:
    """The std_msgs/Header that a message begins with. Raises DecodingError."""
    layout, seconds, nanoseconds, end = _head(message)
    frame_id = bytes(message.data[layout.size : end]).rstrip(b"\0").decode("utf-8", "replace")
    return Header(seconds * 10**9 + nanoseconds, frame_id.lstrip("/"))


def end_of_header(message: Message) -> tuple[int, str]:
    """Where what follows the std_msgs/Header begins, aligned to 4 bytes, and its byte order. Raises DecodingError."""
    layout, _, _, end = _head(message)
    order = layout.format[0]
    return (end if message.encoding == "ros1" else end + -end % 4), order


def _head(message: Message) -> tuple[struct.Struct, int, int, int]:
    """The layout of a message's header, its seconds and nanoseconds, and where it ends."""
    data = message.data
    layout = _ROS1_HEAD if message.encoding == "ros1" else _CDR_HEAD.get(bytes(data[:2]))
    if layout is None and bytes(data[:2]) in _OTHER_CDR:
        raise DecodingError(
            f"the message is encoded in a form of CDR that is not read (0x{bytes(data[:2]).hex()}: XCDR2 or parameter "
            "lists); record it with rosbag2, in plain CDR",
            where=message.topic,
        )
    if layout is None or len(data) < layout.size:
        raise DecodingError("the message has no readable header", where=message.topic)
    seconds, nanoseconds, length = layout.unpack_from(data)
    end = layout.size + length
    if length > _MAX_FRAME_ID_BYTES or end > len(data):
        raise DecodingError("the message is cut in its header", where=message.topic)
    return layout, seconds, nanoseconds, end


class RosTypes:
    """Decodes messages by the definitions found in their recording.

    Where a recording carries none (older .db3 files, schemas without text), ROS's own definitions stand in.
    """

    def __init__(self, definition: Callable[[str], Definition | None]) -> None:
        self._definition = definition
        self._stores: dict[tuple[str, str], Typestore] = {}

    def definition(self, schema: str) -> Definition | None:
        """The definition that the recording carries, or None where there is none, or one without text."""
        definition = self._definition(schema)
        return definition if definition is not None and not definition.is_blank else None

    def store(self, schema: str, encoding: str) -> Typestore:
        """The typestore of one schema and encoding. Raises DecodingError where its definition is ill-formed."""
        # One store for each schema: two definitions may disagree about a type that both embed.
        key = (schema, "ros1" if encoding == "ros1" else "cdr")
        if key not in self._stores:
            self._stores[key] = _make_store(schema, self.definition(schema), key[1])
        return self._stores[key]

    def decode(self, message: Message) -> Any:  # noqa: ANN401  # the class is generated from the recording's definition
        """The message as an object whose fields are numbers, strings, arrays or lists. Raises DecodingError."""
        store = self.store(message.schema, message.encoding)
        data = memoryview(message.data)
        try:
            if message.encoding == "ros1":
                return store.deserialize_ros1(data, message.schema)
            return store.deserialize_cdr(data, message.schema)
        except (SerdeError, KeyError) as error:
            own = "its definition"
            if self.definition(message.schema) is None:
                own = f"ROS's own definition of {message.schema}, and the recording has none"
            raise DecodingError(f"the message does not fit {own} ({error})", where=message.topic) from error


@lru_cache(maxsize=64)  # the recordings of a fleet share their definitions
def _make_store(schema: str, definition: Definition | None, encoding: str) -> Typestore:
    if definition is None:
        return known_types(encoding)
    store = registered(schema, types_of(schema, definition, encoding))
    _check_layout(schema, store)
    return store


def types_of(schema: str, definition: Definition | None, encoding: str) -> Types:
    """A schema and the types that it is made of: those of ROS where the recording does not define them.

    Raises DecodingError where the definition is ill-formed, or where nobody defines the schema.
    """
    ros_types = known_types(encoding).fielddefs
    if definition is not None:
        whole = parse_definition(schema, definition)
    elif schema in ros_types:
        whole = {schema: ([], ros_types[schema][1])}
    else:
        raise DecodingError("the recording does not define it", where=schema)
    due = list(whole)
    while due:
        for _, kind in whole[due.pop()][1]:
            name = _name_in(kind)
            if name is not None and name not in whole and name in ros_types:
                whole[name] = ([], ros_types[name][1])
                due.append(name)
    return whole


def _name_in(kind: tuple[Nodetype, Any]) -> str | None:
    """The type that a field is made of; None for numbers and strings."""
    node, value = kind
    if node == Nodetype.BASE:
        return None
    return str(value) if node == Nodetype.NAME else _name_in(value[0])


def registered(schema: str, types: Types) -> Typestore:
    """A typestore of these types, ready to decode one schema. Raises DecodingError where they are ill-formed."""
    store = get_typestore(Stores.EMPTY)
    try:
        store.register(types)
        store.get_msgdef(schema)
    except _PARSER_ERRORS as error:
        raise DecodingError(f"its definition cannot be parsed ({_one_line(error)})", where=schema) from error
    return store


def _check_layout(schema: str, store: Typestore) -> None:
    """Raises DecodingError where a well-known name has another definition than ROS's."""
    ros_types = known_types().fielddefs
    for name, (_, fields) in store.fielddefs.items():
        if name in ros_types and _layout(fields) != _layout(ros_types[name][1]):
            raise DecodingError(f"{name} is defined otherwise than by ROS", where=schema)


def _layout(fields: Any) -> list[tuple[str, Any]]:  # noqa: ANN401  # rosbags' parse trees
    # ROS 1's header has a counter, `seq`.
    return [(_ROS1_NAMES.get(name, name), kind) for name, kind in fields if name != "seq"]


def parse_definition(schema: str, definition: Definition) -> Types:
    """The types that a definition declares, as rosbags' typestores take them. Raises DecodingError.

    A typestore writes names and constants into Python code and runs it: names must be plain words, and constants, which
    no message holds, are left out.
    """
    if len(definition.data) > MAX_DEFINITION_BYTES:
        raise DecodingError(f"its definition of {len(definition.data)} bytes is not accepted", where=schema)
    try:
        parsed = _parse(schema, definition)
    except _PARSER_ERRORS as error:
        raise DecodingError(f"its definition cannot be parsed ({_one_line(error)})", where=schema) from error
    return {_plain(name, _TYPE_NAME): ([], [_plain_field(field) for field in parsed[name][1]]) for name in parsed}


def _parse(schema: str, definition: Definition) -> Any:  # noqa: ANN401  # rosbags' parse trees
    if definition.encoding not in {"ros2idl", "omgidl"}:
        return get_types_from_msg(definition.text, schema)
    parsed: dict[str, Any] = {}
    for part in definition.text.split(_IDL_RULER):
        _, line_end, text = part.partition("\n") if part.startswith("IDL: ") else ("", "\n", part)
        if line_end and text.strip():
            parsed.update(get_types_from_idl(text))
    return parsed


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())[:200]


def _plain_field(field: tuple[str, Any]) -> tuple[str, Any]:
    return _plain(field[0], _FIELD_NAME), _plain_type(field[1])


def _plain_type(kind: tuple[Nodetype, Any]) -> tuple[Nodetype, Any]:
    node, value = kind
    if node == Nodetype.NAME:
        return node, _plain(value, _TYPE_NAME)
    if node == Nodetype.BASE:
        return node, (_plain(value[0], _FIELD_NAME), int(value[1] or 0))
    return node, (_plain_type(value[0]), int(value[1]))


def _plain(name: object, pattern: re.Pattern[str]) -> str:
    if not isinstance(name, str) or not pattern.fullmatch(name):
        raise DecodingError(f"its definition uses an ill-formed name ({str(name)[:40]!r})")
    return name
