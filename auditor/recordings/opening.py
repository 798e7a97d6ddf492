"""Paths of a command line -> recordings: the table of readers, tried in order."""

import os
import re
import shlex
from collections.abc import Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import IO

from auditor.errors import RecordingError
from auditor.model.rig import Rig
from auditor.recordings.content import open_regular, unreadable
from auditor.recordings.formats.bag_metadata import METADATA, lacks_its_files
from auditor.recordings.formats.beginnings import is_text, kind_by_bytes, recordings_in_archive
from auditor.recordings.formats.datasets.argoverse import ArgoverseReader
from auditor.recordings.formats.datasets.dgp import DgpReader
from auditor.recordings.formats.datasets.kitti_360 import Kitti360Reader
from auditor.recordings.formats.datasets.kitti_odometry import KittiOdometryReader
from auditor.recordings.formats.datasets.kitti_raw import KittiReader
from auditor.recordings.formats.datasets.nuscenes import NuscenesReader
from auditor.recordings.formats.datasets.pandaset import PandaSetReader
from auditor.recordings.formats.mcap import McapReader
from auditor.recordings.formats.part_names import file_kind
from auditor.recordings.formats.rosbag import Ros1Reader, Ros2Reader, folder_files, open_streams
from auditor.recordings.location import Location, located
from auditor.recordings.parts import grouped
from auditor.recordings.recording import Reader, Recording
from auditor.recordings.rigs.discovery import search_rigs
from auditor.recordings.synchronisation.survey import survey
from auditor.resources import entries_of

_ROSBAG2 = "rosbag2"

READERS: tuple[tuple[str, Reader], ...] = (
    ("mcap", McapReader()),
    ("bag", Ros1Reader()),
    ("kitti", KittiReader()),
    ("kitti_odometry", KittiOdometryReader()),
    ("kitti_360", Kitti360Reader()),
    ("dgp", DgpReader()),
    ("argoverse", ArgoverseReader()),
    ("nuscenes", NuscenesReader()),
    ("pandaset", PandaSetReader()),
    (_ROSBAG2, Ros2Reader()),
)
"""Built-in readers, each with its name; those of the entry points group `auditor.readers` are tried after them."""

_DATASETS = frozenset(name for name, _ in READERS) - {"mcap", "bag", _ROSBAG2}
"""The readers of folders that hold no .mcap, .bag or .db3 file of theirs."""

_ALMOST = re.compile(r"\.(mcap|bag|db3)([.~_ (].*)?$", re.IGNORECASE)
"""Names of recordings, also hidden ones or with something behind: logs are so renamed, and would be overlooked."""

_UNPACKED_BY = {".gz": "gunzip", ".bz2": "bunzip2", ".xz": "unxz", ".lz4": "unlz4"}
"""Of endings of packed files that are not read the commands that unpack them."""

KINDS = (
    "an .mcap, .bag or .db3 file, a rosbag2 folder, "
    "or the folder of a drive of KITTI, DDAD, Argoverse 2, nuScenes or PandaSet"
)


@cache
def readers() -> tuple[tuple[str, Reader], ...]:
    """All readers, each with its name: the built-in table, then those of other packages."""
    return READERS + tuple((entry.name, entry.load()()) for entry in entries_of("auditor.readers"))


def reader_of(path: Path) -> Reader | None:
    """The first reader that recognises the path, or None."""
    return next((reader for _, reader in readers() if reader.detects(path)), None)


def format_of(path: Path) -> str | None:
    """The name of the first reader that recognises the path, or None."""
    return next((name for name, reader in readers() if reader.detects(path)), None)


def open_recording(where: Path | Location) -> Recording:
    """Open one recording, as a context manager.

    A folder that is not itself a recording may hold the files of one. Raises RecordingError where it is missing, empty,
    unreadable, of no known kind, or more than one.
    """
    location = located(where)
    try:
        if not location.first.exists():
            raise RecordingError("there is no such file or folder", where=location.first, remedy="check the path")
        if location.streams:
            return open_streams(location.path, location.streams)
        path = location.path
        reader = reader_of(path)
        if reader is not None:
            _refuse_empty(path)
            return reader.open(path)
        within = _put_together(list(_search(path))) if path.is_dir() else []
        if len(within) != 1:
            if not within:
                raise unknown_kind(path)
            raise RecordingError(f"it holds {len(within)} recordings", where=path, remedy=f"give {KINDS}")
        return open_recording(within[0])
    except OSError as error:
        raise unreadable(location.first, error) from error


