"""What two LiDARs find of each other: `python -m tests.benchmarks.several_lidars [--drives DATA] [--first 47000]`.

Streets are driven with a roof and a bumper LiDAR, with two at the front corners, or with two on the roof; real scans of
KITTI (--drives) are split by their rings into two LiDARs at one place. Clean recordings come first, then those in which
one of the two has a ghost or a wall: in one frame, in the last quarter, in all. Each is scanned by the command line
into a store of its own, first with nothing learnt, then by thresholds of clean streets of another family. Printed are
of so many recordings those with an incident, those whose incident names just the attacked LiDAR, those that are found
at all (exit code 1 or 4), and those that name an innocent one.
"""

import argparse
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from auditor.lab.attacks.kinds import OnLidar
from auditor.lab.attacks.paper import BogusWall
from auditor.lab.attacks.spoofing import GhostCar
from auditor.lab.simulation.streets import STYLES
from auditor.model.frames import Frame
from auditor.model.rig import Rig
from auditor.recordings import write_mcap
from tests.benchmarks.appearances import quietly
from tests.making.audits import ask
from tests.making.several_lidars import BUMPER, LEFT, REAR, RIGHT, ROOF, attacked, rig_of, split_by_rings, street

PAIRS = {"roof and bumper": (ROOF, BUMPER), "corners": (LEFT, RIGHT), "two on the roof": (ROOF, REAR)}
DRIVES = ("kitti_raw_2011_09_26_drive_0009", "kitti_raw_2011_09_26_drive_0001", "kitti_odometry_04")
KINDS: Mapping[str, OnLidar] = {
    "ghost, 20 points at 8 m": GhostCar(20, 8.0),
    "ghost, 60 points at 8 m": GhostCar(60, 8.0),
    "ghost, 120 points at 12 m": GhostCar(120, 12.0),
    "ghost, 200 points at 20 m": GhostCar(200, 20.0),
    "wall at 10 m": BogusWall(10.0, 0.0),
    "wall at 20 m": BogusWall(20.0, 0.0),
}
LASTS = {"one frame": 0.0, "the last quarter": 0.25, "all": 1.0}
LEARNT_FROM = 4
FRAMES = 20
FOUND = (1, 4)


class Drive(NamedTuple):
    """A clean recording of two LiDARs."""

    name: str
    rig: Rig
    frames: Sequence[Frame]


def told(store: Path, code: int, attacked_one: str) -> Counter[str]:
    """What is told of a recording by the names of its LiDARs: the larger cloud's is S_0, whatever the rig has first."""
    incidents = ask(store, "SELECT attacked_names FROM incidents WHERE grade = 'incident'")
    named = [{name.split(" ", 1)[1] for name in row["attacked_names"]} for row in incidents if row["attacked_names"]]
    return Counter(
        recordings=1,
        incidents=bool(incidents),
        named={attacked_one} in named,
        found=code in FOUND,
        innocent=any(one != {attacked_one} for one in named),
    )


def tried(drive: Drive, frames: Iterable[Frame], sensor: int | None, clean: Path | None) -> Mapping[str, Counter[str]]:
    """What is told of a recording with nothing learnt, and by thresholds of a store of clean ones."""
    with TemporaryDirectory() as place:
        path, store = Path(place) / "drive.mcap", Path(place) / "audit"
        write_mcap(path, drive.rig, frames, compression="none")
        code = quietly("scan", str(path), "--store", str(store), "--jobs", "1", "--pictures", "none")
        name = "" if sensor is None else drive.rig.name(sensor)
        of = {"prior": told(store, code, name)}
        if clean is not None:
            quietly("calibrate", str(clean), "--store", str(store))
            of["learnt"] = told(store, quietly("judge", "--store", str(store)), name)
    return of


def under_attack(drive: Drive, sensor: int, attack: OnLidar, share: float) -> list[Frame]:
    """The frames of a drive whose last ones are attacked, or one in their middle."""
    n = len(drive.frames)
    chosen = range(n - round(share * n), n) if share else range(n // 2, n // 2 + 1)
    return [
        attacked(frame, drive.rig, sensor, attack) if place in chosen else frame
        for place, frame in enumerate(drive.frames)
    ]


def report(title: str, drives: Sequence[Drive], clean: Path | None) -> None:
    total: dict[tuple[str, ...], Counter[str]] = {}
    for number, drive in enumerate(drives):
        of_clean = [(("clean", "", ""), None, drive.frames)]
        of_kinds = [
            ((kind, lasts, ""), (number + place) % 2, under_attack(drive, (number + place) % 2, attack, share))
            for place, (kind, attack) in enumerate(KINDS.items())
            for lasts, share in LASTS.items()
        ]
        for key, sensor, frames in [*of_clean, *of_kinds]:
            for by, counted in tried(drive, frames, sensor, clean).items():
                total.setdefault((*key[:2], by), Counter()).update(counted)
    print(title, flush=True)
    for (kind, lasts, by), of in total.items():
        print(
            f"  {kind:26} {lasts:17} {by:7} {of['incidents']:d} incidents, {of['named']:d} named, "
            f"{of['found']:d} found, {of['innocent']:d} innocent of {of['recordings']}",
            flush=True,
        )


def streets(pair: str, seeds: Iterable[int], frames: int = FRAMES) -> list[Drive]:
    styles = list(STYLES)
    return [
        Drive(
            f"{pair} {seed}",
            rig_of(*PAIRS[pair]),
            list(street(PAIRS[pair], seed, frames, style=styles[seed % len(styles)], standing=seed % 4 == 3)),
        )
        for seed in seeds
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--drives", type=Path, help="folder of the real drives")
    parser.add_argument("--first", type=int, default=47000, help="first street that is reported on")
    parser.add_argument("--streets", type=int, default=4, help="streets of each pair of LiDARs")
    options = parser.parse_args()
    if options.drives:
        drives = [Drive(name, *split_by_rings(options.drives / name, lambda rings: rings % 2 == 0)) for name in DRIVES]
        report("real drives, split by their rings", drives, None)
    for place, pair in enumerate(PAIRS):
        with TemporaryDirectory() as folder:
            paths = []
            for drive in streets(pair, range(46500 + 10 * place, 46500 + 10 * place + LEARNT_FROM)):
                paths.append(str(Path(folder) / f"{drive.name}.mcap"))
                write_mcap(Path(paths[-1]), drive.rig, drive.frames, compression="none")
            clean = Path(folder) / "clean"
            quietly("calibrate", *paths, "--store", str(clean), "--jobs", "1")
            first = options.first + options.streets * place
            report(f"streets, {pair}", streets(pair, range(first, first + options.streets)), clean)


if __name__ == "__main__":
    main()
