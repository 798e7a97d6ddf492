"""Fits the curves that weigh light thrown into a camera against dirt, drops and glare on its lens.

Of the real drives (AUDITOR_TEST_DATA), or of streets, some frames are measured with each camera in turn under lights
and under faults of its lens. What is in the folder is not measured again, and all of it is judged, each drive by
thresholds of other families:

    python -m tests.benchmarks.thrown_light --into FOLDER [--streets 14 --first 5000]

The frames that are findings, and that neither light of one colour nor light over a whole image explains, are fitted by
logistic regression: curves that are linear between knots and smooth, every kind as heavy as the others of its side, the
paper's faculas three times. Printed are the curves, and for some starts how many frames are on the wrong side, each
family left out of its fit.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from decimal import Decimal
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import torch

from auditor.identification.causes import CameraScores, seen_of
from auditor.identification.drive_level import for_clean_drive
from auditor.identification.evidence_parameters import CHANGED_AT, DARKER_AT, SATURATED_AT
from auditor.identification.naming import name_attacked
from auditor.identification.scores import normalised_scores
from auditor.lab.attacks.catalogue import ON_CAMERA
from auditor.lab.attacks.kinds import AttackDraw
from auditor.lab.attacks.paper import STRENGTHS, draw_facula
from auditor.lab.simulation.stray_light import SunSeen
from auditor.model.arrays import Flags, Floats
from auditor.model.frames import Frame
from auditor.model.rig import Camera, Rig
from tests.benchmarks.attack_kinds import KINDS, measured
from tests.benchmarks.benign import Glare, faults
from tests.benchmarks.clean_statistics import options_of, scenes_of
from tests.benchmarks.lasting_faults import on, patterns
from tests.benchmarks.rates import brightness_of, clean_frames, frames_of, system_of, thresholds_of
from tests.benchmarks.scenes import Scene

R = Decimal("0.01")
LENS = "lens: "
OF_LENS = ("mud", "water", "drops", "glare")
PAPER = ("facula", "paper's facula", *(f"facula, {strength}" for strength in STRENGTHS), "infrared")
ALL = (1, 2, 3, 4)
STARTS = (-0.5, -0.25, 0.0, 0.25, 0.5)
KNOTS = (
    CHANGED_AT,
    CHANGED_AT,
    DARKER_AT,
    SATURATED_AT,
)


def changes(frame: Frame, rig: Rig, seed: int) -> Iterator[tuple[str, int, Frame]]:
    """The frame with each camera under faults of its lens, and under every light, drawn anew."""
    for camera in rig.cameras:
        for name, what in changes_of(frame, camera, seed):
            yield name, camera.number, on(camera.number, what, rig)(frame)


def changes_of(frame: Frame, camera: Camera, seed: int) -> Iterator[tuple[str, object]]:
    """What changes the picture of a camera."""
    rng = np.random.default_rng([seed, frame.number, camera.number])
    size = camera.width_px, camera.height_px
    for fault in faults(seed + frame.number, *size):
        if not fault.together and any(word in fault.name for word in OF_LENS):
            yield LENS + fault.name, fault.what
    sun = SunSeen(rng.uniform(0, size[0]), rng.uniform(0, size[1] / 2), 1.0)
    yield f"{LENS}glare of the sun anywhere", Glare(sun, seed + 1)
    for one in KINDS:
        yield one.name, ON_CAMERA[one.kind](AttackDraw(rng, one.strength, one.size), camera)
    for strength in STRENGTHS:
        yield f"facula, {strength}", draw_facula(rng, *size, strength)
    for pattern in patterns():
        yield f"pattern, {pattern.title}", pattern


class Shown(NamedTuple):
    """What a changed camera shows in a finding."""

    kind: str
    family: str
    seen: CameraScores


def shown(scenes: Sequence[Scene], cameras: Sequence[int]) -> Iterator[Shown]:
    """The findings by these cameras that name the one that was changed, each drive judged by the others."""
    for scene in scenes:
        system = system_of(scene, cameras)
        others = [clean_frames(one, system) for one in scenes if one.family != scene.family]
        learnt, _ = thresholds_of(others, system, R)
        thresholds = for_clean_drive(learnt, system.sensor_checks, clean_frames(scene, system))
        cases = [case for case in scene.cases if len(case.attacked) == 1 and set(case.attacked) <= set(cameras)]
        statistics = frames_of(scene, system, cases).statistics_of(system.sensor_checks)
        z = normalised_scores(statistics, [thresholds.expected.get(check) for check in system.sensor_checks])
        verdicts = name_attacked(z, system, [frozenset()] * len(cases), thresholds.limit)
        light = brightness_of(cases, system)
        for place, (case, verdict) in enumerate(zip(cases, verdicts, strict=True)):
            brightness = {key: float(values[place]) for key, values in light.items()}
            seen = seen_of(verdict, z[place], statistics[place], system, brightness) if verdict.evidence else {}
            one = seen.get(case.attacked[0])
            if one is not None and not one.thrown:
                yield Shown(case.attack, scene.family, one)


def weights_of_knots(found: Sequence[Shown]) -> Floats:
    """(N, K) what each value weighs at the knots of its curve."""
    rows = [one.seen for one in found]
    columns: tuple[Floats, ...] = tuple(
        np.nan_to_num(np.array(values, dtype=np.float64))
        for values in (
            [one.removed for one in rows],
            [one.inconsistent for one in rows],
            np.log([one.darker for one in rows]),
            np.log1p([one.saturated_px for one in rows]),
        )
    )
    return np.concatenate(
        [
            np.stack([np.interp(values, at, row) for row in np.eye(len(at))], axis=1)
            for values, at in zip(columns, KNOTS, strict=True)
        ],
        axis=1,
    )


def fit(design: Floats, thrown: Flags, weight: Floats, smooth: float) -> tuple[Floats, float]:
    """The values at the knots, and the start."""
    X, y, w = (torch.tensor(one.astype(np.float64)) for one in (design, thrown, weight / weight.sum()))
    at, start = torch.zeros(X.shape[1], dtype=torch.float64), torch.zeros(1, dtype=torch.float64)
    parts = [at.requires_grad_(), start.requires_grad_()]
    optimiser = torch.optim.LBFGS(parts, max_iter=200, line_search_fn="strong_wolfe")

    def loss() -> torch.Tensor:
        optimiser.zero_grad()
        logits = X @ at + start
        total = (w * torch.nn.functional.binary_cross_entropy_with_logits(logits, y, reduction="none")).sum()
        for curve in torch.split(at, [len(knots) for knots in KNOTS]):
            bends = curve[2:] - 2 * curve[1:-1] + curve[:-2]
            total = total + smooth * ((bends**2).sum() + 0.05 * (curve**2).sum())
        total.backward()  # type: ignore[no-untyped-call]
        return total

    optimiser.step(loss)  # type: ignore[no-untyped-call]
    return at.detach().numpy(), float(start.item())


def print_fit(found: Sequence[Shown], heavy: float, smooth: float) -> None:
    """Print how many frames are on the wrong side by family left out, and the curves."""
    thrown = np.array([not one.kind.startswith(LENS) for one in found])
    families = np.array([one.family for one in found])
    often = Counter(one.kind for one in found)
    kinds = Counter(kind.startswith(LENS) for kind in often)
    weight = np.array(
        [(heavy if one.kind in PAPER else 1) / often[one.kind] / kinds[one.kind.startswith(LENS)] for one in found]
    )
    design = weights_of_knots(found)
    left_out = np.zeros(len(found))
    for family in set(families.tolist()):
        here = families == family
        at, start = fit(design[~here], thrown[~here], weight[~here], smooth)
        left_out[here] = design[here] @ at + start
    for start in STARTS:
        wrong = (left_out + start > 0) != thrown
        print(f"{start:+.2f}: {(wrong & ~thrown).sum()} of {(~thrown).sum()} of a lens are thrown light,", end=" ")
        print(f"{(wrong & thrown).sum()} of {thrown.sum()} lights are of a lens")
    at, start = fit(design, thrown, weight, smooth)
    ends = np.cumsum([0, *(len(knots) for knots in KNOTS)])
    for first, last in pairwise(ends.tolist()):
        middle = np.average(design[:, first:last] @ at[first:last], weights=weight)
        start += middle
        print(tuple(np.round(at[first:last] - middle, 2).tolist()))
    print("start", round(start, 2))


def main() -> None:
    scenes = scenes_of(options_of(__doc__, frames=8, attacked=2).parse_args(), partial(measured, changes=changes))
    print_fit(list(shown(scenes, ALL)), 3.0, 0.01)


if __name__ == "__main__":
    main()
