"""False incidents an hour, and clean frames raised, on long clean drives at 10 Hz; judged with and without S_4.

Reads drives that were measured, and kept one by one, by

    python -m tests.benchmarks.clean_statistics --into FOLDER --streets 72 --first 9000 --frames 250 --scale 0.5

Each is judged by thresholds learnt from other families of its folder, or of the folders LEARN, or by the prior alone:

    python -m tests.benchmarks.long_drives FOLDER... [--learn FOLDER...] [--prior] [--r 0.01 0.001]

Prints for each r the time that the frames cover, the frames raised with the interval by drives, the false incidents
an hour with two 95 % intervals (Poisson's, and by a bootstrap over drives), every incident with its evidence, and the
alerts of drives without one.
"""

import argparse
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from math import exp, lgamma, log
from pathlib import Path

import numpy as np

from auditor.identification.cross_validation import count_incidents, hours_of
from auditor.identification.evidence_parameters import INCIDENTS
from auditor.model.stamps import NANOSECONDS
from auditor.model.verdict import Finding, VerdictKind
from tests.benchmarks.rates import ByOtherFamilies, Judged, clustered_interval, judge_scene, system_of
from tests.benchmarks.scenes import Scene, load

RIGS = ((1, 2, 3, 4), (1, 2, 3))
_EITHER_SIDE = 0.025


@dataclass(frozen=True, eq=False)
class Incident:
    """Frames of one drive with one finding."""

    finding: Finding
    frames: tuple[Judged, ...]

    def __str__(self) -> str:
        first, last = self.frames[0], self.frames[-1]
        seconds = (last.case.stamp_ns - first.case.stamp_ns) / NANOSECONDS
        named = "".join(f" S_{sensor}" for sensor in self.finding.attacked)
        strongest = [one.robust.evidence[0] for one in self.frames if one.robust.evidence]
        evidence = Counter(f"{one.check_name} of S_{one.i}" for one in strongest).most_common(1)
        causes = Counter(
            f"{one.robust.causes[0].cause.value} S_{one.robust.causes[0].sensor}"
            for one in self.frames
            if one.robust.causes
        ).most_common(1)
        why = [f"{name} in {n}" for name, n in (*evidence, *causes)]
        top = f", z {max(one.score for one in strongest):.2f}" if strongest else ""
        return (
            f"{first.scene.name} ({first.scene.family}, cameras {first.scene.kinds}) from frame {first.case.frame}, "
            f"{len(self.frames)} frames in {seconds:.1f} s: {self.finding.kind.value}{named}; {', '.join(why)}{top}"
        )


def judged_drives(
    scenes: Sequence[Scene], cameras: Sequence[int], r: Decimal, learnt: Sequence[Scene] | None
) -> list[list[Judged]]:
    """The clean frames of each drive in order; judged by drives of other families among `learnt`, None by the prior."""
    thresholds = ByOtherFamilies(learnt or (), cameras, r)
    systems = ((scene, system_of(scene, cameras)) for scene in scenes)
    return [judge_scene(scene, system, thresholds.of(scene.family, system)[0], None) for scene, system in systems]


def incidents_of(drive: Sequence[Judged]) -> list[Incident]:
    """The incidents of a drive, as `count_incidents` counts them."""
    found: list[list[Judged]] = []
    latest: dict[tuple[VerdictKind, tuple[int, ...]], list[Judged]] = {}
    for one in drive:
        finding = one.robust.finding
        if finding is None or finding.alert:
            continue
        before = latest.get(finding[:2])
        if before is None or not _goes_on(before[-1], one):
            latest[finding[:2]] = before = []
            found.append(before)
        before.append(one)
    incidents = [Incident(frames[0].robust.finding, tuple(frames)) for frames in found if frames[0].robust.finding]
    counted = count_incidents([one.robust.finding for one in drive], stamps(drive))
    assert len(incidents) == counted, "the incidents listed are not those that are counted"
    return incidents


def alerts_alone(drive: Sequence[Judged]) -> list[str]:
    """The alerts of a drive without any incident, a line each: such a drive ends in exit code 1 for these alone."""
    if any(one.robust.in_incident for one in drive):
        return []
    events: dict[int, list[Judged]] = {}
    for one in drive:
        if one.robust.finding is not None and one.robust.in_alert:
            events.setdefault(one.robust.finding.event, []).append(one)
    return [
        f"{frames[0].scene.name} ({frames[0].scene.family}) from frame {frames[0].case.frame}, {len(frames)} frames: "
        + ", ".join(f"{kind.value} {n}" for kind, n in Counter(one.robust.kind for one in frames).most_common())
        for frames in events.values()
    ]


