"""What auditor finds outside its code: files of this computer, its own resources, and packages that add code."""

import re
import sys
from functools import cache
from importlib.metadata import EntryPoints, entry_points
from pathlib import Path

from auditor.errors import SettingError

_PACKAGE = Path(__file__).parent

_ADDRESS = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+:/(/)?")
"""How an address begins, such as s3://; of two slashes a Path keeps one, and a folder may be called so."""


def is_address(text: str) -> bool:
    """Whether a text is an address such as s3://bucket/x.mcap."""
    match = _ADDRESS.match(text)
    return match is not None and match[1] is not None


def local_path(path: str | Path) -> Path:
    """A path on this computer. Raises SettingError for an address such as s3://bucket/store."""
    text = str(path)
    address = _ADDRESS.match(text)
    if address and (address[1] or not Path(text).exists()):
        raise SettingError(
            "this is an address, and only files of this computer are read and written",
            where=text,
            remedy="copy it here or mount it as a folder, and give that path",
        )
    return Path(path)


def resource_folder(name: str) -> Path:
    """The folder `schemas`, `queries` or `reports`: inside the installed package, or at the top of a checkout."""
    installed = _PACKAGE / "data" / name
    return installed if installed.is_dir() else _PACKAGE.parent / name


PLUG_IN_GROUPS = ("auditor.readers", "auditor.decoders", "auditor.matchers")


def entries_of(group: str) -> EntryPoints:
    """What installed packages add to one of PLUG_IN_GROUPS; loading it runs their code."""
    return _entries_of(group, tuple(sys.path))


@cache
def _entries_of(group: str, _: tuple[str, ...]) -> EntryPoints:
    """As `entries_of`, of the packages in some folders: their metadata are files, which are read once."""
    return entry_points(group=group)


def plug_ins() -> dict[str, str]:
    """The installed packages that add readers, decoders or matchers, whose code is run: by name their versions."""
    entries = (entry for group in PLUG_IN_GROUPS for entry in entries_of(group))
    return dict(sorted((entry.dist.name, entry.dist.version) for entry in entries if entry.dist is not None))
