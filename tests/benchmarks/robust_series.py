"""What depends on time and on the calibration: false incidents, attacks that last, attacked calibrations."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import groupby
from math import exp, factorial

import numpy as np

from auditor.lab.attacks.paper import STRENGTHS
from auditor.model.rig import LIDAR, Rig
from auditor.model.verdict import Verdict, VerdictKind
from tests.benchmarks.robust_judging import WINDOW_S, clean_of, robust, wilson
from tests.benchmarks.robust_measuring import Sample
from tests.benchmarks.robust_streets import lasting

FRAMES_PER_HOUR = 36_000
SHARES = (0.2, 0.8, 1.0)

Split = tuple[list[Sample], list[Sample]]


def incidents(rig: Rig, splits: Sequence[Split]) -> None:
    """Print the false incidents of the clean frames: runs that their frames and the half seconds around them raise."""
    found, frames = 0, 0
    for clean, tested in splits:
        quiet = clean_of(tested)
        alone, around = (robust(window)(rig, clean, quiet) for window in (None, WINDOW_S))
        raised = [(s.recording, _raised(a) and _raised(w)) for s, a, w in zip(quiet, alone, around, strict=True)]
        found += sum(above for (_, above), _ in groupby(raised))
        frames += len(quiet)
    hours = frames / FRAMES_PER_HOUR
    most = _at_most(found) / hours
    print(f"  {found} false incidents in {frames} clean frames ({hours:.3f} h): at most {most:.0f} an hour (95 %)")


def _raised(verdict: Verdict) -> bool:
    return verdict.kind is not VerdictKind.CLEAN


def _at_most(count: int) -> float:
    """The upper 95 % bound of a Poisson mean of which `count` events were seen."""
    low, high = 0.0, 10.0 * count + 10
    for _ in range(60):
        middle = (low + high) / 2
        tail = sum(exp(-middle) * middle**k / factorial(k) for k in range(count + 1))
        low, high = (middle, high) if tail > 0.05 else (low, middle)
    return high


def lasting_attacks(rig: Rig, splits: Sequence[Split]) -> None:
    """Print how many attacked frames are detected where the first 20, 80 or 100 % of a recording are attacked."""
    for name, window in (("single frames", None), ("windows", WINDOW_S)):
        for share in SHARES:
            outcome: dict[str, list[bool]] = defaultdict(list)
            for clean, tested in splits:
                series = [one for recording in _recordings(tested).values() for one in _attacked(recording, share)]
                verdicts = robust(window)(rig, clean, [sample for sample, _ in series])
                for (sample, attacked), verdict in zip(series, verdicts, strict=True):
                    if attacked:
                        outcome[sample.kind].append(_raised(verdict))
            told = ", ".join(f"{kind} {wilson(sum(o), len(o))}" for kind, o in outcome.items())
            print(f"  {share:.0%} of each recording attacked, {name}: {told}")


def _recordings(samples: Sequence[Sample]) -> Mapping[str, list[Sample]]:
    recordings: dict[str, list[Sample]] = defaultdict(list)
    for sample in samples:
        recordings[sample.recording].append(sample)
    return recordings


def _attacked(recording: Sequence[Sample], share: float) -> list[tuple[Sample, bool]]:
    """Its frames once for each lasting attack, clean after the first share of them."""
    clean = clean_of(recording)
    first = round(share * len(clean))
    series = []
    for kind, attacked in sorted({(s.kind, s.attacked) for s in recording if lasting(s.kind, s.attacked)}):
        under = {s.frame: s for s in recording if (s.kind, s.attacked) == (kind, attacked)}
        for place, sample in enumerate(clean):
            bad = place < first
            one = under[sample.frame] if bad else replace(sample, kind=kind, attacked=attacked)
            series.append((one, bad))
    return series


def contaminated(rig: Rig, calibrated: list[Sample], tested: list[Sample], rng: np.random.Generator) -> None:
    """Faculas on single cameras again, where a share of the frames that were taken for clean had been attacked."""
    clean = clean_of(calibrated)
    camera = [s for s in tested if s.kind in STRENGTHS and len(s.attacked) == 1 and LIDAR not in s.attacked]
    for share in (0.0, 0.05, 0.1, 0.2):
        for strength in ("mild", "opaque"):
            bad = [s for s in calibrated if s.kind == strength and len(s.attacked) == 1]
            count = round(share * len(clean))
            order = rng.permutation(len(clean))
            mixed = [clean[c] for c in order[count:]] + [bad[b] for b in rng.permutation(len(bad))[:count]]
            told = list(zip(camera, robust(None)(rig, mixed, camera), strict=True))
            rates = []
            for kind in ("mild", "opaque"):
                named = [verdict.attacked == sample.attacked for sample, verdict in told if sample.kind == kind]
                rates.append(f"{kind} {wilson(sum(named), len(named))}")
            print(f"  {share:.0%} of the calibration {strength}: {', '.join(rates)}")
