"""Fits the curves of the likelihood of attack sets, and measures how true the posterior is that they give.

Reads what `python -m tests.benchmarks.clean_statistics --attacked` measured. Each scene is scored by thresholds of the
scenes of other families in its folder. The curves are linear between knots, ascending for a sensor of the set and
descending for the rest, and fitted by multinomial logistic regression; every kind of attack weighs as much, and clean
frames as much as half of all kinds, the share of each set in that being taken for its prior:

    python -m tests.benchmarks.likelihood FOLDER... [--without NAME] [--judge FOLDER...]

With --judge the scenes of those folders are judged by the curves that were fitted (those of one NAME alone where scenes
of it were left out), with three and with four cameras: of the frames that are findings at r = 1 %, by attack, how many
are named with at least the least probability, rightly and wrongly; then the expected calibration error and Brier
scores, of all and of the families that have enough names. Beside them stand the Brier scores of a constant and of the
margin, by how much z the named sensors lead, each mapped to how often that was right in the other families. Last, how
many clean frames have a ratio of 10, 100 and more: of true ratios no more than one in as many has.
"""

import argparse
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch

from auditor.identification import evidence_parameters, likelihood, parameters
from auditor.identification.drive_level import for_clean_drive
from auditor.identification.likelihood import (
    AttackSet,
    attack_sets,
    explained,
    log_likelihood_ratios,
    of_sensor,
    posteriors,
)
from auditor.identification.naming import attack_scores
from auditor.identification.paper import FEWEST_COMPARED
from auditor.identification.prior import effective_size
from auditor.identification.scores import normalised_scores
from auditor.identification.systems import System
from auditor.model.arrays import Floats, Integers
from auditor.model.rig import LIDAR
from tests.benchmarks.rates import ByOtherFamilies, clean_frames, frames_of, system_of
from tests.benchmarks.scenes import Scene, load

R = Decimal("0.01")
CAMERAS = (*combinations((1, 2, 3, 4), 3), (1, 2, 3, 4))
NOBODY: frozenset[int] = frozenset()
OWN_AT = np.array(evidence_parameters.OWN_AT)
REST_AT = np.array(evidence_parameters.REST_AT)
CLEAN_WEIGHT = 4.0
SMOOTH = 1e-3
BINS = 10
SURE = 0.9
FEWEST_NAMES = 100
ROUNDING = 1e-6


@dataclass(frozen=True, eq=False)
class Scored:
    """Frames of one attack in one scene: scores z (F, M), and the limit of a finding."""

    scene: Scene
    system: System
    attack: str
    attacked: AttackSet
    z: Floats
    limit: float


def scored(scenes: Sequence[Scene], cameras: Sequence[int]) -> Iterator[Scored]:
    """All frames of some scenes by these cameras and the LiDAR."""
    thresholds = ByOtherFamilies(scenes, cameras, R)
    for scene in scenes:
        system = system_of(scene, cameras)
        learnt, _ = thresholds.of(scene.family, system)
        own = for_clean_drive(learnt, system.sensor_checks, clean_frames(scene, system))
        groups = defaultdict(list)
        for case in scene.cases:
            if set(case.attacked) <= set(system.sensors):
                groups[case.attack, case.attacked].append(case)
        for (attack, attacked), cases in groups.items():
            statistics = frames_of(scene, system, cases).statistics_of(system.sensor_checks)
            z = normalised_scores(statistics, [own.expected.get(check) for check in system.sensor_checks])
            yield Scored(scene, system, attack, attacked, z, own.limit)


def basis(values: Floats, knots: Floats) -> Floats:
    """(..., K) weights of the knots that linear interpolation at these values has."""
    return np.stack([np.interp(values, knots, row) for row in np.eye(len(knots))], axis=-1)


