"""velodyne_msgs/VelodyneScan: the packets of a revolution, decoded by velodyne-decoder (the extra `lidar`).

A packet names its model, by which the angles of its lasers are known. The HDL-64E's angles are each LiDAR's own, and do
not stand in the message: it is not decoded.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from auditor.errors import DecodingError
from auditor.model.frames import Message
from auditor.recordings.decoding.clouds import PointCloudDecoder, finite
from auditor.recordings.decoding.ros import RosTypes

_MOST_PACKETS = 10_000
"""Of a scan: a VLS-128 sends 630 a revolution at 10 Hz."""

_MODEL_BYTE = 1205


class VelodyneDecoder(PointCloudDecoder):
    """One decoder a topic: it learns the model from the first packet."""

    def __init__(self, types: RosTypes) -> None:
        super().__init__(types)
        self._scans: dict[tuple[str, frozenset[int]], Any] = {}

    def xyz_m(self, message: Message) -> NDArray[np.float32]:
        """The points of the scan, (N, 3) float32 metres, x ahead."""
        velodyne = _velodyne()
        packets = self._types.decode(message).packets
        if not 0 < len(packets) <= _MOST_PACKETS:
            raise DecodingError(f"a scan of {len(packets)} packets is not accepted", where=message.topic)
        models = frozenset(int(packet.data[_MODEL_BYTE]) for packet in packets)
        if len(models) > 1:
            raise DecodingError("its packets are of several models", where=message.topic)
        scans = self._scans.setdefault((message.topic, models), velodyne.ScanDecoder())
        try:
            made = velodyne.PacketVector([velodyne.VelodynePacket(0.0, packet.data) for packet in packets])
            _, points = scans.decode(made)
        except (RuntimeError, ValueError, TypeError, IndexError) as error:
            what = str(error).splitlines()[0][:100]
            raise DecodingError(f"its packets cannot be decoded ({what})", where=message.topic) from error
        return finite(np.ascontiguousarray(points[:, :3]))


def _velodyne() -> Any:  # noqa: ANN401  # a module without types
    try:
        import velodyne_decoder  # noqa: PLC0415  # an extra
    except ImportError as error:
        raise DecodingError("its packets need the package velodyne-decoder: install auditor[lidar]") from error
    return velodyne_decoder
