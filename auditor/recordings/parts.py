"""Files that recorders split or recorded side by side, put together: which of the files found are one recording.

Names alone decide nothing: parts of one drive follow one another in time, files side by side cover the same time. A
rosbag2 folder is whole by itself, and may lie beside others as a file does.
"""

import re
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

from auditor.errors import DecodingError, RecordingError
from auditor.model.rig import Rig
from auditor.recordings.content import UnprovenFile
from auditor.recordings.decoding import CameraInfo, Decoders
from auditor.recordings.formats.files import FileRead
from auditor.recordings.formats.found import DamageLog, Names, Span, span_over
from auditor.recordings.formats.mcap import McapRead
from auditor.recordings.formats.part_names import (
    BAG,
    DB3,
    MCAP,
    PartName,
    common_name,
    file_kind,
    part_name,
    shorter_length_ns,
)
from auditor.recordings.formats.rosbag import folder_files
from auditor.recordings.formats.rosbag1 import BagRead
from auditor.recordings.formats.rosbag2 import Db3Read, journal_of
from auditor.recordings.formats.unpacking import PACKED, Source, source_of
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


RigsOf = Callable[[Location], Sequence[Rig]]
"""Gives the rigs that the sensors of a recording form."""


def grouped(paths: Sequence[Path], rigs_of: RigsOf) -> Mapping[Path, Location]:
    """The recordings that some .mcap, .bag and .db3 files and rosbag2 folders are, by path."""
    folders = [path for path in paths if path.is_dir()]
    rigs_of = cache(rigs_of)  # of one file it is asked for beside each other one
    drives = [*_drives([path for path in paths if path not in folders]), *map(_of_folder, folders)]
    return {
        path: location
        for together in _side_by_side(drives, rigs_of)
        for location in [_located(together)]
        for drive in together
        for path in drive.paths
    }


@dataclass(eq=False)
class _Drive:
    """Files that follow one another; `last` is the name of the last one. `folder` is the rosbag2 folder they are of."""

    parts: list[FileSummary]
    last: PartName | None = None
    folder: Path | None = None

    @property
    def files(self) -> tuple[Path, ...]:
        """Its files, in order."""
        return tuple(part.file for part in self.parts)

    @property
    def paths(self) -> tuple[Path, ...]:
        """Its files, or its folder."""
        return (self.folder,) if self.folder else self.files

    @property
    def name(self) -> str:
        """What people call it."""
        return self.folder.name if self.folder else common_name(self.files)

    @property
    def sensors(self) -> frozenset[str]:
        """The topics of images and point clouds of its first part that can be read."""
        return next((part.sensors for part in self.parts if part.span_ns is not None), frozenset())

    @property
    def spans_ns(self) -> list[Span]:
        """The times that its parts cover, as far as they are known."""
        return [part.span_ns for part in self.parts if part.span_ns is not None]

    @property
    def span_ns(self) -> Span | None:
        """The time from its first to its last message; the parts between, which a folder has many of, are not read."""
        spans = (part.span_ns for part in self.parts)
        ends = (part.span_ns for part in reversed(self.parts))
        first, last = (next((one for one in found if one is not None), None) for found in (spans, ends))
        return (first[0], last[1]) if first and last else None

    @property
    def end_ns(self) -> int:
        """The time of its last message; 0 where that is not known."""
        return self.span_ns[1] if self.span_ns else 0


def _drives(files: Sequence[Path]) -> list[_Drive]:
    """The files, those that are parts of one drive together."""
    unnumbered: list[_Drive] = []
    series: dict[object, list[tuple[PartName, FileSummary]]] = {}
    for file in files:
        name, part = part_name(file), FileSummary(file)
        if name is None:
            unnumbered.append(_Drive([part]))
        else:
            series.setdefault(name.key, []).append((name, part))
    return unnumbered + [drive for members in series.values() for drive in _chains(members)]


def _of_folder(folder: Path) -> _Drive:
    return _Drive([FileSummary(file) for file in folder_files(folder)], folder=folder)


def _chains(members: Sequence[tuple[PartName, FileSummary]]) -> list[_Drive]:
    """The drives that files of one series are; what cannot be read belongs to the drive whose parts lie around it."""
    if len(members) == 1:
        return [_Drive([members[0][1]], members[0][0])]
    chains: list[_Drive] = []
    ending = _Ending()
    unreadable = [(name, part) for name, part in members if part.span_ns is None]
    readable = [(name, part) for name, part in members if part.span_ns is not None]
    for name, part in sorted(readable, key=lambda member: (member[0].number, member[1].span_ns or (0, 0))):
        chain = ending.followed_by(part, name)
        if chain is None:
            chain = _Drive([])
            chains.append(chain)
        between = sorted(
            (other for other in unreadable if chain.last and chain.last.number < other[0].number < name.number),
            key=lambda other: other[0].number,
        )
        unreadable = [other for other in unreadable if other not in between]
        chain.parts += [*(other for _, other in between), part]
        ending.move(chain, name)
    return chains + [_Drive([part], name) for name, part in unreadable]


class _Ending:
    """The drives of one series, by the number of their last part, and those to which a part was added of late."""

    def __init__(self) -> None:
        self._by_number: defaultdict[int, list[_Drive]] = defaultdict(list)
        self._lately: list[_Drive] = []

    def followed_by(self, part: FileSummary, name: PartName) -> _Drive | None:
        """The drive that a part goes on with; None where it begins one."""
        first = name.number - 1 - DRIVE_PARTS.most_missing
        near = [chain for number in range(first, name.number) for chain in self._by_number[number]]
        lately = self._lately if name.may_tell_time else ()
        fitting = [chain for chain in dict.fromkeys([*near, *lately]) if _follows(part, name, chain)]
        return max(fitting, key=lambda chain: (_counter(chain), chain.end_ns), default=None)

    def move(self, chain: _Drive, name: PartName) -> None:
        """A part of that name was added to a drive."""
        if chain.last is not None:
            self._by_number[chain.last.number].remove(chain)
        self._by_number[name.number].append(chain)
        self._lately = [*(other for other in self._lately if other is not chain), chain][-_MOST_STREAMS:]
        chain.last = name