class Curves(torch.nn.Module):
    """The curves: of a camera of the set, of the LiDAR, of the rest; and what each sensor after the first adds."""

    def __init__(self) -> None:
        super().__init__()
        knots = (OWN_AT, OWN_AT, REST_AT)
        self.steps = torch.nn.ParameterList([torch.zeros(len(at)) for at in knots])
        self.starts = torch.nn.Parameter(torch.tensor([-3.0, -3.0]))
        self.several = torch.nn.Parameter(torch.tensor(-1.0))

    def values(self) -> list[torch.Tensor]:
        camera, lidar, rest = (
            torch.cat([torch.zeros(1), torch.cumsum(torch.nn.functional.softplus(one[1:] - 2), 0)])
            for one in self.steps
        )
        return [self.starts[0] + camera, self.starts[1] + lidar, -rest]

    def roughness(self) -> torch.Tensor:
        total = torch.zeros(())
        for one, at in zip(self.values(), (OWN_AT, OWN_AT, REST_AT), strict=True):
            slopes = (one[1:] - one[:-1]) / torch.tensor(np.diff(at), dtype=torch.float32)
            total = total + ((slopes[1:] - slopes[:-1]) ** 2).sum()
        return total


@dataclass(frozen=True, eq=False)
class Design:
    """N frames, H sets: (N, H, K) weights of the knots, (N,) true sets and weights, (H,) sensors and priors."""

    camera: torch.Tensor
    lidar: torch.Tensor
    rest: torch.Tensor
    several: torch.Tensor
    true: torch.Tensor
    weight: torch.Tensor
    prior: torch.Tensor


def design(frames: Sequence[Scored]) -> Design:
    """The frames of systems that have the same number of sets."""
    in_family: Counter[tuple[str, str, int]] = Counter()
    families = defaultdict(set)
    for one in frames:
        in_family[one.scene.family, one.attack, len(one.system.sensors)] += len(one.z)
        families[one.attack].add(one.scene.family)
    rows, true, weight = [], [], []
    for one in frames:
        sets = attack_sets(one.system, NOBODY, one.system.sensors)
        if one.attacked not in sets:
            continue
        seen = [explained(one.z, one.system, NOBODY, attacked) for attacked in sets]
        nothing = np.zeros((len(one.z), len(OWN_AT)))
        camera = [sum((basis(v, OWN_AT) for s, v in e.own.items() if s != LIDAR), nothing) for e in seen]
        lidar = [sum((basis(v, OWN_AT) for s, v in e.own.items() if s == LIDAR), nothing) for e in seen]
        rows.append([np.stack(part, axis=1) for part in (camera, lidar, [basis(e.rest, REST_AT) for e in seen])])
        true += [sets.index(one.attacked)] * len(one.z)
        kind = CLEAN_WEIGHT if not one.attack else 1.0
        each = kind / in_family[one.scene.family, one.attack, len(one.system.sensors)] / len(families[one.attack])
        weight += [each] * len(one.z)
    weights, answers = np.array(weight) / sum(weight), np.array(true)
    sets = attack_sets(frames[0].system, NOBODY, frames[0].system.sensors)
    camera_part, lidar_part, rest_part = (
        torch.tensor(np.concatenate(part), dtype=torch.float32) for part in zip(*rows, strict=True)
    )
    return Design(
        camera_part,
        lidar_part,
        rest_part,
        torch.tensor([max(len(one) - 1, 0) for one in sets], dtype=torch.float32),
        torch.tensor(answers),
        torch.tensor(weights, dtype=torch.float32),
        torch.tensor(np.log(_shares(sets, answers, weights) + 1e-6), dtype=torch.float32),
    )


def _shares(sets: Sequence[AttackSet], answers: Integers, weights: Floats) -> Floats:
    """(H,) the share of the weights that each set has, those of one kind taken for equal."""
    kinds = [(len(one), one == (LIDAR,)) for one in sets]
    whole: Counter[tuple[int, bool]] = Counter()
    for answer, value in zip(answers.tolist(), weights.tolist(), strict=True):
        whole[kinds[answer]] += value
    return np.array([whole[kind] / kinds.count(kind) for kind in kinds])


