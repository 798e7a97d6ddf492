"""What one camera and the LiDAR find in time: walls that last a second, and what the comparison costs.

    python -m tests.benchmarks.lone_cameras --drives DATA --camera 4 [--walls 12] [--streets 6 --first 2000]

Walls of 2.5 m at 6 to 15 m and of 1 m at 10 m stand anywhere within three metres of straight ahead, as long as the
vehicle drives, and are put into ten frames in a row of a drive, at every third place: printed are the series with an
incident, those whose incident names the LiDAR alone, and the attacked frames that are raised, by thresholds learnt from
the other families and by the prior. Then clean drives with an incident, and the CPU time of a pair of pictures as a
ratio to one SGBM call on them.
"""

import argparse
import zlib
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from decimal import Decimal
from pathlib import Path
from statistics import median
from time import process_time

import numpy as np

from auditor.lab.attacks.paper import BogusWall
from auditor.lab.evaluation.sources import Street
from auditor.measurement import measure_stream, use_one_thread
from auditor.measurement.checks.in_time.parallax_conflict import parallax_conflicts
from auditor.measurement.disparity.half_resolution import grey
from auditor.measurement.disparity.lidar import lidar_view
from auditor.measurement.disparity.stereo import stereo_map, textured
from auditor.measurement.moment import Moment
from auditor.model.frames import Frame, SkippedFrame
from auditor.model.rig import LIDAR, Rig
from tests.benchmarks.clean_statistics import MATCHER, Source, alone, case_of, sources_of
from tests.benchmarks.incident_series import MEASURED_HZ, Drive, Tally, drives_of
from tests.benchmarks.scenes import Case, Scene

LASTS, EVERY = 10, 3
R = Decimal("0.01")
WIDE, NARROW = "wall 2.5 m at 6 to 15 m", "wall 1 m at 10 m"


def walls(count: int, seed: int) -> Iterator[tuple[str, BogusWall]]:
    rng = np.random.default_rng(seed)
    for number in range(count):
        lateral_m = rng.uniform(-3, 3)
        yield f"{WIDE} #{number}", BogusWall(rng.uniform(6, 15), lateral_m, seed=number)
        yield f"{NARROW} #{number}", BogusWall(10.0, lateral_m, width_m=1.0, seed=number)


def frames_of(source: Source, camera: int) -> tuple[Rig, list[Frame]]:
    with source.open() as drives:
        rig, lone = drives[0].rig, drives[0].rig.lone(camera)
        whole = [frame for frame in drives[0].frames if isinstance(frame, Frame)]
        there = [frame for frame in whole if frame.cloud is not None and camera in frame.images]
        return lone, [alone(frame, camera) if rig.n > 1 else frame for frame in there]


def cases_of(frames: Sequence[Frame], rig: Rig, attack: str = "") -> Iterator[Case]:
    for one in measure_stream(frames, rig, MATCHER):
        if not isinstance(one, SkippedFrame):
            yield case_of(one[0], rig, attack, (LIDAR,) if attack else ())


def scene_of(name: str, family: str, source: Source, camera: int, count: int) -> Scene:
    rig, frames = frames_of(source, camera)
    cases = list(cases_of(frames, rig))
    for attack, wall in walls(count, zlib.crc32(name.encode())):
        cases += cases_of([replace(one, cloud=wall.apply(one.cloud, rig)) for one in frames if one.cloud], rig, attack)
    return Scene(name, family, rig, "c", tuple(cases))


def tallied(drives: Sequence[Drive]) -> dict[str, Tally]:
    found: dict[str, Tally] = defaultdict(Tally)
    for drive in drives:
        for attack, of_sensors in drive.attacks.items():
            for start in range(1, max(len(drive.clean) - LASTS, 1) + 1, EVERY):
                cases = {
                    place: of_sensors[LIDAR,][place] for place in range(start, min(start + LASTS, len(drive.clean)))
                }
                found[attack.partition(" #")[0]].add(drive, cases, (LIDAR,))
    return found


def moments(frames: Sequence[Frame], rig: Rig) -> list[Moment]:
    return [
        Moment(one.stamp_ns, grey(one.images[1].pixels), lidar_view(one.cloud, rig, 1)) for one in frames if one.cloud
    ]


def cost(rig: Rig, frames: Sequence[Frame]) -> float:
    """The median ratio of a comparison's CPU time to that of SGBM on the same two pictures."""
    ratios = []
    for before, now in zip(found := moments(frames, rig), found[1:], strict=False):
        texture = textured(now.half), textured(before.half)
        begin = process_time()
        parallax_conflicts(now, before)
        compared = process_time()
        stereo_map(MATCHER, now.grey, before.grey, *texture)
        ratios.append((compared - begin) / (process_time() - compared))
    return median(ratios)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--drives", type=Path, help="the folder of the test data")
    parser.add_argument("--camera", type=int, default=4, help="of the drives")
    parser.add_argument("--walls", type=int, default=12)
    parser.add_argument("--streets", type=int, default=0)
    parser.add_argument("--first", type=int, default=2000)
    parser.add_argument("--frames", type=int, default=20)
    options = parser.parse_args()
    use_one_thread()
    streets = range(options.first, options.first + options.streets)
    sources = [
        (name, family, source, 1 if isinstance(source, Street) else options.camera)
        for name, family, source in sources_of(options.drives, streets, options.frames, 1)
    ]
    scenes = [scene_of(*source, options.walls) for source in sources]
    for how, prior in (("learnt from other families", False), ("by the prior", True)):
        drives = drives_of(scenes, (1,), R, prior=prior)
        print(how, *(f"  {attack}: {tally}" for attack, tally in tallied(drives).items()), sep="\n", flush=True)
        clean = [drive.judged(drive.series({}, MEASURED_HZ)) for drive in drives]
        print(
            f"  clean drives with an incident: {sum(any(v.in_incident for v in each) for each in clean)}/{len(clean)}"
        )
    for name, _, source, camera in sources[:3]:
        print(f"{name}: {cost(*frames_of(source, camera)):.2f} SGBM calls a pair of pictures")


if __name__ == "__main__":
    main()
