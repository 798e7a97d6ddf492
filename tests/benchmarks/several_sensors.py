"""Several sensors attacked at once: `python -m tests.benchmarks.several_sensors --into FOLDER`.

One light dazzles two cameras at one place of their pictures, as a laser far away does, two lights lie apart, or a wall
stands in the cloud beside a facula. Of the real drives (AUDITOR_TEST_DATA), or of streets, all frames are measured
clean and some attacked; each drive is judged by thresholds of the others and by the prior, with a LiDAR and four
cameras and with each three. What is in the folder is not measured again:

    python -m tests.benchmarks.several_sensors --into FOLDER [--streets 12 --first 6000] [--attacked 5]

Counted are frames: `named` name the attacked sensors and no other, `part` some of them, `innocent` another one.
"""

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import combinations

import numpy as np

from auditor.lab.attacks.paper import Facula, draw_facula, draw_wall
from auditor.model.frames import Frame
from auditor.model.rig import LIDAR, Rig
from auditor.model.verdict import VerdictKind
from tests.benchmarks.attack_kinds import measured
from tests.benchmarks.clean_statistics import options_of, scenes_of
from tests.benchmarks.rates import Judged, judge_all, misnamed, named

ALIKE = {
    "R 100 opaque": (100.0, 2000.0),
    "R 150 strong": (150.0, 400.0),
    "R 250 mild": (250.0, 255.0),
    "R 75 mild": (75.0, 255.0),
}
"""Radius (px of an image 1242 px wide) and strength (levels) of one light on two cameras."""
SETS = ((1, 2, 3, 4), *combinations((1, 2, 3, 4), 3))


def attacks_on(frame: Frame, rig: Rig, seed: int) -> Iterator[tuple[str, tuple[int, ...], Frame]]:
    """The frame with each pair of cameras, and each camera and the LiDAR, attacked; places are drawn anew."""
    rng = np.random.default_rng([seed, frame.number])
    cameras = {camera.number: camera for camera in rig.cameras}

    def drawn(number: int) -> Facula:
        return draw_facula(rng, cameras[number].width_px, cameras[number].height_px, "mild")

    def lit(faculas: dict[int, Facula]) -> Frame:
        changed = {number: facula.apply(frame.images[number]) for number, facula in faculas.items()}
        return replace(frame, images={**frame.images, **changed})

    for pair in combinations(cameras, 2):
        width, height = cameras[pair[0]].width_px, cameras[pair[0]].height_px
        for name, (radius, strength) in ALIKE.items():
            place = rng.uniform(0.12, 0.88) * width, rng.uniform(0.2, 0.9) * height
            yield f"one light, {name}", pair, lit(dict.fromkeys(pair, Facula(strength, radius * width / 1242, *place)))
        yield "two faculas apart", pair, lit({number: drawn(number) for number in pair})
    for number in cameras:
        assert frame.cloud is not None
        both = replace(lit({number: drawn(number)}), cloud=draw_wall(rng).apply(frame.cloud, rig))
        yield "a wall and a facula", (LIDAR, number), both


def row(cases: Sequence[Judged]) -> str:
    """How many frames, and how many of them by verdict and by what it names."""
    counts = Counter(_outcome(one) for one in cases)
    return f"{len(cases):4} frames: " + ", ".join(f"{outcome} {count}" for outcome, count in counts.most_common())


def _outcome(one: Judged) -> str:
    if one.robust.kind is not VerdictKind.ATTACKED:
        return one.robust.kind.value
    return "innocent" if misnamed(one.robust, one.case) else "named" if named(one.robust, one.case) else "part"


def main() -> None:
    options = options_of(__doc__, frames=8, attacked=5).parse_args()
    scenes = scenes_of(options, partial(measured, changes=attacks_on))
    for prior in (False, True):
        groups: dict[tuple[int, str], list[Judged]] = defaultdict(list)
        for cameras in SETS:
            for one in judge_all(scenes, cameras, options.r, prior=prior):
                groups[len(cameras), one.case.attack or "clean"].append(one)
        print("the prior" if prior else "learnt")
        for (cameras_there, attack), cases in groups.items():
            print(f"  {cameras_there} cameras, {attack:24} {row(cases)}")


if __name__ == "__main__":
    main()
