"""Addresses -> recordings: which objects of a bucket are recordings, by their names alone, and shards of them."""

import hashlib
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

from auditor.errors import RecordingError, SettingError
from auditor.pipeline.remote.addresses import Address, address_of
from auditor.pipeline.remote.object_store import find_object, list_objects
from auditor.recordings import LocatedRecordings, find_recordings
from auditor.recordings.formats.part_names import DB3, MCAP, common_name, file_kind, part_name
from auditor.recordings.location import Location, Remote, StoredObject
from auditor.recordings.opening import unknown_kind
from auditor.store.records import RecordingRecord

_METADATA = "metadata.yaml"
"""What makes a folder one recording, of rosbag2."""

MOST_PARTS = 32
"""Files of one series that are copied together: more are drives of a fleet, each by itself."""

_JOURNAL = re.compile(r"-(wal|journal|shm)$")

KINDS = "an .mcap, .bag or .db3 object, a rosbag2 folder, or a folder or pattern of them"


def find_all(given: Sequence[Path | Address]) -> LocatedRecordings:
    """The recordings at some paths, as `find_recordings`, and then those at addresses."""
    local = find_recordings([one for one in given if isinstance(one, Path)])
    remote = find_remote([one for one in given if isinstance(one, Address)])
    return LocatedRecordings((*local.recordings, *remote.recordings), (*local.errors, *remote.errors), local.notes)


def find_remote(addresses: Sequence[Address]) -> LocatedRecordings:
    """Find the recordings at some addresses, in their order; of a folder or a pattern in order of keys.

    They are not copied yet. Parts of a drive, by their names, are copied together, and then put together as files on
    disk are. Keys that are no recordings are not held.
    """
    locations: dict[str, Location] = {}
    errors = []
    for address in addresses:
        try:
            here = [_located(one) for one in _recordings_at(address)]
        except RecordingError as error:
            errors.append(error)
            continue
        locations.update((str(one), one) for one in here)
    return LocatedRecordings(tuple(locations.values()), tuple(errors))


def remote_of(record: RecordingRecord) -> Location:
    """A recording that was read from an object store, as it is there now. Raises RecordingError."""
    address = address_of(record.path)
    assert address is not None, "it was read from an object store"
    search = find_remote([address])
    if len(search.recordings) == 1:
        return search.recordings[0]
    folder = record.path.rpartition("/")[0]
    beside = find_remote(
        [file_address for name in record.files if (file_address := address_of(f"{folder}/{name}")) is not None]
    )
    if beside.errors or not beside.recordings:
        raise (*search.errors, *beside.errors)[0]
    objects = tuple(one for location in beside.recordings if location.remote for one in location.remote.objects)
    return _located(Remote(record.path, objects))


def parts_of(remote: Remote) -> Sequence[StoredObject]:
    """The files of a recording that by their names may be the parts of a drive, in their order; none where it is one.

    Of a file with a journal beside it, and of a folder of rosbag2, nobody knows by names what belongs together.
    """
    named = [(name, one) for one in remote.objects if (name := part_name(Path(one.address))) is not None]
    if len(named) < len(remote.objects) or len({name.key for name, _ in named}) > 1:
        return ()
    return [one for _, one in sorted(named, key=lambda part: part[0].number)]


def together(objects: Sequence[StoredObject]) -> Location:
    """Some parts of a drive, in their order, as one recording that is not copied yet."""
    return _located(Remote(_address_of_all(objects), tuple(objects)))


def _located(remote: Remote) -> Location:
    """A recording that is not copied yet: nothing is at its path, which says what its address says."""
    return Location(Path(remote.address), remote=remote)


def _recordings_at(address: Address) -> list[Remote]:
    """Raises RecordingError where there are none, and what listing raises."""
    single = None if address.is_pattern else find_object(address)
    if single is not None:
        if not file_kind(Path(single.address)):
            raise unknown_kind(single.address, KINDS)
        return [Remote(single.address, (single, *_journals_of(address, single)))]
    if address.scheme.startswith("http"):
        raise RecordingError("there is no such object", where=address, remedy="on the web, name one file an address")
    keys = _Keys()
    for stored_object in list_objects(address):
        if not address.is_pattern or address.matches(stored_object.address.removeprefix(f"{address.root}/")):
            keys.add(stored_object, whole_folders=not address.is_pattern)
    recordings = list(keys.recordings())
    if not recordings:
        raise RecordingError("there is no recording at this address", where=address, remedy=f"give {KINDS}")
    return recordings


