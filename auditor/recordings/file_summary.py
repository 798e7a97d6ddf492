"""What can be learnt quickly of a file: the time that it covers, its sensors, the calibrations at its beginning."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from auditor.errors import DecodingError, RecordingError
from auditor.recordings.content import UnprovenFile
from auditor.recordings.decoding import CameraInfo, Decoders
from auditor.recordings.formats.damage import DamageLog
from auditor.recordings.formats.files import FileRead
from auditor.recordings.formats.mcap.reader import McapRead
from auditor.recordings.formats.part_names import BAG, DB3, MCAP, file_kind
from auditor.recordings.formats.rosbag1 import BagRead
from auditor.recordings.formats.rosbag2.reader import Db3Read, journal_of
from auditor.recordings.formats.topics import Names, Span, span_over
from auditor.recordings.formats.unpacking import Source, source_of

_LOOKED_AT_NS = 2 * 10**9
"""Of a part's beginning, which shows its sensors: it bounds the work."""
_LOOKED_AT_BYTES = 8 * 2**20
"""The same in bytes."""


_READS: dict[str, Callable[[Source, None, Names, DamageLog], FileRead]] = {MCAP: McapRead, BAG: BagRead, DB3: Db3Read}


@dataclass(frozen=True, eq=False)
class Beginning:
    """The topics of images and point clouds, and the calibrations that lie at the beginning of a file."""

    sensors: frozenset[str]
    camera_infos: dict[str, CameraInfo]
    has_transforms: bool

    @property
    def is_calibrated(self) -> bool:
        """True where cameras have their calibration and places."""
        return bool(self.camera_infos) and self.has_transforms


class FileSummary:
    """One .mcap, .bag or .db3 file; nothing of it is read before it is asked for, nor twice."""

    def __init__(self, file: Path) -> None:
        self.file = file

    @cached_property
    def span_ns(self) -> Span | None:
        """The first and last log time; None where it has no message that can be read."""
        with suppress(RecordingError, OSError), self._read(Names()) as read:
            return read.span_ns() or span_over(message.log_time_ns for message in read.messages())
        return None

    @cached_property
    def beginning(self) -> Beginning:
        """What lies at its beginning, within the bounds of DRIVE_PARTS."""
        names, infos, has_transforms = Names(), dict[str, CameraInfo](), False
        decoders = Decoders(names.definitions.get)
        with suppress(RecordingError, OSError), self._read(names) as read:
            until_ns, left = None, _LOOKED_AT_BYTES
            for message in read.messages():
                until_ns = message.log_time_ns + _LOOKED_AT_NS if until_ns is None else until_ns
                left -= len(message.data)
                decoder = decoders.of(message.schema, message.encoding)
                with suppress(DecodingError):
                    if decoder is not None and decoder.kind == "camera_info":
                        infos.setdefault(message.topic, decoder.camera_info(message))
                    has_transforms |= decoder is not None and decoder.kind == "transforms"
                if left < 0 or message.log_time_ns > until_ns:
                    break
        return Beginning(_sensors(names), infos, has_transforms)

    @cached_property
    def sensors(self) -> frozenset[str]:
        """The topics of images and point clouds; by the summary of an MCAP file, so that no message is read."""
        names = Names()
        with suppress(RecordingError, OSError), self._read(names) as read:
            if isinstance(read, McapRead):
                read.learn_ending()
        return _sensors(names) or self.beginning.sensors

    @contextmanager
    def _read(self, names: Names) -> Iterator[FileRead]:
        journal = journal_of(self.file) if file_kind(self.file) == DB3 else None
        source = source_of(UnprovenFile(self.file), UnprovenFile(journal) if journal else None)
        try:
            yield _READS[file_kind(self.file)](source, None, names, DamageLog())
        finally:
            source.close()


def _sensors(names: Names) -> frozenset[str]:
    """Those of some topics that have images or point clouds."""
    decoders = Decoders(names.definitions.get)
    kinds = {topic.name: decoders.of(topic.schema, topic.encoding) for topic in names.topics.values()}
    return frozenset(name for name, known in kinds.items() if known is not None and known.kind in {"image", "cloud"})
