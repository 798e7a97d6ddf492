"""Measures the same frames by SGBM and by the weights that come with auditor, and fits and tries the latter's prior.

python -m tests.benchmarks.matcher_prior measure FOLDER [--attacked 6 4 4]
python -m tests.benchmarks.matcher_prior measure FOLDER --four --every 4 --attacked 0 0 0
python -m tests.benchmarks.matcher_prior measure FOLDER --streets 40 [--first 2000]
python -m tests.benchmarks.matcher_prior fit FOLDER
python -m tests.benchmarks.matcher_prior audit FOLDER

`measure`: clean frames of KITTI's drives 0009, 0001 and odometry 04 (AUDITOR_TEST_DATA), and some of each under the
lights and the wall of `matcher_audit`; or two frames of each street, half a second apart, with four cameras. What
FOLDER has is not measured again.

`fit`: of each check whose statistics the network changes what clean frames have by both matchers, the largest z by the
declared prior, and what the network's own prior would be. Of MOVED the mean is that of the sensor that shows most in
each source: near pairs show next to nothing, and say nothing about wide ones. Deviations within drives are the largest
of any source; of WIDENED they are those declared, times by how much the network's are wider than SGBM's. Nothing is
lower or narrower than declared. `audit`: each real drive by these priors, fitted without it, and by those that ship, by
the prior alone, and by the other two drives, r = 1 %.
"""

import argparse
import json
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from math import sqrt
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auditor.identification import parameters
from auditor.identification.parameters import HIERARCHY, FittedOn
from auditor.identification.prior import Prior, expected, log_odds, prior_of_check
from auditor.lab.evaluation.attacked_frame import AttackedFrame
from auditor.lab.evaluation.experiments import Attacks
from auditor.lab.evaluation.sources import Street
from auditor.measurement import use_one_thread
from auditor.measurement.disparity.matchers import Matcher, find_matcher
from auditor.measurement.disparity.matchers.interface import takes_pairs
from auditor.model.checks import SensorCheck, rig_sensor_checks
from auditor.model.frames import Frame
from auditor.model.rig import Rig
from auditor.model.verdict import VerdictKind
from tests.benchmarks.clean_statistics import spread
from tests.benchmarks.matcher_audit import attacks_on, judge_alone, open_drive, outcome

MATCHERS = ("sgbm", "psmnet")
REAL = ("04", "0001", "0009")
MOVED = ("conflict", "inconsistency_of_one", "inconsistency_of_two", "inconsistency")
WIDENED = ("light_of_two",)
BY_HAND = dict.fromkeys(("false_ranges", "scattered_ranges"), (-3.88, 0.65, 0.15, 1.7))
"""The priors that are not SGBM's: of light those by which it raises clean frames."""
SHIPS = dict(parameters.OTHERS[FittedOn.PSMNET])
STREET_FRAMES = (0, 5)


class Source(NamedTuple):
    """Frames of a drive, the numbers of those that are measured, and of those that are attacked as well."""

    name: str
    family: str
    rig: Rig
    frames: Iterator[Frame]
    wanted: frozenset[int]
    attacked: frozenset[int]


def real(number: str, attacked: int, every: int, *, four: bool) -> Source:
    """A drive with the LiDAR and three or four cameras; each so many frames are measured."""
    rig, frames = open_drive(number, four=four)
    listed = list(frames)
    wanted = frozenset(frame.number for frame in listed[::every])
    return Source(
        f"four {number}" if four else number,
        number,
        rig,
        iter(listed),
        wanted,
        frozenset(spread(listed, attacked) if attacked else ()),
    )


def street(seed: int) -> Source:
    """A street of a vehicle with four cameras."""
    made = Street(seed, max(STREET_FRAMES) + 1, cameras=4)
    drive = made.drive
    return Source(f"street {seed}", made.family, drive.rig, drive.frames(), frozenset(STREET_FRAMES), frozenset())


def measure(source: Source, folder: Path) -> None:
    """Append to the source's file what it lacks, a line for each frame and attack."""
    path = folder / f"{source.name}.jsonl"
    known = {(row["frame"], row["case"]) for row in rows_of(path)}
    for frame in source.frames:
        if frame.number not in source.wanted:
            continue
        cases: list[tuple[str, Attacks]] = [("clean", {})]
        if frame.number in source.attacked:
            cases += [(f"{name} on {min(attacks)}", attacks) for name, attacks in attacks_on(frame, source.rig)]
        cases = [one for one in cases if (frame.number, one[0]) not in known]
        if not cases:
            continue
        found = {name: statistics_of(frame, source.rig, name, [attacks for _, attacks in cases]) for name in MATCHERS}
        with path.open("a") as file:
            for place, (case, attacks) in enumerate(cases):
                row = {"frame": frame.number, "stamp_ns": frame.stamp_ns, "case": case, "attacked": sorted(attacks)}
                row |= {name: found[name][place] for name in MATCHERS}
                file.write(json.dumps({"family": source.family, **row}) + "\n")
        print(source.name, frame.number, len(cases), flush=True)


