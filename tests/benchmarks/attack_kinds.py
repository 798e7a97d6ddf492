"""How often each kind of attack on a camera is found: `python -m tests.benchmarks.attack_kinds --into FOLDER`.

Of the real drives (AUDITOR_TEST_DATA), or of streets, all frames are measured clean, and some of them with each camera
in turn under each kind. Each drive is judged by thresholds of the others, with all cameras and with three of them. What
is in the folder is not measured again:

    python -m tests.benchmarks.attack_kinds --into FOLDER [--streets 12 --first 6000] [--attacked 4] [--by-camera]

Counted are frames: `found` are not clean; `named` name the attacked cameras and no other; `others` name another
sensor, or take a fault of another one for the likeliest cause; `suspect` have a cause that may explain them.
"""

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from auditor.lab.attacks.catalogue import ON_CAMERA
from auditor.lab.attacks.kinds import AttackDraw
from auditor.measurement import FaultFeatures, measure
from auditor.model.frames import Frame
from auditor.model.rig import LIDAR, Rig
from auditor.model.verdict import Verdict, VerdictKind
from tests.benchmarks.clean_statistics import MATCHER, Source, case_of, kinds_of, options_of, scenes_of, spread
from tests.benchmarks.rates import Judged, judge_all, misnamed, named, not_clean
from tests.benchmarks.scenes import Case, Scene


class Kind(NamedTuple):
    """A kind of `catalogue`, with the strength of its facula and its size; None is the kind's own."""

    name: str
    kind: str
    strength: str = "mild"
    size: float | None = None


KINDS = (
    Kind("facula", "facula"),
    Kind("facula, R 75", "facula", size=75),
    Kind("spot, R 40, opaque", "spot"),
    *(Kind(colour, colour) for colour in ("blue", "green", "red")),
    *(Kind(f"{colour}, R 75", colour, size=75) for colour in ("blue", "green", "red")),
    Kind("infrared", "infrared"),
    Kind("veil, 60 levels", "veil"),
    Kind("veil, 30 levels", "veil", size=30),
    Kind("projected object", "projected"),
    Kind("stripes, half of the rows", "stripes"),
    Kind("shutter, duty 0.2", "shutter", size=0.2),
    Kind("shutter, duty 0.1", "shutter", size=0.1),
    Kind("shutter, duty 0.05", "shutter", size=0.05),
    Kind("acoustic blur, 15 px", "blur"),
    Kind("acoustic blur, 30 px", "blur", size=30),
    Kind("electromagnetic stripes", "electromagnetic"),
)

Changes = Callable[[Frame, Rig, int], Iterator[tuple[str, tuple[int, ...], Frame]]]
"""The kinds of change of a frame by a seed: the name, the attacked sensors, and the frame."""

SETS = ((1, 2, 3, 4), (1, 2, 3), (1, 2, 4))
"""The cameras that are judged by: all, and three. Of the real drives S_2 and S_4 are colour cameras."""


def attacks_on(frame: Frame, rig: Rig, seed: int) -> Iterator[tuple[str, tuple[int, ...], Frame]]:
    """The frame with each camera under each kind, drawn anew."""
    for camera in rig.cameras:
        for number, one in enumerate(KINDS):
            rng = np.random.default_rng([seed, frame.number, camera.number, number])
            attack = ON_CAMERA[one.kind](AttackDraw(rng, one.strength, one.size), camera)
            image = attack.apply(frame.images[camera.number])
            yield one.name, (camera.number,), replace(frame, images={**frame.images, camera.number: image})


def measured(source: Source, name: str, family: str, attacked: int, *, changes: Changes = attacks_on) -> Scene:
    """All frames of a source clean, and `attacked` of them, evenly spread, under every attack."""
    features, cases = FaultFeatures(), []
    with source.open() as [drive]:
        frames = [item for item in drive.frames if isinstance(item, Frame)]
        chosen = spread(frames, attacked)
        for frame in frames:
            clean, arrays = measure(frame, drive.rig, MATCHER)
            cases.append(case_of(replace(clean, fault_features=features.update(arrays)), drive.rig))
            if frame.number in chosen:
                cases += [
                    case_of(measure(changed, drive.rig, MATCHER)[0], drive.rig, kind, attacked_sensors)
                    for kind, attacked_sensors, changed in changes(frame, drive.rig, len(name))
                ]
        return Scene(name, family, drive.rig, kinds_of(frames[0]), tuple(cases))


def report(judged: Sequence[Judged], *, by_camera: bool) -> Iterator[str]:
    """A line for the clean frames, and one for each kind of attack, by the attacked camera's kind or by camera."""
    clean = [one for one in judged if not one.case.attack]
    raised = sum(one.robust.kind is not VerdictKind.CLEAN for one in clean)
    yield f"clean: {raised} of {len(clean)} not clean"
    groups: dict[tuple[str, str], list[Judged]] = defaultdict(list)
    for one in judged:
        if one.case.attack:
            [camera] = one.case.attacked
            kind = {"c": "colour", "g": "grey"}[one.scene.kinds[camera - 1]]
            groups[one.case.attack, f"S_{camera} {kind}" if by_camera else kind].append(one)
    order = {one.name: place for place, one in enumerate(KINDS)}
    for (name, where), cases in sorted(groups.items(), key=lambda item: (order[item[0][0]], item[0][1])):
        counts = {
            what: sum(is_so(one.robust, one.case) for one in cases)
            for what, is_so in (("found", not_clean), ("named", named), ("others", _others), ("suspect", _suspect))
        }
        yield f"{name:26} {where:10} {len(cases):4} frames: " + ", ".join(f"{k} {v:3}" for k, v in counts.items())


def _others(verdict: Verdict, case: Case) -> bool:
    if verdict.kind is VerdictKind.SUSPECT and verdict.causes:
        sensor = verdict.causes[0].sensor
        return sensor is not None and sensor not in case.attacked
    return misnamed(verdict, case)


def _suspect(verdict: Verdict, _case: Case) -> bool:
    return verdict.kind is VerdictKind.SUSPECT


def main() -> None:
    parser = options_of(__doc__, frames=8, attacked=4)
    parser.add_argument("--by-camera", action="store_true", help="a line for each camera")
    options = parser.parse_args()
    scenes = scenes_of(options, measured)
    for cameras in SETS:
        print(f"\nS_{LIDAR} and " + ", ".join(f"S_{camera}" for camera in cameras))
        print(*report(judge_all(scenes, cameras, options.r), by_camera=options.by_camera), sep="\n")


if __name__ == "__main__":
    main()