def fit(designs: Sequence[Design]) -> evidence_parameters.Likelihood:
    """The parameters with the curves that make these frames' sets likeliest."""
    curves = Curves()
    optimiser = torch.optim.LBFGS(curves.parameters(), max_iter=300, line_search_fn="strong_wolfe")

    def loss() -> torch.Tensor:
        optimiser.zero_grad()
        total = SMOOTH * curves.roughness()
        camera, lidar, rest = curves.values()
        for one in designs:
            logits = (
                one.camera @ camera + one.lidar @ lidar + one.rest @ rest + curves.several * one.several + one.prior
            )
            chosen = torch.log_softmax(logits, 1)[torch.arange(len(one.true)), one.true]
            total = total - (one.weight * chosen).sum()
        total.backward()  # type: ignore[no-untyped-call]
        return total

    optimiser.step(loss)  # type: ignore[no-untyped-call]
    camera, lidar, rest = (tuple(round(v, 2) for v in one.tolist()) for one in curves.values())
    return replace(
        evidence_parameters.LIKELIHOOD,
        of_camera=camera,
        of_lidar=lidar,
        of_rest=rest,
        of_several=round(curves.several.item(), 2),
    )


class Named(NamedTuple):
    """A frame's likeliest set of sensors: its probability, 0 where it is no finding, and its margin (z)."""

    frames: Scored
    p: float
    best: AttackSet
    margin: float

    @property
    def right(self) -> bool:
        """Whether these sensors are attacked, and no others."""
        return self.best == self.frames.attacked


def judged(frames: Sequence[Scored]) -> Iterator[Named]:
    """What each frame is named."""
    for one in frames:
        sets = attack_sets(one.system, NOBODY, one.system.sensors)
        findings = attack_scores(one.z, one.system, [NOBODY] * len(one.z)) > one.limit
        ratios = log_likelihood_ratios(one.z, one.system, NOBODY, sets)
        chances = posteriors(ratios, sets, len(one.system.sensors))
        for z, finding, row in zip(one.z, findings, chances, strict=True):
            best = 1 + int(np.argmax(row[1:]))
            yield Named(one, float(row[best]) if finding else 0.0, sets[best], margin(z, one, sets[best]))


def margin(z: Floats, one: Scored, named: AttackSet) -> float:
    """By how much the strongest sensor's z exceeds that of the next which is not named, or the limit."""
    own = {s: np.nanmax(z[of_sensor(one.system, NOBODY, s)], initial=-np.inf) for s in one.system.sensors}
    return float(max(own.values()) - max([one.limit, *(value for s, value in own.items() if s not in named)]))


def by_margin(found: Sequence[Named]) -> Floats:
    """(N,) how often names of such a margin were right in the other families, never falling with it."""
    margins, right = np.array([one.margin for one in found]), np.array([one.right for one in found], dtype=np.float64)
    families = np.array([one.frames.scene.family for one in found])
    chances = np.full(len(found), right.mean())
    for family in set(families.tolist()):
        here = families == family
        if not here.all():
            starts, shares = ascending(margins[~here], right[~here])
            chances[here] = shares[np.maximum(np.searchsorted(starts, margins[here], side="right") - 1, 0)]
    return chances


def ascending(at: Floats, values: Floats) -> tuple[Floats, Floats]:
    """The steps of the regression of values on `at` that never falls (pool adjacent violators): starts and levels."""
    blocks: list[list[float]] = []
    for place in np.argsort(at, kind="stable"):
        blocks.append([float(at[place]), float(values[place]), 1.0])
        while len(blocks) > 1 and blocks[-2][1] * blocks[-1][2] >= blocks[-1][1] * blocks[-2][2]:
            _, total, count = blocks.pop()
            blocks[-1][1:] = blocks[-1][1] + total, blocks[-1][2] + count
    return np.array([start for start, _, _ in blocks]), np.array([total / count for _, total, count in blocks])