def statistics_of(frame: Frame, rig: Rig, name: str, cases: Sequence[Attacks]) -> list[list[float | None]]:
    """The statistics of a frame under each attack, in the order of the rig's sensor checks."""
    matcher = _matcher(name)
    measured = AttackedFrame(frame, rig, matcher)
    if takes_pairs(matcher):
        measured.match_pairs(measured.pairs(), cases)
    return [list(measured.statistics(attacks)) for attacks in cases]


@cache
def _matcher(name: str) -> Matcher:
    """Of a name; weights are read once."""
    return find_matcher(name)


def rows_of(path: Path) -> list[dict]:
    """The lines of a file that were written whole."""
    if not path.exists():
        return []
    return [json.loads(line) for line in path.read_text().splitlines() if line.endswith("}")]


class Values(NamedTuple):
    """The log odds (F, 2) of one check in the clean frames of a source, by SGBM and by the network."""

    source: str
    odds: NDArray[np.float64]


Priors = dict[str, tuple[float, float, float, float]]


def prior_name(check: SensorCheck) -> str:
    """The name of the prior that a check has."""
    priors = check.check.kind.priors
    return priors[min(len(check.others), len(priors)) - 1].name


def rig_of(name: str) -> Rig:
    """The rig of a file's source."""
    kind, _, seed = name.partition(" ")
    if kind == "street":
        return Street(int(seed), 1, cameras=4).drive.rig
    return open_drive(seed or name, four=bool(seed))[0]


def clean_values(folder: Path) -> tuple[dict[str, list[Values]], dict[str, Prior]]:
    """The values of each check whose statistics are not the same by both, by the name of its prior; those declared."""
    found: dict[str, list[Values]] = defaultdict(list)
    declared: dict[str, Prior] = {}
    for path in sorted(folder.glob("**/*.jsonl")):
        clean = [row for row in rows_of(path) if row["case"] == "clean" and not path.stem.startswith("four")]
        for column, check in enumerate(rig_sensor_checks(rig_of(path.stem)) if clean else ()):
            odds = log_odds(np.array([[row[name][column] for name in MATCHERS] for row in clean], dtype=np.float64))
            known = odds[~np.isnan(odds).any(axis=1)]
            if known.size:
                found[prior_name(check)].append(Values(path.stem, known))
                declared[prior_name(check)] = prior_of_check(check)
    differ = {name for name, some in found.items() if any(np.ptp(one.odds, axis=1).max() > 0 for one in some)}
    return {name: found[name] for name in sorted(differ)}, declared


def of_sources(some: Iterable[Values], matcher: int) -> tuple[float, float, float]:
    """Mean, and deviations within and between sources, of the sensor that shows most in each.

    As in the benchmark `prior` a third of the variance between sources is between drives of one rig kind. Streets have
    too few frames each to say what they deviate by: together they are one source of it.
    """
    by_source: dict[str, list[NDArray[np.float64]]] = defaultdict(list)
    for one in some:
        by_source[one.source].append(one.odds[:, matcher])
    levels = np.array([max(odds.mean() for odds in sensors) for sensors in by_source.values()])
    squares: dict[str, list[float]] = defaultdict(list)
    for source, sensors in by_source.items():
        squares[source.partition(" ")[0]] += [float(odds.var(ddof=1)) for odds in sensors if odds.size > 1]
    within = max(sqrt(np.mean(each)) for each in squares.values() if each)
    return float(levels.mean()), within, float(levels.std(ddof=1)) / sqrt(1 + 1 / HIERARCHY.rig_kind)


def fitted(values: Mapping[str, Sequence[Values]], declared: Mapping[str, Prior], left_out: str = "") -> Priors:
    """The network's priors of MOVED and WIDENED from all sources but one."""
    found: Priors = dict(BY_HAND)
    for name in (*MOVED, *WIDENED):
        prior, sources = declared[name], [one for one in values[name] if one.source != left_out]
        measured = of_sources(sources, 1)
        if name in WIDENED:
            measured = prior.mean, prior.within * measured[1] / of_sources(sources, 0)[1], prior.between
        mean, within, between = (round(max(one), 2) for one in zip(prior[:3], measured, strict=True))
        found[name] = mean, within, between, prior.tail
    return found