def _counter(drive: _Drive) -> int:
    return 0 if drive.last is None or drive.last.is_dated else drive.last.number


def _follows(part: FileSummary, name: PartName, drive: _Drive) -> bool:
    """True for the next part of a drive: by its number, of which a few before may be missing, or by its time."""
    if part.span_ns is None or drive.last is None:
        return False
    before = drive.spans_ns
    missing = name.number - drive.last.number - 1
    counted = not name.is_dated and 0 <= missing <= DRIVE_PARTS.most_missing
    follows = (counted and _follows_in_time(part.span_ns, before, missing)) or (
        name.tells_time_after(drive.last, part.span_ns[0] - before[-1][0]) and _follows_in_time(part.span_ns, before, 0)
    )
    return follows and _is_of_the_same_vehicle(drive.parts[0], part)


def _follows_in_time(span: Span, before: Sequence[Span], missing: int) -> bool:
    """True where a part begins when the last one ended, or later by the time of the parts missing between them."""
    lengths_ns = [end_ns - begin_ns for begin_ns, end_ns in (*before, span)]
    shorter_ns = shorter_length_ns(before[-1], span)
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


def _side_by_side(drives: Sequence[_Drive], rigs_of: RigsOf) -> list[list[_Drive]]:
    """The drives, those that recorded different sensors of one vehicle at the same time together."""
    beside: dict[tuple[Path, str], list[_Drive]] = {}
    alone: list[list[_Drive]] = []
    for drive in drives:
        if drive.folder and drive.files[0].suffix.lower() in PACKED:
            alone.append([drive])  # its time would be known only once all of it is unpacked
        else:
            beside.setdefault((drive.paths[0].parent, file_kind(drive.files[0])), []).append(drive)
    return alone + [together for members in beside.values() for together in _merged(members, rigs_of)]


def _merged(drives: Sequence[_Drive], rigs_of: RigsOf) -> list[list[_Drive]]:
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
        beside = (one for one in free if all(_are_beside(drive, other) for other in one))
        alikest = (one for one in beside if all(_are_alikest(drive, other, drives) for other in one))
        fitting = next((one for one in alikest if _need_each_other(one, drive, rigs_of)), None)
        if fitting is not None:
            fitting.append(drive)
        else:
            recordings.append([drive])
            running.append(recordings[-1])
    return recordings


def _are_beside(first: _Drive, other: _Drive) -> bool:
    """True where two drives recorded different sensors at the same time."""
    if first.span_ns is None or other.span_ns is None:
        return False
    common_ns = _common_ns(first.span_ns, other.span_ns)
    least_ns = DRIVE_PARTS.least_common_share * shorter_length_ns(first.span_ns, other.span_ns)
    if common_ns <= 0 or common_ns < least_ns:
        return False
    return bool(first.sensors and other.sensors) and not first.sensors & other.sensors


def _common_ns(first: Span, other: Span) -> int:
    return min(first[1], other[1]) - max(first[0], other[0])


def _are_alikest(first: _Drive, other: _Drive, drives: Sequence[_Drive]) -> bool:
    """False where the sensors of another vehicle may stand in the place of either: names tell which belong together."""
    alike = len(_words(first) & _words(other))
    return not any(
        _is_of_another_vehicle(third, own)
        and _are_beside(third, partner)
        and len(_words(third) & _words(partner)) >= alike
        for own, partner in ((first, other), (other, first))
        for third in drives
    )


def _is_of_another_vehicle(third: _Drive, drive: _Drive) -> bool:
    """True where both recorded sensors of one name at the same time; copies of one recording begin together."""
    if third.span_ns is None or drive.span_ns is None or third.span_ns[0] == drive.span_ns[0]:
        return False
    return _common_ns(third.span_ns, drive.span_ns) > 0 and bool(third.sensors & drive.sensors)


def _words(drive: _Drive) -> frozenset[str]:
    """The words and numbers of its name."""
    return frozenset(re.findall(r"[^\W\d_]+|\d+", drive.name.lower()))


def _need_each_other(drives: Sequence[_Drive], drive: _Drive, rigs_of: RigsOf) -> bool:
    """Whether one of the drives has no rig, or cameras and a LiDAR are compared only where all are one recording."""
    if not all(rigs_of(_located([one])) for one in (*drives, drive)):
        return True
    apart = (_located(drives), _located([drive]))
    together = _located([*drives, drive])
    return not any(_compares_lidar(rigs_of(one)) for one in apart) and _compares_lidar(rigs_of(together))


def _compares_lidar(rigs: Sequence[Rig]) -> bool:
    return any(rig.cameras and rig.lidar for rig in rigs)


def _located(drives: Sequence[_Drive]) -> Location:
    """The drives as one recording; one of a single file or folder is that."""
    if len(drives) == 1 and len(drives[0].paths) == 1:
        return Location(drives[0].paths[0])
    drives = sorted(drives, key=lambda drive: drive.paths)
    path = drives[0].paths[0].with_name("+".join(drive.name for drive in drives))
    return Location(path, tuple(drive.files for drive in drives))
