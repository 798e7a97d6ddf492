"""What auditor finds outside its code: schemas, queries and reports, and the packages that add code of their own."""

import sys
from functools import cache
from importlib.metadata import EntryPoints, entry_points
from pathlib import Path

_PACKAGE = Path(__file__).parent


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
