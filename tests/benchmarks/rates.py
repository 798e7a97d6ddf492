"""Rates of the judge that ships on scenes that were left out: false alarms at r, and how often sensors are named.

Reads what `python -m tests.benchmarks.clean_statistics` measured. Each scene is judged by thresholds learnt from the
scenes of other families (real drives: from the other real drives), or by the prior alone:

    python -m tests.benchmarks.rates FOLDER... [--table] [--r 0.01] [--cameras 1 2 3] [--prior]
"""

import argparse
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from pathlib import Path

import numpy as np

from auditor.identification.drive_level import for_drive
from auditor.identification.faults import fault_scores
from auditor.identification.incidents.series import FrameSeries
from auditor.identification.paper import judge_frames as judge_by_paper
from auditor.identification.robust import judge_frames
from auditor.identification.scores import thresholds_from
from auditor.identification.statistics import runs_of
from auditor.identification.systems import System
from auditor.identification.thresholds import threshold
from auditor.model.calibration import CleanFrames, RobustThresholds, Thresholds
from auditor.model.checks import rig_sensor_checks
from auditor.model.fault_features import COLUMNS, OF_LIDAR, ObservedFeatures
from auditor.model.measurement import BRIGHTNESS, Statistic
from auditor.model.rig import LIDAR
from auditor.model.verdict import Verdict, VerdictKind
from tests.benchmarks.scenes import Case, Scene, load

_DRAWS = 10_000
_LEVEL = 0.05


def clustered_interval(hits: Sequence[int], cases: Sequence[int], seed: int = 0) -> tuple[float, float]:
    """The 95 % interval of sum(hits) / sum(cases) by a bootstrap over clusters, one entry each.

    Without any hit, or with nothing but hits, the bound of Clopper and Pearson for as many cases as clusters.
    """
    k, n = np.array(hits), np.array(cases)
    if not 0 < k.sum() < n.sum():
        beyond = 1 - (_LEVEL / 2) ** (1 / len(n))
        return (0.0, beyond) if k.sum() == 0 else (1 - beyond, 1.0)
    drawn = np.random.default_rng(seed).integers(0, len(n), (_DRAWS, len(n)))
    rates = k[drawn].sum(axis=1) / n[drawn].sum(axis=1)
    low, high = np.quantile(rates, (_LEVEL / 2, 1 - _LEVEL / 2))
    return float(low), float(high)


TABLE = ("paper's facula", "wall 2.5 m", "wall 1 m", "R 112 mild", "R 75 mild")
"""The attacks of the published table."""

FEWEST_SCENES = 5
"""Fewer scenes have no interval (docs/figures.md)."""

Outcome = Callable[[Verdict, Case], bool]


@dataclass(frozen=True)
class Judged:
    """A case and its verdicts, by the robust method and by the paper's."""

    scene: Scene
    case: Case
    robust: Verdict
    paper: Verdict | None


def system_of(scene: Scene, cameras: Sequence[int]) -> System:
    """The system of these cameras and the LiDAR, out of a scene's sensors."""
    sensors = tuple(sensor for sensor in scene.rig.sensors if sensor == LIDAR or sensor in cameras)
    checks = tuple(one for one in rig_sensor_checks(scene.rig) if set(one.needed) <= set(sensors))
    triples = tuple(triple for triple in scene.rig.measured_triples if set(triple) <= set(sensors))
    fallback = scene.rig.fallback
    usual = tuple(triple for triple in triples if triple != fallback)
    return System(checks, usual or triples, sensors, fallback if usual and fallback in triples else None)


def clean_frames(scene: Scene, system: System) -> CleanFrames:
    """The clean frames of a scene as a calibration has them."""
    cases = [case for case in scene.cases if not case.attack]
    return frames_of(scene, system, cases)


def frames_of(scene: Scene, system: System, cases: Sequence[Case]) -> CleanFrames:
    """Some cases of a scene, as a calibration has clean frames."""
    place = {check: column for column, check in enumerate(rig_sensor_checks(scene.rig))}
    stamps = np.array([case.stamp_ns for case in cases], dtype=np.int64)
    statistics = np.full((len(cases), len(place)), np.nan)  # checks that came later were not measured: they stand last
    statistics[:, : len(cases[0].statistics)] = np.stack([case.statistics for case in cases])
    errors = np.stack([case.errors for case in cases])
    return CleanFrames(
        scene.name,
        stamps,
        {
            (Statistic.GATED, triple): errors[:, column]
            for column, triple in enumerate(scene.rig.measured_triples)
            if set(triple) <= set(system.sensors)
        },
        {check: statistics[:, place[check]] for check in system.sensor_checks},
        _fault_scores(cases, system, stamps),
    )


