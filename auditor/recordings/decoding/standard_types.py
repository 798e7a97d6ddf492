"""ROS's own message types, for recordings that do not define them."""

from functools import cache

from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from auditor.recordings import schemas


@cache  # it compiles what serialises a type when it is first asked to
def known_types(encoding: str = "cdr") -> Typestore:
    """The definitions of ROS 1 (for the encoding 'ros1') or ROS 2; nothing is registered in it later."""
    if encoding != "ros1":
        return get_typestore(Stores.ROS2_HUMBLE)
    store = get_typestore(Stores.ROS1_NOETIC)
    for name in (schemas.TRANSFORMS, schemas.TRANSFORMS_OLD):
        store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", name))
    return store
