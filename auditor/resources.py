"""What auditor finds outside its code: schemas, queries and reports, and the packages that add code of their own."""

from importlib.metadata import entry_points
from pathlib import Path

_PACKAGE = Path(__file__).parent


def resource_folder(name: str) -> Path:
    """The folder `schemas`, `queries` or `reports`: inside the installed package, or at the top of a checkout."""
    installed = _PACKAGE / "data" / name
    return installed if installed.is_dir() else _PACKAGE.parent / name


PLUG_IN_GROUPS = ("auditor.readers", "auditor.decoders", "auditor.matchers")


def plug_ins() -> dict[str, str]:
    """The installed packages that add readers, decoders or matchers, whose code is run: by name their versions."""
    entries = (entry for group in PLUG_IN_GROUPS for entry in entry_points(group=group))
    return dict(sorted((entry.dist.name, entry.dist.version) for entry in entries if entry.dist is not None))