def _fault_scores(cases: Sequence[Case], system: System, stamps: np.ndarray) -> dict:
    cameras = tuple(sensor for sensor in system.sensors if sensor != LIDAR)
    pairs = tuple(p for p in dict.fromkeys(p for c in cases for p in c.features) if set(p) <= set(cameras))
    if not pairs:
        return {}
    rows = [[case.features.get(pair, (np.nan,) * len(COLUMNS)) for pair in pairs] for case in cases]
    values = np.array(rows, dtype=np.float64)
    columns = {name: values[:, :, at] for at, name in enumerate(COLUMNS)}
    if LIDAR not in system.sensors:
        columns |= {name: np.full_like(columns[name], np.nan) for name in OF_LIDAR}
    brightness = {
        name: np.array([[case.brightness(name).get(camera) for camera in cameras] for case in cases], dtype=np.float64)
        for name in BRIGHTNESS
    }
    return fault_scores(ObservedFeatures(pairs, columns, cameras, brightness), stamps, system.sensors)


def brightness_of(cases: Sequence[Case], system: System) -> dict[tuple[str, int], np.ndarray]:
    return {
        (name, camera): np.array([case.brightness(name).get(camera) for case in cases], dtype=np.float64)
        for name in BRIGHTNESS
        for camera in system.sensors
        if camera != LIDAR
    }


def judge_scene(scene: Scene, system: System, thresholds: RobustThresholds, theta: Thresholds | None) -> list[Judged]:
    """The verdicts on a scene: clean frames in their order, attacked frames each alone among these."""
    cases = [case for case in scene.cases if set(case.attacked) <= set(system.sensors)]
    clean = [case for case in cases if not case.attack]
    own = frames_of(scene, system, clean)
    here = np.ones((len(clean), len(system.sensors)), dtype=np.bool_)
    series = FrameSeries(
        own.stamps_ns,
        runs_of(own.stamps_ns),
        own.statistics_of(system.sensor_checks),
        here,
        ~here,
        own.strengths,
        brightness_of(clean, system),
    )
    thresholds = for_drive(thresholds, system.sensor_checks, series.statistics, series.stamps_ns)
    verdicts = judge_frames(series, system, thresholds)
    places = {case.frame: place for place, case in enumerate(clean)}
    attacked = [case for case in cases if case.attack]
    for case in attacked:
        place = places[case.frame]
        verdicts += judge_frames(_with(series, system, scene, case, place), system, thresholds, only=[place])
    ordered = [*clean, *attacked]
    papers = _paper(ordered, scene, system, theta)
    return [Judged(scene, *one) for one in zip(ordered, verdicts, papers, strict=True)]


def _with(series: FrameSeries, system: System, scene: Scene, case: Case, place: int) -> FrameSeries:
    """The series with a case at a place; faults are those of the frame that it replaces."""
    statistics = series.statistics.copy()
    statistics[place] = frames_of(scene, system, [case]).statistics_of(system.sensor_checks)[0]
    brightness = {key: values.copy() for key, values in series.brightness.items()}
    for key, values in brightness_of([case], system).items():
        brightness[key][place] = values[0]
    return replace(series, statistics=statistics, brightness=brightness)


def _paper(cases: Sequence[Case], scene: Scene, system: System, theta: Thresholds | None) -> list[Verdict | None]:
    if theta is None:
        return [None] * len(cases)
    columns = [scene.rig.measured_triples.index(triple) for triple in system.triples]
    E = np.stack([case.errors for case in cases])[:, columns]
    return list(judge_by_paper(E, theta, system.triples, system.sensors, [frozenset()] * len(cases)))


def thresholds_of(
    clean: Sequence[CleanFrames], system: System, r: Decimal
) -> tuple[RobustThresholds, Thresholds | None]:
    """The robust method's and the paper's thresholds from these drives; from none the prior, and none."""
    robust = thresholds_from(clean, system.sensor_checks, system.judged_together, r)
    if not clean:
        return robust, None
    samples = {
        triple: np.sort(np.concatenate([one.errors[Statistic.GATED, triple] for one in clean]))
        for triple in system.triples
    }
    samples = {triple: values[~np.isnan(values)] for triple, values in samples.items()}
    theta = {triple: threshold(values.tolist(), r) for triple, values in samples.items() if values.size}
    counts = {triple: int(values.size) for triple, values in samples.items()}
    return robust, Thresholds("", Statistic.GATED, r, theta, counts, resolvable=True)


class ByOtherFamilies:
    """The thresholds by which scenes are judged: from the clean frames of those of other families."""

    def __init__(self, learnt: Sequence[Scene], cameras: Sequence[int], r: Decimal) -> None:
        self._clean = [(scene.family, clean_frames(scene, system_of(scene, cameras))) for scene in learnt]
        self._known: dict[tuple[str, System], tuple[RobustThresholds, Thresholds | None]] = {}
        self._r = r

    def of(self, family: str, system: System) -> tuple[RobustThresholds, Thresholds | None]:
        """As `thresholds_of`, for the scenes of one family; those of one system are made once."""
        key = family, system
        if key not in self._known:
            self._known[key] = thresholds_of([one for known, one in self._clean if known != family], system, self._r)
        return self._known[key]


