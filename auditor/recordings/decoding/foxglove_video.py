"""foxglove.CompressedVideo with H.264 inside."""

from typing import ClassVar, Literal

from auditor.errors import DecodingError
from auditor.model.frames import Message
from auditor.recordings.decoding.foxglove import FoxgloveMessages
from auditor.recordings.decoding.interface import Header
from auditor.recordings.decoding.ros import RosTypes
from auditor.recordings.decoding.video import Videos

_FORMAT = "h264"


class CompressedVideoDecoder(Videos):
    """foxglove.CompressedVideo."""

    kind: ClassVar[Literal["image"]] = "image"

    def __init__(self, types: RosTypes) -> None:
        super().__init__(self._h264)
        self._messages = FoxgloveMessages(types)

    def header(self, message: Message) -> Header:
        """The header, without decoding the rest."""
        return self._messages.header(message)

    def _h264(self, message: Message) -> bytes:
        values = self._messages.decode(message)
        if values["format"] != _FORMAT:
            raise DecodingError(f"the video format {values['format'][:20]!r} is not supported", where=message.topic)
        return bytes(values["data"])