def fit(folder: Path) -> Iterator[str]:
    """A line for each prior."""
    values, declared = clean_values(folder)
    priors = fitted(values, declared)
    for name, some in values.items():
        prior = declared[name]
        odds = np.concatenate([one.odds for one in some])
        largest = (odds.max(axis=0) - expected(prior, ()).mean) / expected(prior, ()).deviation
        told = "   ".join(
            f"{matcher} {_told(of_sources(some, place))}, largest z {largest[place]:4.1f}"
            for place, matcher in enumerate(MATCHERS)
        )
        yield f"{name:22} {len(odds):5} values, declared {_told(prior)}   {told}" + (
            f"   fitted {_told(priors[name])}" if name in priors else ""
        )


def _told(values: Iterable[float]) -> str:
    return " ".join(f"{one:5.2f}" for one in values)


@contextmanager
def shipping(priors: Priors) -> Iterator[None]:
    """The network's priors are these meanwhile."""
    before = dict(parameters.OTHERS[FittedOn.PSMNET])
    _put(priors)
    try:
        yield
    finally:
        _put(before)


def _put(priors: Mapping[str, tuple[float, float, float, float]]) -> None:
    known = parameters.OTHERS[FittedOn.PSMNET]
    assert isinstance(known, dict)
    known.clear()
    known.update(priors)
    prior_of_check.cache_clear()


def audit(folder: Path) -> Iterator[str]:
    """How the frames of each real drive are judged, by matcher and prior."""
    values, declared = clean_values(folder)
    rows = {number: rows_of(folder / f"{number}.jsonl") for number in REAL}
    ways: dict[str, tuple[str, FittedOn]] = {
        "sgbm": ("sgbm", FittedOn.SGBM),
        "psmnet, prior of sgbm": ("psmnet", FittedOn.SGBM),
        "psmnet, fitted without it": ("psmnet", FittedOn.PSMNET),
        "psmnet, as it ships": ("psmnet", FittedOn.PSMNET),
    }
    for way, (matcher, fitted_on) in ways.items():
        for number in REAL:
            priors = fitted(values, declared, number) if "without" in way else SHIPS
            with shipping(priors):
                yield from _audited(f"{way:26} {number:5}", number, rows, matcher, fitted_on)
    for way, (matcher, fitted_on) in ways.items():
        for kind in ("four", "street") if "without" not in way else ():
            sources = [path.stem for path in sorted(folder.glob(f"{kind} *.jsonl"))]
            raised = [one for name in sources for one in _raised_on(folder, name, matcher, fitted_on)]
            yield f"{way:26} {kind}: clean, by the prior {sum(raised)} of {len(raised)} raised"


def _raised_on(folder: Path, name: str, matcher: str, fitted_on: FittedOn) -> list[bool]:
    tested = [row[matcher] for row in rows_of(folder / f"{name}.jsonl")]
    return [one.kind is not VerdictKind.CLEAN for one in judge_alone(rig_of(name), [], tested, fitted_on)]


def _audited(
    title: str, number: str, rows: Mapping[str, Sequence[dict]], matcher: str, fitted_on: FittedOn
) -> Iterator[str]:
    """A line for each way of judging: what became of the drive's clean and attacked frames."""
    rig, tested = open_drive(number)[0], [row[matcher] for row in rows[number]]
    clean = {one: [row[matcher] for row in some if row["case"] == "clean"] for one, some in rows.items()}
    others = [some for one, some in clean.items() if one != number]
    for by, drives, own in (("prior", [], ()), ("prior, as scanned", [], clean[number]), ("learnt", others, ())):
        verdicts = judge_alone(rig, drives, tested, fitted_on, own)
        counts: dict[str, Counter[str]] = defaultdict(Counter)
        for row, verdict in zip(rows[number], verdicts, strict=True):
            kind = row["case"].partition(" on ")[0]
            raised = verdict.kind is not VerdictKind.CLEAN
            counts[kind][outcome(tuple(row["attacked"]), verdict.attacked, raised)] += 1
        said = "; ".join(
            f"{kind}: " + ", ".join(f"{what} {count}" for what, count in sorted(some.items()))
            for kind, some in counts.items()
        )
        yield f"{title} {by:18} {said}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("what", choices=["measure", "fit", "audit"])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--attacked", type=int, nargs=3, default=(6, 4, 4))
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--four", action="store_true", help="all four cameras: tried, and not fitted to")
    parser.add_argument("--streets", type=int, default=0)
    parser.add_argument("--first", type=int, default=2000)
    options = parser.parse_args()
    use_one_thread()
    options.folder.mkdir(parents=True, exist_ok=True)
    if options.what != "measure":
        for line in (fit if options.what == "fit" else audit)(options.folder):
            print(line, flush=True)
        return
    if options.streets:
        for seed in range(options.first, options.first + options.streets):
            measure(street(seed), options.folder)
        return
    for number, attacked in zip(REAL, reversed(options.attacked), strict=True):
        measure(real(number, attacked, options.every, four=options.four), options.folder)


if __name__ == "__main__":
    main()
