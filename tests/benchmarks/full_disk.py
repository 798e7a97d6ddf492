"""Refreshes on a disk that gets full: `python -m tests.benchmarks.full_disk FOLDER [--count 40]`.

FOLDER is empty, on a small file system that nothing else writes to, such as 64 MB of memory (as root: `mount -t tmpfs
-o size=64m none FOLDER`). A store with a version in force and a new clean drive is copied there, and a file leaves so
much room, from none to more than a refresh takes. After each refresh one version is in force and whole, and the next
one, with room, completes what is left. Prints what was found, and how often.
"""

import argparse
import io
import os
import shutil
from collections import Counter
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from tempfile import TemporaryDirectory

from auditor.cli import run
from auditor.store.maintenance.verify import verify
from auditor.store.store import Store
from auditor.store.versions.history import calibrations_in_force
from tests.making.fleets import add_drive

ROOM = 300_000
"""Bytes: more than a refresh of the small fleet takes."""


def small_fleet(folder: Path) -> None:
    """Nine drives of three vehicles in a version in force, and one more."""
    store = Store.open(folder, create=True)
    for number in range(9):
        add_drive(store, f"drive {number}", seed=number, vehicle=f"car{number % 3}", day=number // 3)
    ended(["refresh", "--store", str(folder)])
    add_drive(store, "new", seed=80, vehicle="car1", day=8)


def ended(words: list[str]) -> tuple[int, str]:
    """The exit code of a command, and what it said."""
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        return run(words), err.getvalue()


def in_force(folder: Path) -> list[str]:
    """The calibrations that are in force."""
    return [one.calibration_id for one in calibrations_in_force(Store.open(folder))]


def full(folder: Path, room: int) -> None:
    """Write a file that leaves so many bytes."""
    free = os.statvfs(folder)
    with (folder / "fill").open("wb") as file:
        if count := max(free.f_bavail * free.f_frsize - room, 0):
            os.posix_fallocate(file.fileno(), 0, count)


def tried(fleet: Path, folder: Path, room: int) -> tuple[str, ...]:
    """What is found after a refresh with so much room, and after the next one."""
    store = shutil.copytree(fleet, folder / "audit")
    before = in_force(store)
    full(folder, room)
    code, said = ended(["refresh", "--store", str(store)])
    now, grave = in_force(store), verify(Store.open(store)).grave
    (folder / "fill").unlink()
    again, _ = ended(["refresh", "--store", str(store)])
    after, whole = in_force(store), ended(["store", "check", str(store)])[0]
    shutil.rmtree(store)
    return (
        f"exit {int(code)}",
        "that of before is in force" if now == before else f"{len(now)} new in force",
        f"{len(grave)} files not as written{', Traceback' * ('Traceback' in said)}",
        f"then exit {int(again)}, {'the new one in force' if after != before else 'that of before'}, check {whole}",
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--count", type=int, default=40)
    options = parser.parse_args()
    found: Counter[tuple[str, ...]] = Counter()
    with TemporaryDirectory() as place:
        small_fleet(Path(place) / "audit")
        for number in range(options.count):
            found[tried(Path(place) / "audit", options.folder, ROOM * number // options.count)] += 1
    for key, count in found.items():
        print(f"{count:3} {'; '.join(key)}")


if __name__ == "__main__":
    main()