def _refuse_empty(path: Path) -> None:
    if path.is_file() and path.stat().st_size == 0:
        raise RecordingError("the file is empty", where=path, remedy="record or copy it again")


@dataclass(frozen=True)
class LocatedRecordings:
    """The recordings of a command line, each once, in its order, and one error for each path that gave none.

    Files of searched folders that are recordings by their bytes alone, archives of recordings, and files that are named
    almost like recordings are errors as well. Of the last those of text are `notes` beside a recording, such as
    drive.mcap.json.
    """

    recordings: tuple[Location, ...]
    errors: tuple[RecordingError, ...]
    notes: tuple[Path, ...] = ()


def find_recordings(paths: Sequence[Path]) -> LocatedRecordings:
    """Find the recordings in files and folders; a folder that is not itself a recording is searched in order of names.

    Files that were recorded together are one recording, whether they are given or found. A path without a recording
    becomes a RecordingError in `errors`; the other paths are still searched.
    """
    places: dict[Path, None] = {}
    errors: dict[Path, RecordingError] = {}
    notes: dict[Path, None] = {}
    for path in paths:
        try:
            here = _recordings_at(path, errors)
            places.update(dict.fromkeys(here))
            for candidate, error in _overlooked(path, here):
                if error is None:
                    notes[candidate] = None
                else:
                    errors[candidate] = error
        except RecordingError as error:
            errors[path] = error
        except OSError as error:
            errors[path] = unreadable(path, error)
    recordings = []
    for location in _put_together(list(places)):
        try:
            if not location.streams and location.path in paths:
                _refuse_empty(location.path)
            recordings.append(location)
        except RecordingError as error:
            errors[location.path] = error
    in_order = dict.fromkeys((*paths, *errors))
    return LocatedRecordings(
        tuple(recordings), tuple(errors[path] for path in in_order if path in errors), tuple(notes)
    )


def _overlooked(folder: Path, recordings: Collection[Path]) -> Iterator[tuple[Path, RecordingError | None]]:
    """The files and folders below a searched one that are none of its recordings, and seem to be or to have been some.

    Each has its error, or None if it is text beside a recording. The files of a dataset's drive are looked at by their
    names alone: there are many, and its reader knows them.
    """
    datasets = {path for path in recordings if path.is_dir() and format_of(path) != _ROSBAG2}
    for place, within, names in os.walk(folder):
        here = Path(place)
        alone = METADATA in names and not within and not any(file_kind(Path(name)) for name in names)
        if alone and lacks_its_files(here):
            problem, remedy = f"a rosbag2 folder of which only {METADATA} is there", "copy it again, with its files"
            yield here, RecordingError(problem, where=here, remedy=remedy)
        looked_into = datasets.isdisjoint({here, *here.parents}) and not _is_hidden(here.relative_to(folder))
        for file in (here / name for name in sorted(names)):
            if _is_named_almost(file):
                yield file, _named_almost(file)
            elif looked_into and (held := _held(file, recordings)) is not None:
                yield file, held


def _is_named_almost(file: Path) -> bool:
    """True for a file that is no recording by its name, and is named like one."""
    name = file.name
    apple_double = name.startswith("._")
    return bool(_ALMOST.search(name)) and not apple_double and (_is_hidden(Path(name)) or reader_of(file) is None)


def _is_hidden(path: Path) -> bool:
    return any(part.startswith(".") for part in path.parts)


def _named_almost(file: Path) -> RecordingError | None:
    """The error for a file that is named almost like a recording; None for text beside one."""
    try:
        with open_regular(file) as opened:
            return _by_bytes(file, opened) or (None if is_text(opened) else _misnamed(file))
    except OSError as error:
        return unreadable(file, error)


def _held(file: Path, recordings: Collection[Path]) -> RecordingError | None:
    """The error for a file that is no recording by its name, and is one by its bytes, or an archive of some.

    A link to a recording that is read is none. What cannot be read is not told: it may be anything.
    """
    if _is_hidden(Path(file.name)) or file_kind(file):
        return None
    if file.is_symlink() and file.resolve() in {path.resolve() for path in recordings}:
        return None
    with suppress(OSError), open_regular(file) as opened:
        return _by_bytes(file, opened)
    return None


