"""Files that recorders split or recorded side by side, put together: which of the files found are one recording.

Names alone decide nothing: parts of one drive follow one another in time, files side by side cover the same time.
"""

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from auditor.errors import DecodingError, RecordingError
from auditor.recordings.content import UnprovenFile
from auditor.recordings.decoding import CameraInfo, Decoders
from auditor.recordings.formats.files import BAG, DB3, MCAP, FileRead, common_name, file_kind, part_name
from auditor.recordings.formats.found import DamageLog, Names, Span, span_over
from auditor.recordings.formats.mcap import McapRead
from auditor.recordings.formats.rosbag1 import BagRead
from auditor.recordings.formats.rosbag2 import Db3Read, journal_of
from auditor.recordings.formats.unpacking import Source, source_of
from auditor.recordings.location import Location
from auditor.recordings.parameters import DRIVE_PARTS
from auditor.recordings.rigs.calibrations import same_camera_info

_LOOKED_AT_NS = 2 * 10**9  # of a part's beginning, which shows its sensors: it bounds the work
_LOOKED_AT_BYTES = 8 * 2**20  # the same in bytes

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
                        info = decoder.camera_info(message)
                        if not info.is_blank:
                            infos.setdefault(message.topic, info)
                    has_transforms |= decoder is not None and decoder.kind == "transforms"
                if left < 0 or message.log_time_ns > until_ns:
                    break
        return Beginning(_sensors_seen(names), infos, has_transforms)

    @cached_property
    def sensors(self) -> frozenset[str]:
        """The topics of images and point clouds; by the summary of an MCAP file, so that no message is read."""
        names = Names()
        with suppress(RecordingError, OSError), self._read(names) as read:
            if isinstance(read, McapRead):
                read.learn_ending()
        return _sensors_seen(names) or self.beginning.sensors

    @contextmanager
    def _read(self, names: Names) -> Iterator[FileRead]:
        journal = journal_of(self.file) if file_kind(self.file) == DB3 else None
        source = source_of(UnprovenFile(self.file), UnprovenFile(journal) if journal else None)
        try:
            yield _READS[file_kind(self.file)](source, None, names, DamageLog())
        finally:
            source.close()


def _sensors_seen(names: Names) -> frozenset[str]:
    """Those of some topics that have images or point clouds."""
    decoders = Decoders(names.definitions.get)
    kinds = {topic.name: decoders.of(topic.schema, topic.encoding) for topic in names.topics.values()}
    return frozenset(name for name, known in kinds.items() if known is not None and known.kind in {"image", "cloud"})


_MOST_STREAMS = 8  # drives side by side of one name: it bounds the work


HasRig = Callable[[Location], bool]
"""Tells whether the sensors of a recording form a rig."""


def grouped(files: Sequence[Path], has_rig: HasRig) -> list[Location]:
    """The recordings that some .mcap, .bag and .db3 files are, each at the place of its first file."""
    order = {file: place for place, file in enumerate(files)}
    locations = [_located(drives) for drives in _side_by_side(_drives(files), has_rig)]
    return sorted(locations, key=lambda location: min(order[file] for file in files_of(location)))


def files_of(location: Location) -> Iterator[Path]:
    """The files of a recording that is no folder."""
    if not location.streams:
        yield location.path
    for stream in location.streams:
        yield from stream


@dataclass(eq=False)
class _Drive:
    """Files that follow one another; `number` is that of the last one."""

    parts: list[FileSummary]
    number: int

    @property
    def files(self) -> tuple[Path, ...]:
        """Its files, in order."""
        return tuple(part.file for part in self.parts)

    @property
    def readable(self) -> list[FileSummary]:
        """The parts whose time is known."""
        return [part for part in self.parts if part.span_ns is not None]

    @property
    def spans_ns(self) -> list[Span]:
        """The times that its parts cover, as far as they are known."""
        return [part.span_ns for part in self.parts if part.span_ns is not None]

    @property
    def span_ns(self) -> Span | None:
        """The time from its first to its last message."""
        spans = self.spans_ns
        return (spans[0][0], spans[-1][1]) if spans else None

    @property
    def end_ns(self) -> int:
        """The time of its last message; 0 where that is not known."""
        return self.span_ns[1] if self.span_ns else 0


def _drives(files: Sequence[Path]) -> list[_Drive]:
    """The files, those that are parts of one drive together."""
    series: dict[object, list[tuple[int, FileSummary]]] = {}
    for file in files:
        name = part_name(file)
        series.setdefault(name.key if name else file, []).append((name.number if name else 0, FileSummary(file)))
    return [drive for members in series.values() for drive in _chains(members)]