def _goes_on(before: Judged, one: Judged) -> bool:
    event = before.robust.finding and before.robust.finding.event
    later_ns = one.case.stamp_ns - before.case.stamp_ns
    return (one.robust.finding and one.robust.finding.event) == event or later_ns <= INCIDENTS.gap_s * NANOSECONDS


def stamps(drive: Sequence[Judged]) -> np.ndarray:
    """(F,) times of a drive's frames in nanoseconds."""
    return np.array([one.case.stamp_ns for one in drive], dtype=np.int64)


def poisson_interval(k: int) -> tuple[float, float]:
    """Both ends of the 95 % interval of a Poisson mean of which k were seen (Garwood's)."""

    def at_most(mean: float, most: int) -> float:
        return sum(exp(n * log(mean) - mean - lgamma(n + 1)) for n in range(most + 1))

    def where(most: int, share: float) -> float:
        low, high = 1e-9, 10.0 + 4 * (k + 1)
        for _ in range(100):
            middle = (low + high) / 2
            low, high = (middle, high) if at_most(middle, most) > share else (low, middle)
        return low

    return where(k - 1, 1 - _EITHER_SIDE) if k else 0.0, where(k, _EITHER_SIDE)


def hourly_interval(incidents: Sequence[int], hours: Sequence[float]) -> tuple[float, float] | None:
    """The 95 % interval of incidents an hour by a bootstrap over drives; None without any incident."""
    k, t = np.array(incidents), np.array(hours)
    if not k.sum():
        return None
    drawn = np.random.default_rng(0).integers(0, len(k), (10_000, len(k)))
    low, high = np.quantile(k[drawn].sum(axis=1) / t[drawn].sum(axis=1), (_EITHER_SIDE, 1 - _EITHER_SIDE))
    return float(low), float(high)


def report(drives: Sequence[Sequence[Judged]]) -> Iterator[str]:
    """Time, shares raised, incidents an hour, and the incidents, the longest first."""
    frames = [len(drive) for drive in drives]
    hours = [hours_of(stamps(drive)) for drive in drives]
    raised = [sum(one.robust.kind is not VerdictKind.CLEAN for one in drive) for drive in drives]
    named = [sum(one.robust.kind is VerdictKind.ATTACKED for one in drive) for drive in drives]
    families = len({drive[0].scene.family for drive in drives})
    yield f"  {len(drives)} drives of {families} families, {sum(frames)} frames, {60 * sum(hours):.1f} minutes"
    for text, hits in (("not clean", raised), ("a sensor named", named)):
        low, high = clustered_interval(hits, frames)
        yield f"  {text}: {sum(hits)} of {sum(frames)}, {100 * sum(hits) / sum(frames):.2f} % " + (
            f"[{100 * low:.2f}, {100 * high:.2f}], on {sum(map(bool, hits))} drives"
        )
    incidents = [incidents_of(drive) for drive in drives]
    counted = [len(one) for one in incidents]
    low, high = (end / sum(hours) for end in poisson_interval(sum(counted)))
    by_drives = hourly_interval(counted, hours)
    yield f"  false incidents: {sum(counted)} on {sum(map(bool, counted))} drives, {sum(counted) / sum(hours):.1f} " + (
        f"an hour [{low:.1f}, {high:.1f}]"
        + (f", by drives [{by_drives[0]:.1f}, {by_drives[1]:.1f}]" if by_drives else "")
    )
    for one in sorted((each for drive in incidents for each in drive), key=lambda one: -len(one.frames)):
        yield f"    {one}"
    alone = [alerts_alone(drive) for drive in drives]
    yield f"  alerts: {sum(map(len, alone))} on {sum(map(bool, alone))} drives without an incident"
    yield from (f"    {line}" for lines in alone for line in lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("folders", type=Path, nargs="+", help="the drives that are judged")
    parser.add_argument("--learn", type=Path, nargs="+", help="folders of clean scenes, in place of the drives' own")
    parser.add_argument("--prior", action="store_true", help="learn from nothing")
    parser.add_argument("--r", type=Decimal, nargs="+", default=[Decimal("0.01"), Decimal("0.001")])
    options = parser.parse_args()
    scenes = [scene for folder in options.folders for scene in load(folder)]
    learnt = [scene for folder in options.learn for scene in load(folder)] if options.learn else scenes
    learnt = [replace(one, cases=tuple(case for case in one.cases if not case.attack)) for one in learnt]
    for cameras in RIGS:
        for r in options.r:
            print(f"LiDAR and {len(cameras)} cameras, r = {r}" + (", by the prior" if options.prior else ""))
            drives = judged_drives(scenes, cameras, r, None if options.prior else learnt)
            print(*report(drives), sep="\n", flush=True)


if __name__ == "__main__":
    main()
