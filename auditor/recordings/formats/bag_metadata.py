"""The metadata.yaml of a rosbag2 folder: the names of the files that its recorder wrote, and nothing else of it.

It is untrusted and no parser of YAML reads it: the lines of one list are, within a bound, and a list that is written
otherwise says nothing. Its names are compared with those in the folder, and never opened.
"""

import re
from collections.abc import Iterator, Sequence
from pathlib import Path, PurePosixPath

from auditor.recordings.content import open_regular
from auditor.recordings.formats.unpacking import PACKED, kind_of

METADATA = "metadata.yaml"
_KINDS = frozenset({".db3", ".mcap"})
_MOST_BYTES = 4 * 2**20  # names of 40,000 parts
_HEAD = "rosbag2_bagfile_information:"
_LIST = re.compile(r"^ *relative_file_paths: *", re.MULTILINE)
_ITEMS = re.compile(r"\[([^\]]*)\]|\n((?: *- .*\n?)+)")
_NAME = re.compile(r"""'([^'"\\]+)'|"([^'"\\]+)"|([\w./][\w./ +=@~()-]*)""")


def lacks_its_files(folder: Path) -> bool:
    """True for a folder without recordings whose metadata.yaml is one of rosbag2, or empty as of a copy that ended."""
    text = _text_in(folder)
    return text is not None and (not text.strip() or _HEAD in text)


def listed_and_missing(files: Sequence[Path]) -> Iterator[str]:
    """A sentence for each file that the metadata.yaml beside some files lists, and that is not there.

    It must list one of the files, else it is of another recording.
    """
    for folder in dict.fromkeys(file.parent for file in files):
        listed = {_unpacked(name): name for name in _listed_in(folder)}
        if not listed.keys() & {_unpacked(file.name) for file in files}:
            continue
        there = {_unpacked(file.name) for file in folder.iterdir() if file.is_file()}
        yield from (f"{listed[one]} is missing, which {METADATA} lists" for one in listed if one not in there)


def listed_and_there(files: Sequence[Path]) -> Iterator[Path]:
    """Those of some files that the metadata.yaml beside them lists."""
    listed = {folder: {_unpacked(name) for name in _listed_in(folder)} for folder in {file.parent for file in files}}
    yield from (file for file in files if _unpacked(file.name) in listed[file.parent])


def _listed_in(folder: Path) -> Sequence[str]:
    """The names of recordings that a folder's metadata.yaml lists; none where it has none, or they cannot be read."""
    text = _text_in(folder) or ""
    begin = _LIST.search(text)
    items = _ITEMS.match(text, begin.end()) if begin else None
    if items is None:
        return ()
    raw = items[1].split(",") if items[1] is not None else [line.strip()[1:] for line in items[2].splitlines()]
    matches = [_NAME.fullmatch(one.strip()) for one in raw]
    names = [PurePosixPath(one[one.lastindex or 0]).name for one in matches if one]
    return [name for name in names if kind_of(Path(name)) in _KINDS] if len(names) == len(raw) else ()


def _text_in(folder: Path) -> str | None:
    """The text of a folder's metadata.yaml; None where there is none, or none that can be read."""
    try:
        with open_regular(folder / METADATA) as file:
            content = file.read(_MOST_BYTES + 1)
        return None if len(content) > _MOST_BYTES else content.decode().replace("\r\n", "\n")
    except (OSError, UnicodeDecodeError):
        return None


def _unpacked(name: str) -> str:
    """A name without the ending of a packed file."""
    return Path(name).stem if Path(name).suffix.lower() in PACKED else name
