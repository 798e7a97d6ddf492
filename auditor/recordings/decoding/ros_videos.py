"""Videos in ROS messages: ffmpeg_image_transport_msgs/FFMPEGPacket and foxglove_msgs/CompressedVideo."""

from typing import ClassVar, Literal

from auditor.model.frames import Message
from auditor.recordings.decoding.interface import Header
from auditor.recordings.decoding.ros import RosTypes, read_header
from auditor.recordings.decoding.video import Videos, refuse_other_video


class RosVideoDecoder(Videos):
    """A topic of H.264; both messages begin as one with a std_msgs/Header does."""

    kind: ClassVar[Literal["image"]] = "image"

    def __init__(self, types: RosTypes) -> None:
        super().__init__(self._h264)
        self._types = types

    def header(self, message: Message) -> Header:
        """The header, without decoding the rest."""
        return read_header(message)

    def _h264(self, message: Message) -> bytes:
        packet = self._types.decode(message)
        data = bytes(packet.data)
        refuse_other_video(packet.encoding if hasattr(packet, "encoding") else packet.format, data, message.topic)
        return data