def judge_all(scenes: Sequence[Scene], cameras: Sequence[int], r: Decimal, *, prior: bool = False) -> list[Judged]:
    """All scenes, each by the scenes of other families, or by the prior alone."""
    thresholds = ByOtherFamilies([] if prior else scenes, cameras, r)
    found: list[Judged] = []
    for scene in scenes:
        system = system_of(scene, cameras)
        found += judge_scene(scene, system, *thresholds.of(scene.family, system))
    return found


def report(judged: Sequence[Judged]) -> Iterator[str]:
    """Clean frames first: not clean, a sensor named; then by attack: named exactly, found, another sensor named."""
    clean = [one for one in judged if not one.case.attack]
    yield f"clean: {share(clean, not_clean)} not clean, {share(clean, some_named)} name a sensor; " + (
        f"paper {share(clean, not_clean, paper=True)} not clean"
    )
    for attack in dict.fromkeys(one.case.attack for one in judged if one.case.attack):
        cases = [one for one in judged if one.case.attack == attack]
        yield f"{attack}: named {share(cases, named)}, found {share(cases, not_clean)}, " + (
            f"misnamed {share(cases, misnamed)}; paper named {share(cases, named, paper=True)}"
        )


def table(judged: Sequence[Judged], attacks: Sequence[str]) -> Iterator[str]:
    """A Markdown table by family, real drives one each and streets by condition, the worst first; robust / paper."""
    groups: dict[str, list[Judged]] = defaultdict(list)
    for one in judged:
        family = one.scene.family
        groups[f"streets, {family.partition(', ')[2]}" if ", " in family else f"KITTI {family}"].append(one)

    def cell(cases: Sequence[Judged], is_so: Outcome) -> str:
        numbers = [counts(cases, is_so, paper=paper) for paper in (False, True)]
        return " / ".join(f"{100 * k / n:.0f}" if n else "-" for k, n in numbers) + f" of {len(cases)}"

    def row(name: str, cases: Sequence[Judged]) -> str:
        clean = [one for one in cases if not one.case.attack]
        of_attacks = [cell([one for one in cases if one.case.attack == attack], named) for attack in attacks]
        return " | ".join(["", name, cell(clean, not_clean), *of_attacks, ""]).strip()

    def worst(group: tuple[str, list[Judged]]) -> float:
        clean = [one for one in group[1] if not one.case.attack]
        attacked = [one for one in group[1] if one.case.attack in attacks]
        (raised, frames), (hits, cases) = counts(clean, not_clean), counts(attacked, named)
        return hits / max(cases, 1) - raised / max(frames, 1)

    yield "| family | clean frames raised | " + " | ".join(attacks) + " |"
    yield "|---" * (2 + len(attacks)) + "|"
    for name, cases in sorted(groups.items(), key=worst):
        yield row(name, cases)
    yield row("all", judged)


def counts(cases: Sequence[Judged], is_so: Outcome, *, paper: bool = False) -> tuple[int, int]:
    """How many of the cases are so by one method's verdict, and of how many that method has one."""
    known = [(one.paper if paper else one.robust, one.case) for one in cases]
    outcomes = [is_so(verdict, case) for verdict, case in known if verdict is not None]
    return sum(outcomes), len(outcomes)


def share(cases: Sequence[Judged], is_so: Outcome, *, paper: bool = False) -> str:
    """Counts and per cent, with the clustered interval of five scenes or more."""
    scenes: dict[str, list[Judged]] = defaultdict(list)
    for one in cases:
        scenes[one.scene.name].append(one)
    of_scenes = [counts(those, is_so, paper=paper) for those in scenes.values()]
    k, n = (sum(column) for column in zip(*of_scenes, strict=True)) if of_scenes else (0, 0)
    if not n:
        return "-"
    text = f"{k}/{n} {100 * k / n:.1f} %"
    if len(of_scenes) < FEWEST_SCENES:
        return text
    low, high = clustered_interval(*(list(column) for column in zip(*of_scenes, strict=True)))
    return f"{text} [{100 * low:.1f}, {100 * high:.1f}]"


def not_clean(verdict: Verdict, case: Case) -> bool:
    return verdict.kind is not VerdictKind.CLEAN


def some_named(verdict: Verdict, case: Case) -> bool:
    return verdict.kind is VerdictKind.ATTACKED


def named(verdict: Verdict, case: Case) -> bool:
    return verdict.attacked == case.attacked


def misnamed(verdict: Verdict, case: Case) -> bool:
    return bool(set(verdict.attacked) - set(case.attacked))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("folders", type=Path, nargs="+", help="judged each by itself")
    parser.add_argument("--table", action="store_true", help="a Markdown table by family")
    parser.add_argument("--r", type=Decimal, default=Decimal("0.01"))
    parser.add_argument("--cameras", type=int, nargs="+", default=[1, 2, 3, 4])
    parser.add_argument("--prior", action="store_true", help="by the prior alone")
    options = parser.parse_args()
    judged: list[Judged] = []
    for folder in options.folders:
        judged += judge_all(load(folder), options.cameras, options.r, prior=options.prior)
    print(*(table(judged, TABLE) if options.table else report(judged)), sep="\n")


if __name__ == "__main__":
    main()
