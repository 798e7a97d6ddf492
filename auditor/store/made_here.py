"""Which stores this user made on this machine.

Whoever writes a store decides what is found: its calibrations and reviews count. A store that lies in a folder of logs
may have been planted there. So the command line takes the store of its working folder unasked only where it was made
here, as git does with the repositories of others.
"""

import json
import os
from contextlib import suppress
from pathlib import Path

from auditor.errors import StoreError


def remember_made(folder: Path) -> None:
    """Remember that a store was made in a folder just now; where nothing can be kept, it has to be named later on."""
    with suppress(OSError):
        _known().parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        with _known().open("a", encoding="utf-8") as known:
            known.write(json.dumps(_identity(folder)) + "\n")


def refuse_foreign(folder: Path) -> None:
    """Raises StoreError where a folder holds a store that was not made here."""
    with suppress(OSError):
        own = json.dumps(_identity(folder.resolve()))
        if own in _known().read_text(encoding="utf-8").splitlines():
            return
    raise StoreError(
        "this store was not made by you on this machine, and its calibrations and reviews decide what is found",
        where=folder,
        remedy=f"name it if you trust it (--store {folder}), or another one",
    )


def _identity(folder: Path) -> list[str | int]:
    """The path, device and inode of a folder: a copy has others."""
    status = folder.stat()
    return [str(folder), status.st_dev, status.st_ino]


def _known() -> Path:
    base = os.environ.get("XDG_STATE_HOME") or Path("~/.local/state").expanduser()
    return Path(base) / "auditor" / "stores"
