"""Videos in ROS messages: ffmpeg_image_transport_msgs/FFMPEGPacket and foxglove_msgs/CompressedVideo."""

from typing import ClassVar, Literal

from auditor.model.frames import Message
from auditor.recordings.decoding.interface import Header
from auditor.recordings.decoding.ros import RosTypes, read_header
from auditor.recordings.decoding.videos.tracks import VideoData, Videos


class RosVideoDecoder(Videos):
    """A topic of a video; both messages begin as one with a std_msgs/Header does."""

    kind: ClassVar[Literal["image"]] = "image"

    def __init__(self, types: RosTypes) -> None:
        super().__init__(self._video)
        self._types = types

    def header(self, message: Message) -> Header:
        """The header, without decoding the rest."""
        return read_header(message)

    def _video(self, message: Message) -> VideoData:
        packet = self._types.decode(message)
        declared = packet.encoding if hasattr(packet, "encoding") else packet.format
        return VideoData(declared, bytes(packet.data), read_header(message).stamp_ns or message.log_time_ns)