def _chains(members: Sequence[tuple[int, FileSummary]]) -> list[_Drive]:
    """The drives that files of one series are; what cannot be read belongs to the drive whose parts lie around it."""
    if len(members) == 1:
        return [_Drive([members[0][1]], members[0][0])]
    chains: list[_Drive] = []
    ending: defaultdict[int, list[_Drive]] = defaultdict(list)
    unreadable = [(number, part) for number, part in members if part.span_ns is None]
    readable = [(number, part) for number, part in members if part.span_ns is not None]
    for number, part in sorted(readable, key=lambda member: (member[0], member[1].span_ns or (0, 0))):
        near = (chain for last in range(number - 1 - DRIVE_PARTS.most_missing, number) for chain in ending[last])
        fitting = [chain for chain in near if _follows(part, number, chain)]
        if not fitting:
            chains.append(_Drive([part], number))
            ending[number].append(chains[-1])
            continue
        chain = max(fitting, key=lambda chain: (chain.number, chain.span_ns or (0, 0)))
        ending[chain.number].remove(chain)
        ending[number].append(chain)
        between = sorted((other for other in unreadable if chain.number < other[0] < number), key=lambda one: one[0])
        unreadable = [other for other in unreadable if other not in between]
        chain.parts += [*(other for _, other in between), part]
        chain.number = number
    return chains + [_Drive([part], number) for number, part in unreadable]


def _follows(part: FileSummary, number: int, drive: _Drive) -> bool:
    """True for the next part of a drive, of which a few before it may be missing."""
    missing = number - drive.number - 1
    if not 0 <= missing <= DRIVE_PARTS.most_missing or part.span_ns is None:
        return False
    return _follows_in_time(part.span_ns, drive.spans_ns, missing) and _is_of_the_same_vehicle(drive.parts[0], part)


def _follows_in_time(span: Span, before: Sequence[Span], missing: int) -> bool:
    """True where a part begins when the last one ended, or later by the time of the parts missing between them."""
    lengths_ns = [end_ns - begin_ns for begin_ns, end_ns in (*before, span)]
    shorter_ns = min(lengths_ns[-2:])
    overlap_ns = min(DRIVE_PARTS.most_overlap_ns, int(DRIVE_PARTS.most_overlap_share * shorter_ns))
    gap_ns = DRIVE_PARTS.most_gap_ns + int(missing * DRIVE_PARTS.most_lengths * max(lengths_ns))
    # Copies of one recording begin at the same time, also where one is cut behind its first message.
    return before[-1][0] < span[0] and before[-1][1] - overlap_ns <= span[0] <= before[-1][1] + gap_ns


def _is_of_the_same_vehicle(first: FileSummary, part: FileSummary) -> bool:
    """False where a part has other sensors, or a calibration of its own in which no camera is as it was."""
    before, here = first.beginning, part.beginning
    if before.sensors and here.sensors and not before.sensors & here.sensors:
        return False
    if not (before.is_calibrated and here.is_calibrated):
        return True
    common = before.camera_infos.keys() & here.camera_infos.keys()
    return any(same_camera_info(before.camera_infos[topic], here.camera_infos[topic]) for topic in common)


def _side_by_side(drives: Sequence[_Drive], has_rig: HasRig) -> list[list[_Drive]]:
    """The drives, those that recorded different sensors of one vehicle at the same time together."""
    beside: dict[tuple[Path, str], list[_Drive]] = {}
    for drive in drives:
        beside.setdefault((drive.files[0].parent, file_kind(drive.files[0])), []).append(drive)
    return [together for members in beside.values() for together in _merged(members, has_rig)]


def _merged(drives: Sequence[_Drive], has_rig: HasRig) -> list[list[_Drive]]:
    """The drives of one folder and kind."""
    if len(drives) == 1:
        return [[drives[0]]]
    recordings: list[list[_Drive]] = []
    running: list[list[_Drive]] = []
    for drive in sorted(drives, key=lambda drive: (drive.span_ns or (0, 0), drive.files)):
        begin_ns = (drive.span_ns or (0, 0))[0]
        # Drives that have ended cannot cover the time of this one or of a later one.
        running = [one for one in running if any(other.end_ns > begin_ns for other in one)]
        free = (one for one in running if len(one) < _MOST_STREAMS)
        fitting = next((one for one in free if all(_are_beside(drive, other) for other in one)), None)
        if fitting is not None and not all(has_rig(_located([one])) for one in (*fitting, drive)):
            fitting.append(drive)
        else:
            recordings.append([drive])
            running.append(recordings[-1])
    return recordings


def _are_beside(first: _Drive, other: _Drive) -> bool:
    if first.span_ns is None or other.span_ns is None:
        return False
    (begin, end), (other_begin, other_end) = first.span_ns, other.span_ns
    common_ns = min(end, other_end) - max(begin, other_begin)
    shorter_ns = min(end - begin, other_end - other_begin)
    if common_ns <= 0 or common_ns < DRIVE_PARTS.least_common_share * shorter_ns:
        return False
    sensors = [drive.readable[0].sensors if drive.readable else frozenset() for drive in (first, other)]
    return all(sensors) and not sensors[0] & sensors[1]


def _located(drives: Sequence[_Drive]) -> Location:
    """The drives as one recording; one of a single file is that file."""
    streams = tuple(sorted(drive.files for drive in drives))
    if len(streams) == 1 and len(streams[0]) == 1:
        return Location(streams[0][0])
    return Location(streams[0][0].with_name("+".join(map(common_name, streams))), streams)