def _by_bytes(file: Path, opened: IO[bytes]) -> RecordingError | None:
    """The error for a recording under another name, or an archive of some; None for any other file. Raises OSError."""
    if kind := kind_by_bytes(opened):
        problem, remedy = f"by its bytes it is an {kind} file, and by its name none", f"rename it to end with {kind}"
        return RecordingError(f"{problem}: it was not read", where=file, remedy=f"{remedy}, or move it elsewhere")
    if names := recordings_in_archive(opened):
        problem = f"an archive of {names[0]}" + (f" and {len(names) - 1} more recordings" if names[1:] else "")
        return RecordingError(f"{problem}: it was not read", where=file, remedy="unpack it, or move it elsewhere")
    return None


def unknown_kind(where: Path | str, kinds: str = KINDS) -> RecordingError:
    """The error for a path or address that is no recording; of one that is packed it says what unpacks it."""
    name = Path(where)
    if name.suffix.lower() in _UNPACKED_BY and file_kind(name.with_suffix("")):
        remedy = f"unpack it: {_UNPACKED_BY[name.suffix.lower()]} {shlex.quote(name.name)}; .zst is read as it is"
        return RecordingError(f"a recording packed as {name.suffix} is not read", where=where, remedy=remedy)
    return RecordingError("this is not a recording of a known kind", where=where, remedy=f"give {kinds}")


def _misnamed(file: Path) -> RecordingError:
    if file.suffix.lower() in _UNPACKED_BY:
        return unknown_kind(file)
    return RecordingError(
        "it is named almost like a recording, and was not read", where=file, remedy="rename it, or move it elsewhere"
    )


def _put_together(paths: Sequence[Path]) -> list[Location]:
    """The recordings that some files and folders are; what belongs together stands at the place of the first."""
    together = grouped([path for path in paths if _may_be_beside(path)], _rigs_of)
    return list(dict.fromkeys(together.get(path) or Location(path) for path in paths))


def _may_be_beside(path: Path) -> bool:
    """Whether a recording may be one with others beside it: an .mcap, .bag or .db3 file, or a rosbag2 folder."""
    return bool(file_kind(path)) if path.is_file() else path.is_dir() and format_of(path) == _ROSBAG2


def _rigs_of(location: Location) -> Sequence[Rig]:
    try:
        with open_recording(location) as recording:
            return search_rigs(survey(recording)).rigs
    except RecordingError:
        return ()


def _recordings_at(path: Path, errors: dict[Path, RecordingError]) -> list[Path]:
    """The recordings at a path; what cannot be read inside a folder is one of the `errors`, and the others go on."""
    if not path.exists():
        raise RecordingError("there is no such file or folder", where=path, remedy="check the path")
    if _is_one(path):
        return [path, *_beside(path, errors)]
    if not path.is_dir():
        with open_regular(path) as opened:
            raise _by_bytes(path, opened) or unknown_kind(path)
    recordings = list(_search(path, errors))
    if not recordings:
        raise RecordingError("there is no recording in this folder", where=path, remedy=f"it should hold {KINDS}")
    return recordings


def _is_one(path: Path) -> bool:
    """True for a file or folder that is a recording.

    A folder of .db3 files without metadata.yaml may hold several: it is searched where they do not belong together.
    """
    if reader_of(path) is None:
        return False
    if format_of(path) != _ROSBAG2 or not path.is_dir() or (path / METADATA).exists():
        return True
    files = folder_files(path)
    return len(files) < 2 or len(set(grouped(files, _rigs_of).values())) == 1


def _beside(folder: Path, errors: dict[Path, RecordingError] | None = None) -> Iterator[Path]:
    """The recordings in the folder of a recording that are no part of it: it would pass over them in silence."""
    name = format_of(folder) if folder.is_dir() else None
    if name == _ROSBAG2:
        own = set(folder_files(folder))
        yield from (path for path in _search(folder, errors) if path not in own)
    elif name in _DATASETS:  # the files of other packages' folders are known to them alone
        yield from (path for path in sorted(folder.iterdir()) if file_kind(path) and path.is_file())


def _search(folder: Path, errors: dict[Path, RecordingError] | None = None) -> Iterator[Path]:
    """The recordings in a folder, and in those within. Raises OSError for what cannot be read, where it has no place
    among `errors`.
    """
    with os.scandir(folder) as entries:
        # Links are not followed: a link to a folder above would never end.
        children = sorted(Path(entry.path) for entry in entries if not entry.is_symlink() or entry.is_file())
    for child in children:
        if child.name.startswith("."):
            continue
        try:
            if _is_one(child):
                yield child
                yield from _beside(child, errors)
            elif child.is_dir():
                yield from _search(child, errors)
        except OSError as error:
            if errors is None:
                raise
            errors[child] = unreadable(child, error)