def report(frames: Sequence[Scored], least: float) -> Iterator[str]:
    """By attack the shares found, named rightly and wrongly; then how true the probabilities of findings are."""
    found = list(judged(frames))
    for attack in dict.fromkeys(one.attack for one in frames):
        those = [one for one in found if one.frames.attack == attack]
        counts = {
            "found": sum(one.p > 0 for one in those),
            "named": sum(one.p >= least and one.right for one in those),
            "wrongly": sum(one.p >= least and not one.right for one in those),
            "with 90 %": sum(one.p >= SURE and one.right for one in those),
        }
        shares = ", ".join(f"{name} {100 * k / len(those):.1f} %" for name, k in counts.items())
        yield f"  {attack or 'clean'} ({len(those)}): {shares}"
    known = [one for one in found if one.p > 0 and len(one.frames.attacked) <= _most(one.frames)]
    groups = defaultdict(list)
    for one, chance in zip(known, by_margin(known), strict=True):
        row = one.p, one.right, chance
        if one.p >= least:
            family = one.frames.scene.family
            groups["all names"].append(row)
            groups[family.partition(", ")[2] or family].append(row)
        groups["all findings"].append(row)
    for name, rows in groups.items():
        if len(rows) >= FEWEST_NAMES:
            yield f"  {name}: {truth(*(np.array(column) for column in zip(*rows, strict=True)))}"
    clean = [largest_ratios(one) for one in frames if not one.attack]
    if clean:
        ratios = np.concatenate(clean)
        said = (10.0, 100.0, likelihood.LIKELIHOOD.clean_worth)
        shares = ", ".join(f"{k:g} in {100 * (ratios > np.log(k) - ROUNDING).mean():.2f} %" for k in said)
        yield f"  clean frames with a ratio of at least {shares}"


def largest_ratios(one: Scored) -> Floats:
    """(F,) the logarithm of the largest likelihood ratio of any attack set."""
    sets = attack_sets(one.system, NOBODY, one.system.sensors)
    return np.asarray(log_likelihood_ratios(one.z, one.system, NOBODY, sets)[:, 1:].max(axis=1))


def _most(one: Scored) -> int:
    return len(one.system.sensors) - FEWEST_COMPARED


def truth(p: Floats, right: Floats, of_margin: Floats) -> str:
    """The expected calibration error of names, their Brier score beside others, and those of 90 % and more."""
    places = np.minimum((p * BINS).astype(int), BINS - 1)
    error = sum(
        abs(p[places == b].mean() - right[places == b].mean()) * (places == b).mean() for b in np.unique(places)
    )
    share, sure = right.mean(), p >= 0.9
    own, others = (np.mean((forecast - right) ** 2) for forecast in (p, of_margin))
    return (
        f"{len(p)}, {100 * share:.1f} % right; expected calibration error {error:.3f}, Brier score {own:.4f}, a"
        f" constant's {share * (1 - share):.4f}, the margin's {others:.4f}; of {sure.sum()} with 90 % or more"
        f" {100 * right[sure].mean():.1f} % right"
    )


def clean_worth(frames: Sequence[Scored]) -> float:
    """How many independent clean frames the scenes have, by the largest z of each frame."""
    clean = (one for one in frames if not one.attack)
    return sum(effective_size(attack_scores(one.z, one.system, [NOBODY] * len(one.z))) for one in clean)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--without", help="the family that is left out of the fit")
    parser.add_argument("--judge", type=Path, nargs="*", default=[])
    parser.add_argument("--shipped", action="store_true", help="judge by the curves that ship")
    options = parser.parse_args()
    if not options.shipped:
        scenes = {folder: load(folder) for folder in options.folders}
        frames = {
            cameras: [
                one
                for those in scenes.values()
                for one in scored(those, cameras)
                if one.scene.family != options.without
            ]
            for cameras in CAMERAS
        }
        four = frames[CAMERAS[-1]]
        three = [one for cameras in CAMERAS[:-1] for one in frames[cameras]]
        fitted = replace(fit([design(three), design(four)]), clean_worth=round(clean_worth(four), -1))
        print(fitted)
        likelihood.LIKELIHOOD = fitted  # type: ignore[attr-defined]
        likelihood.LARGEST_RATIO = float(np.log(fitted.clean_worth))
    for folder in options.judge:
        for cameras in (CAMERAS[0], CAMERAS[-1]):
            wanted = [one for one in scored(load(folder), cameras) if options.without in (None, one.scene.family)]
            print(folder.name, cameras, *report(wanted, parameters.NAMING.least_probability), sep="\n")


if __name__ == "__main__":
    main()
