"""velodyne_msgs/VelodyneScan: the packets of a revolution, decoded by velodyne-decoder (the extra `lidar`).

A packet names its model, by which the angles of its lasers are known. The angles of an HDL-64E are each LiDAR's own:
its packets have no model there but one byte each of a text that goes round, in which they stand (HDL-64E S2 and S3
Users Manual, appendix E). They are gathered from a recording's first packets, and given to the decoder as metadata.
"""

import json
import warnings
from collections.abc import Iterable, Mapping
from itertools import islice
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
_FEW_PACKETS = 5
"""So many show whether the last bytes vary, as an HDL-64E's do."""

MOST_GATHERED = 3 * 4160
"""Packets of an HDL-64E that are looked at: its text takes 4,160, and begins anywhere."""

_LASERS = 64


class VelodyneDecoder(PointCloudDecoder):
    """One decoder a topic: it learns the model from the first packet."""

    def __init__(self, types: RosTypes) -> None:
        super().__init__(types)
        self._scans: dict[tuple[str, frozenset[int]], Any] = {}
        self.metadata: Mapping[str, str] = {}

    def xyz_m(self, message: Message) -> NDArray[np.float32]:
        """The points of the scan, (N, 3) float32 metres, x ahead."""
        velodyne = _velodyne()
        packets = self._types.decode(message).packets
        if not 0 < len(packets) <= _MOST_PACKETS:
            raise DecodingError(f"a scan of {len(packets)} packets is not accepted", where=message.topic)
        calibration = self.metadata.get(message.topic)
        models = frozenset(int(packet.data[_MODEL_BYTE]) for packet in packets) if calibration is None else frozenset()
        if len(models) > 1:
            raise DecodingError(
                "its packets are of several models, or of an HDL-64E without its calibration", where=message.topic
            )
        scans = self._scans.get((message.topic, models)) or velodyne.ScanDecoder(*_config(velodyne, calibration))
        self._scans[message.topic, models] = scans
        try:
            made = velodyne.PacketVector([velodyne.VelodynePacket(0.0, packet.data) for packet in packets])
            _, points = scans.decode(made)
        except (RuntimeError, ValueError, TypeError, IndexError) as error:
            problem = str(error).splitlines()[0][:100]
            raise DecodingError(f"its packets cannot be decoded ({problem})", where=message.topic) from error
        return finite(np.ascontiguousarray(points[:, :3]))


def _config(velodyne: Any, calibration: str | None) -> list[Any]:  # noqa: ANN401  # a module without types
    """What a decoder of scans is made with: nothing where the packets name their model."""
    if calibration is None:
        return []
    model = velodyne.Model.HDL64E_S2 if json.loads(calibration)["model"] == "S2" else velodyne.Model.HDL64E_S3
    return [velodyne.Config(model=model, calibration=velodyne.Calibration.from_string(calibration))]


def names_no_model(packets: Iterable[bytes]) -> bool:
    """True where the last bytes of the first packets vary: those of an HDL-64E."""
    return len({packet[-2:] for packet in islice(packets, _FEW_PACKETS)}) > 1


def calibration_of(packets: Iterable[bytes]) -> str | None:
    """The angles of an HDL-64E, as its packets have them; None where they do not, or without the extra."""
    try:
        velodyne = _velodyne()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a round that is no calibration; the next one may be
            status = velodyne.hdl64e.read_status_info(islice(packets, MOST_GATHERED))
        made = velodyne.hdl64e.status_info_to_calib_dict(status)
        kept = {key: made[key] for key in ("distance_resolution", "num_lasers", "lasers")}
        text = json.dumps({"model": status["Model"], **kept})
        _config(velodyne, text)
    except (DecodingError, ValueError, KeyError, IndexError, TypeError, RuntimeError, OverflowError):
        return None
    return text if [laser["laser_id"] for laser in kept["lasers"]] == list(range(_LASERS)) else None


def _velodyne() -> Any:  # noqa: ANN401  # a module without types
    try:
        import velodyne_decoder  # noqa: PLC0415  # an extra
    except ImportError as error:
        raise DecodingError("its packets need the package velodyne-decoder: install auditor[lidar]") from error
    return velodyne_decoder
