"""Decoders of messages by schema name: headers, pixels, points, calibrations and transforms."""

from collections.abc import Callable, Iterable, Mapping
from functools import cache
from itertools import chain

from auditor.recordings import schemas
from auditor.recordings.decoding import foxglove, kitti
from auditor.recordings.decoding.clouds import OldPointCloudDecoder, PointCloudDecoder
from auditor.recordings.decoding.geometry import RosCameraInfoDecoder, RosTransformsDecoder
from auditor.recordings.decoding.images import CompressedImageDecoder, RawImageDecoder
from auditor.recordings.decoding.interface import (
    CameraInfo,
    CloudDecoder,
    Decoder,
    DeepImageDecoder,
    FollowingDecoder,
    Header,
    ImageDecoder,
    PartDecoder,
    RepairingDecoder,
    Transform,
)
from auditor.recordings.decoding.points.compressed import CompressedCloudDecoder
from auditor.recordings.decoding.points.livox import LivoxDecoder
from auditor.recordings.decoding.points.ouster import OusterDecoder
from auditor.recordings.decoding.points.velodyne import VelodyneDecoder
from auditor.recordings.decoding.ros import RosTypes
from auditor.recordings.decoding.videos.tracks import RosVideoDecoder
from auditor.recordings.recording import Definition
from auditor.resources import entries_of

__all__ = [
    "CameraInfo",
    "CloudDecoder",
    "Decoder",
    "Decoders",
    "DeepImageDecoder",
    "FollowingDecoder",
    "Header",
    "ImageDecoder",
    "PartDecoder",
    "RepairingDecoder",
    "Transform",
    "decoder_table",
]

DecoderFactory = Callable[[RosTypes], Decoder]
"""Makes a decoder, given the ROS types of the recording (which decoders of other encodings ignore)."""

_ROS = frozenset({"cdr", "ros1"})
_FOXGLOVE = frozenset({"protobuf", "json"})

DECODERS: dict[str, tuple[frozenset[str], DecoderFactory]] = {
    schemas.IMAGE: (_ROS, RawImageDecoder),
    schemas.COMPRESSED_IMAGE: (_ROS, CompressedImageDecoder),
    schemas.POINT_CLOUD: (_ROS, PointCloudDecoder),
    schemas.POINT_CLOUD_OLD: (_ROS, OldPointCloudDecoder),
    schemas.CAMERA_INFO: (_ROS, RosCameraInfoDecoder),
    schemas.TRANSFORMS: (_ROS, RosTransformsDecoder),
    schemas.TRANSFORMS_OLD: (_ROS, RosTransformsDecoder),
    **dict.fromkeys(schemas.LIVOX, (_ROS, LivoxDecoder)),
    schemas.VELODYNE: (_ROS, VelodyneDecoder),
    **dict.fromkeys(schemas.OUSTER, (_ROS, OusterDecoder)),
    schemas.FFMPEG_PACKET: (_ROS, RosVideoDecoder),
    schemas.FOXGLOVE_VIDEO: (frozenset({"cdr"}), RosVideoDecoder),
    schemas.COMPRESSED_CLOUD: (_ROS, CompressedCloudDecoder),
    kitti.PICTURE: (frozenset({"png"}), lambda _: kitti.KittiPictureDecoder()),
    kitti.SCAN: (frozenset({"bin"}), lambda _: kitti.KittiScanDecoder()),
    kitti.CALIBRATION: (frozenset({"json"}), lambda _: kitti.KittiCalibrationDecoder()),
    kitti.TRANSFORMS: (frozenset({"json"}), lambda _: kitti.KittiTransformsDecoder()),
    **{schema: (_FOXGLOVE, factory) for schema, factory in foxglove.DECODERS.items()},
}
"""Built-in decoders by schema, with the message encodings they read.

The entry points group `auditor.decoders` adds to them: each has the name of its schema and gives such a pair.
"""


@cache
def decoder_table() -> dict[str, tuple[frozenset[str], DecoderFactory]]:
    """The built-in table and the decoders of other packages; built-in schemas cannot be replaced."""
    offered = {entry.name: entry.load() for entry in entries_of("auditor.decoders")}
    return offered | DECODERS


class Decoders:
    """The decoders of one recording, given a function that finds its definitions.

    `units_m` are by topic those of points which are in no metres, `metadata` what describes the sensors of packets.
    """

    def __init__(
        self,
        definition: Callable[[str], Definition | None],
        units_m: Mapping[str, float] | None = None,
        metadata: Mapping[str, str] | None = None,
    ) -> None:
        self._units_m = units_m or {}
        self._metadata = metadata or {}
        self.types = RosTypes(definition)
        self._made: dict[tuple[str, str], Decoder | None] = {}

    def of(self, schema: str, encoding: str) -> Decoder | None:
        """The decoder of a schema in an encoding, or None where there is none."""
        key = (schema, encoding)
        if key not in self._made:
            encodings, factory = decoder_table().get(schema, (frozenset(), None))
            made = factory(self.types) if factory and encoding in encodings else None
            if isinstance(made, PointCloudDecoder):
                made.units_m = self._units_m
            if isinstance(made, OusterDecoder | VelodyneDecoder):
                made.metadata = self._metadata
            self._made[key] = made
        return self._made[key]

    def in_any_encoding(self, schema: str) -> Decoder | None:
        """A decoder of a schema, whatever the encoding of its messages, or None where there is none."""
        _, factory = decoder_table().get(schema, (frozenset(), None))
        return factory(self.types) if factory else None

    @property
    def repairs(self) -> tuple[str, ...]:
        """What of the messages decoded so far had to be put right, a sentence each."""
        return tuple(chain.from_iterable(map(_repairs_of, self._made.values())))

    def image(self, schema: str, encoding: str) -> ImageDecoder | None:
        """The decoder, if it decodes images; else None."""
        decoder = self.of(schema, encoding)
        return decoder if decoder and decoder.kind == "image" else None

    def cloud(self, schema: str, encoding: str) -> CloudDecoder | None:
        """The decoder, if it decodes point clouds; else None."""
        decoder = self.of(schema, encoding)
        return decoder if decoder and decoder.kind == "cloud" else None


def _repairs_of(decoder: object) -> Iterable[str]:
    return decoder.repairs if isinstance(decoder, RepairingDecoder) else ()