def _journals_of(address: Address, single: StoredObject) -> Iterator[StoredObject]:
    if file_kind(Path(single.address)) == DB3:
        beside = Address(address.root, address.key + "-*")
        yield from (one for one in list_objects(beside) if _is_journal_of(one, single))


def _is_journal_of(journal: StoredObject, single: StoredObject) -> bool:
    return _JOURNAL.sub("", journal.address) == single.address != journal.address


@dataclass
class _Keys:
    """The objects that may be of recordings: by the folder of a rosbag2 recording, else by the series of their name."""

    folders: set[str] = field(default_factory=set)
    files: list[StoredObject] = field(default_factory=list)

    def add(self, stored_object: StoredObject, *, whole_folders: bool) -> None:
        """Keep an object, unless it is none of a recording's."""
        name = PurePosixPath(stored_object.address).name
        if name == _METADATA and whole_folders:
            self.folders.add(stored_object.address.removesuffix(f"/{_METADATA}"))
        elif name.startswith(".") or not file_kind(Path(_JOURNAL.sub("", name))):
            return
        self.files.append(stored_object)

    def recordings(self) -> Iterator[Remote]:
        """The recordings in order of their addresses."""
        bundles: dict[str, list[StoredObject]] = {}
        kinds = {folder: self._kind_in(folder) for folder in self.folders}
        for stored_object in self.files:
            bundles.setdefault(self._bundle(stored_object.address, kinds), []).append(stored_object)
        for common, objects in bundles.items():
            files = [one for one in objects if file_kind(Path(one.address))]
            if common in self.folders:
                yield Remote(common, tuple(objects))
            elif len(files) == 1 or _are_parts(files):
                yield Remote(_address_of_all(files), tuple(objects))
            else:
                for file in files:
                    beside = (one for one in objects if _is_journal_of(one, file))
                    yield Remote(file.address, (file, *beside))

    def _kind_in(self, folder: str) -> str:
        """The kind of the files of a rosbag2 folder; what else lies in it are recordings by themselves."""
        kinds = {file_kind(Path(one.address)) for one in self.files if one.address.rpartition("/")[0] == folder}
        return min(kinds & {DB3, MCAP}, default="")

    def _bundle(self, address: str, kinds: Mapping[str, str]) -> str:
        """What the objects of one recording have in common."""
        folder = address.rpartition("/")[0]
        own = _JOURNAL.sub("", address)
        if file_kind(Path(own)) in {"", kinds.get(folder)}:
            return folder
        name = part_name(Path(own))
        return f"{folder}/{name.series}*{name.kind}" if name is not None else own


def _are_parts(files: Sequence[StoredObject]) -> bool:
    """Whether files of one series may be the parts of a drive: what is numbered otherwise are drives of a fleet.

    Which of them are is decided as on disk, when they are copied.
    """
    numbers = sorted(name.number for file in files if (name := part_name(Path(file.address))) is not None)
    in_turn = [*range(numbers[0], numbers[0] + len(files))] if numbers else []
    return numbers == in_turn and numbers[:1] in ([0], [1]) and len(files) <= MOST_PARTS


def _address_of_all(files: Sequence[StoredObject]) -> str:
    """The address of a file; of several that of what their names have in common, as copies of them are named."""
    first = files[0].address
    if len(files) == 1:
        return first
    folder = first.rpartition("/")[0]
    return f"{folder}/{common_name([Path(file.address) for file in files])}"


_SHARD = re.compile(r"(\d{1,6})/(\d{1,6})")
_BYTES = 8


@dataclass(frozen=True)
class Shard:
    """Part `number` of `count`, which are counted from 0: a recording belongs to one of them, by its place alone."""

    number: int
    count: int

    def has(self, place: str) -> bool:
        """Whether the recording at a path or an address belongs to it."""
        digest = hashlib.sha256(place.encode("utf-8", "surrogateescape")).digest()
        return int.from_bytes(digest[:_BYTES]) % self.count == self.number


def shard_of(text: str) -> Shard:
    """The shard that a text such as 0/8 means. Raises SettingError."""
    numbers = _SHARD.fullmatch(text)
    shard = Shard(int(numbers[1]), int(numbers[2])) if numbers else Shard(0, 0)
    if shard.number >= shard.count:
        raise SettingError(f"{text!r} is no shard", where="--shard", remedy="of eight they are 0/8, 1/8, ... 7/8")
    return shard
