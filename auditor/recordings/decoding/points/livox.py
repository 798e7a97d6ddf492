"""CustomMsg of Livox's drivers (livox_ros_driver, livox_ros_driver2, livox_ros2_driver): points in metres, with times.

The points lie behind one another as they are in memory: they are not made objects one by one.
"""

import numpy as np
from numpy.typing import NDArray

from auditor.errors import DecodingError
from auditor.model.frames import Message
from auditor.recordings.decoding.clouds import PointCloudDecoder, finite, xyz_of
from auditor.recordings.decoding.ros import end_of_header
from auditor.safety.budget import MAX_POINTS

_POINT_BYTES = 19
_BEFORE_POINTS = 16
"""Bytes of timebase, point_num, lidar_id and rsvd."""

_CDR_START = 4


class LivoxDecoder(PointCloudDecoder):
    """CustomMsg in CDR, where a point takes 20 bytes, and as ROS 1 writes it, where it takes 19."""

    def xyz_m(self, message: Message) -> NDArray[np.float32]:
        """The finite points, (N, 3) float32 metres."""
        self._types.store(message.schema, message.encoding)  # raises where its definition is another one
        start, order = end_of_header(message)
        stride = _POINT_BYTES
        if message.encoding != "ros1":
            start += -(start - _CDR_START) % 8
            stride += -stride % 4
        start += _BEFORE_POINTS
        held = len(message.data) - start - 4
        count = int(np.frombuffer(message.data, f"{order}u4", 1, start)[0]) if held >= 0 else 0
        if held < 0 or count > MAX_POINTS or count * stride > held + stride - _POINT_BYTES:
            raise DecodingError(f"the cloud declares {count} points, and the message has {len(message.data)} bytes")
        points = np.zeros(count * stride, np.uint8)
        data = np.frombuffer(message.data, np.uint8, min(points.size, held), start + 4)
        points[: data.size] = data
        names, offsets = ["x", "y", "z"], [4, 8, 12]
        dtype = np.dtype({"names": names, "formats": [f"{order}f4"] * 3, "offsets": offsets, "itemsize": stride})
        return finite(xyz_of(points.view(dtype)))
