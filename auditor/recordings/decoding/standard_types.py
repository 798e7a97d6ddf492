"""The message types of ROS itself and of a few drivers, for recordings that do not define them."""

from functools import cache

from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from auditor.recordings import schemas

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
