"""What a LiDAR and two cameras find and name: `python -m tests.benchmarks.two_cameras [--first 57000 --streets 18]`.

Pairs of cameras of the real drives (`AUDITOR_TEST_DATA`) are under the paper's facula, drawn anew for each of them, or
a bogus wall, for a second before the last frame or in all frames. Each is scanned by the command line into a store of
its own, nothing learnt. Printed are of so many recordings those that are found (exit code 1 or 4), those with a finding
that names just the attacked sensor, those whose incident does, and those that name another one; then the clean pairs,
and clean streets of two seconds, that are found.
"""

import argparse
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from auditor.lab.attacks.paper import draw_facula, draw_wall
from auditor.lab.simulation.conditions import CONDITIONS
from auditor.lab.simulation.drives import make_drive
from auditor.model.frames import Frame
from auditor.model.rig import LIDAR, Rig
from auditor.recordings import write_mcap
from tests.benchmarks.real_drives import frames as frames_of
from tests.benchmarks.several_lidars import FOUND, quietly
from tests.making.audits import ask

DRIVES = ("0009", "0001", "04")
WIDE = ((1, 3), (2, 4), (1, 4), (2, 3))
PLACES = 2
LASTS = ("a second", "all")
BASELINES_M = (0.12, 0.3, 0.54, 0.8)
INCIDENTS = """
    SELECT incident.grade, attacked, list_transform(attacked, lambda one: rig.sensors[one + 1].name) AS names
    FROM incidents AS incident JOIN rigs AS rig USING (rig_id)
"""

Attack = Callable[[Frame], Frame]


def pair_of(rig: Rig, whole: Sequence[Frame], cameras: tuple[int, int]) -> tuple[Rig, list[Frame]]:
    """The LiDAR and two cameras of a drive, renumbered."""
    numbers = {old: new for new, old in enumerate(cameras, start=1)}
    return rig.pair(*cameras), [
        replace(
            frame,
            images={numbers[s]: replace(image, sensor=numbers[s]) for s, image in frame.images.items() if s in numbers},
            presence={numbers.get(s, s): there for s, there in frame.presence.items() if s == LIDAR or s in numbers},
        )
        for frame in whole
    ]


def attacks_of(rig: Rig, seed: int) -> Iterator[tuple[str, int, Attack]]:
    """The kind, the attacked sensor and what becomes of a frame."""
    rng = np.random.default_rng(seed)
    wall = draw_wall(rng)
    yield "wall 2.5 m", LIDAR, lambda frame: replace(frame, cloud=frame.cloud and wall.apply(frame.cloud, rig))
    for camera in rig.cameras:
        facula = draw_facula(rng, camera.width_px, camera.height_px, "mild")

        def shone_on(frame: Frame, camera=camera.number, facula=facula) -> Frame:
            return replace(frame, images=frame.images | {camera: facula.apply(frame.images[camera])})

        yield "paper's facula", camera.number, shone_on


def scanned(rig: Rig, frames: Sequence[Frame], folder: Path) -> tuple[bool, list[dict[str, object]]]:
    """Whether a recording is found, and its incidents and alerts."""
    with TemporaryDirectory(dir=folder) as here:
        path, store = Path(here) / "drive.mcap", Path(here) / "audit"
        write_mcap(path, rig, frames)
        code = quietly("scan", str(path), "--store", str(store), "--pictures", "none")
        return code in FOUND, ask(store, INCIDENTS)


def count_attacks(folder: Path) -> None:
    """Print what is found and named of each attack that lasts so long."""
    found: dict[tuple[str, str], Counter[str]] = {}
    for number in DRIVES:
        whole_rig, stream = frames_of(number, all_cameras=True, colour=True)
        whole = list(stream)
        for seed, (cameras, _) in enumerate((cameras, place) for cameras in WIDE for place in range(PLACES)):
            rig, clean = pair_of(whole_rig, whole, cameras)
            for kind, sensor, attack in attacks_of(rig, seed):
                for lasts in LASTS:
                    first, end = (0, len(clean)) if lasts == "all" else (max(0, len(clean) - 11), len(clean) - 1)
                    frames = [attack(one) if first <= place < end else one for place, one in enumerate(clean)]
                    is_found, incidents = scanned(rig, frames, folder)
                    right = [one for one in incidents if one["names"] == [rig.name(sensor)]]
                    tally = found.setdefault((kind, lasts), Counter())
                    tally["recordings"] += 1
                    tally["found"] += is_found
                    tally["named"] += bool(right)
                    tally["named by an incident"] += any(one["grade"] == "incident" for one in right)
                    tally["another named"] += any(one["attacked"] and one not in right for one in incidents)
    for (kind, lasts), tally in sorted(found.items()):
        print(f"{kind}, {lasts}: {', '.join(f'{name} {count}' for name, count in tally.items())}", flush=True)


def count_clean(folder: Path, first: int, streets: int) -> None:
    """Print how many clean pairs of the real drives, and clean streets, are found."""
    found: Counter[str] = Counter()
    for number in DRIVES:
        whole_rig, stream = frames_of(number, all_cameras=True, colour=True)
        whole = list(stream)
        for cameras in combinations(range(1, whole_rig.n + 1), 2):
            found["real"] += 1
            found["real, found"] += scanned(*pair_of(whole_rig, whole, cameras), folder)[0]
    for seed in range(first, first + streets):
        condition = [*CONDITIONS][seed % len(CONDITIONS)]
        at_m = (BASELINES_M[seed % len(BASELINES_M)], 0.0)
        how = {"width_px": 800, "height_px": 260, "vehicle": seed, "positions_m": at_m, "condition": condition}
        street = make_drive(seed, 20, n_cameras=2, **how)
        found["streets"] += 1
        found["streets, found"] += scanned(street.rig, list(street.frames()), folder)[0]
    print(f"clean: {', '.join(f'{name} {count}' for name, count in found.items())}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--first", type=int, default=57000)
    parser.add_argument("--streets", type=int, default=18)
    options = parser.parse_args()
    with TemporaryDirectory() as folder:
        count_attacks(Path(folder))
        count_clean(Path(folder), options.first, options.streets)


if __name__ == "__main__":
    main()
