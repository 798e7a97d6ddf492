"""What is found of things that appear in the point cloud of a real drive, as a new user scans it: nothing learnt.

    python -m tests.benchmarks.appearances --drives DATA [--lasts 1.0] [--lidar-alone]

Ghost cars and walls appear at several moments of each drive and last a second. Each attacked drive is scanned into a
store of its own, by the command line: printed are the attacked frames that name the LiDAR alone, the drives with an
incident that does, and those that are found at all, by kind; and of how many of them by free-space conflict. With
`--lidar-alone` the drives are recorded without their cameras; what is found of the clean ones is printed first.
"""

import argparse
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import replace
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory

from auditor.cli import run
from auditor.model.frames import Frame
from auditor.model.rig import LIDAR, Rig
from auditor.recordings import find_rigs, located, open_recording, survey, synchronise, write_mcap
from tests.making.audits import ask

KINDS = {
    "ghost, 20 points at 8 m": ("ghost", "--size", "20", "--range", "8"),
    "ghost, 60 points at 8 m": ("ghost", "--size", "60", "--range", "8"),
    "ghost, 120 points at 12 m": ("ghost", "--size", "120", "--range", "12"),
    "ghost, 200 points at 20 m": ("ghost", "--size", "200", "--range", "20"),
    "wall at 20 m": ("far-wall", "--size", "20"),
    "wall at 30 m": ("far-wall", "--size", "30"),
}
MOMENTS_S = {
    "kitti_raw_2011_09_26_drive_0009": (0.4, 1.3, 2.2, 2.8),
    "kitti_raw_2011_09_26_drive_0001": (0.2,),
    "kitti_odometry_04": (0.2,),
}
FOUND = (1, 4)
BY_THE_CHECK = "SELECT count(*) AS n FROM incidents WHERE evidence LIKE '%where its beams passed%'"


def quietly(*words: str) -> int:
    with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
        return run(words)


def tried(drive: Path, kind: Sequence[str], begins_s: float, lasts_s: float) -> Counter[str]:
    with TemporaryDirectory() as place:
        attacked, store = Path(place) / "attacked.mcap", Path(place) / "audit"
        when = ["--from", str(begins_s - 0.05), "--to", str(begins_s + lasts_s - 0.05)]
        assert quietly("attack", str(drive), str(attacked), "--on", "S_0", "--kind", *kind, *when) == 0
        code = quietly("scan", str(attacked), "--store", str(store), "--jobs", "1")
        rows = ask(store, "SELECT attacked, truth FROM verdicts JOIN truth USING (measurement_id, frame)")
        lit = [row for row in rows if row["truth"] == [0]]
        incidents = ask(store, "SELECT attacked FROM incidents")
        by_check = ask(store, BY_THE_CHECK)[0]["n"]
    return Counter(
        drives=1,
        frames=len(lit),
        named=sum(row["attacked"] == [0] for row in lit),
        incidents=any(row["attacked"] == [0] for row in incidents),
        found=code in FOUND,
        by_free_space=by_check > 0,
    )


def without_cameras(drive: Path, path: Path) -> Path:
    """A recording of the drive's LiDAR alone."""
    with open_recording(located(drive)) as recording:
        surveyed = survey(recording)
        rig = find_rigs(surveyed)[0]
        frames = (one for one in synchronise(recording, rig, surveyed) if isinstance(one, Frame))
        scans = (replace(one, images={}, presence={LIDAR: one.presence[LIDAR]}) for one in frames)
        write_mcap(path, Rig(rig.lidar, ()), scans)
    return path


def clean(drive: Path) -> str:
    """What a scan of a clean drive finds."""
    with TemporaryDirectory() as place:
        code = quietly("scan", str(drive), "--store", place, "--jobs", "1")
        kinds = ask(Path(place), "SELECT kind, count(*) AS n FROM verdicts GROUP BY kind ORDER BY kind")
    return f"exit code {code}, " + ", ".join(f"{row['kind']} {row['n']}" for row in kinds)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--drives", type=Path, required=True)
    parser.add_argument("--lasts", type=float, default=1.0, help="seconds")
    parser.add_argument("--lidar-alone", action="store_true", help="leave out the cameras")
    options = parser.parse_args()
    with TemporaryDirectory() as place:
        drives = {name: options.drives / name for name in MOMENTS_S}
        if options.lidar_alone:
            drives = {name: without_cameras(drive, Path(place) / f"{name}.mcap") for name, drive in drives.items()}
            for name, drive in drives.items():
                print(f"{name}, clean: {clean(drive)}", flush=True)
        try_all(drives, options.lasts)


def try_all(drives: Mapping[str, Path], lasts_s: float) -> None:
    for name, kind in KINDS.items():
        total: Counter[str] = Counter()
        for drive, moments in MOMENTS_S.items():
            for begins_s in moments:
                total += tried(drives[drive], kind, begins_s, lasts_s)
        print(
            f"{name}: {total['named']} of {total['frames']} frames named, {total['incidents']} of {total['drives']} "
            f"incidents, {total['found']} found, {total['by_free_space']} by free-space conflict",
            flush=True,
        )


if __name__ == "__main__":
    main()
