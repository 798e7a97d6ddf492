"""Incidents: strobes, bursts and ramps found, and false incidents, from half a frame a second to twenty.

Reads scenes that `python -m tests.benchmarks.clean_statistics` measured. Each is judged by thresholds learnt from the
other families of its folder:

    python -m tests.benchmarks.incident_series ATTACKED --clean LONG      tables of attacks and of clean drives
    python -m tests.benchmarks.incident_series FOLDER... --fit            what the parameters were fitted to

An attacked series is a clean drive in which some frames are those of an attack on one set of sensors. Frames that were
taken at ten a second are stamped anew for other rates, or every so many of them are taken.
"""

import argparse
from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from pathlib import Path

import numpy as np

from auditor.identification.cross_validation import count_incidents, hours_of
from auditor.identification.drive_level import for_clean_drive, for_drive
from auditor.identification.evidence_parameters import INCIDENTS
from auditor.identification.incidents.sequential import evidence_of, frame_worth, periods_of
from auditor.identification.incidents.series import FrameSeries
from auditor.identification.naming import attack_scores
from auditor.identification.prior import joint_limit
from auditor.identification.robust import clean_peaks, judge_frames
from auditor.identification.scores import normalised_scores
from auditor.identification.statistics import runs_of
from auditor.identification.systems import System
from auditor.model.calibration import RobustThresholds
from auditor.model.stamps import NANOSECONDS
from auditor.model.verdict import FINDINGS, Finding, Verdict
from tests.benchmarks.long_drives import poisson_interval
from tests.benchmarks.rates import ByOtherFamilies, brightness_of, clean_frames, frames_of, system_of
from tests.benchmarks.scenes import Case, Scene, load

RIGS = ((1, 2, 3, 4), (1, 2, 3))
MEASURED_HZ = 10.0
RATES_HZ = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0)
FEWEST_FRAMES = 40
"""Shorter drives hold no strobe that lasts for three seconds and more."""

Pattern = Callable[[int], bool]
"""Whether a frame is attacked, by its number from the start of the attack."""


@dataclass(frozen=True, eq=False)
class Drive:
    """The clean cases of a scene in their order, its attacked ones by attack and frame, and how it is judged."""

    scene: Scene
    system: System
    thresholds: RobustThresholds
    clean: tuple[Case, ...]
    attacks: Mapping[str, Mapping[tuple[int, ...], Mapping[int, Case]]]

    def series(self, attacked: Mapping[int, Case], rate_hz: float, statistics: np.ndarray | None = None) -> FrameSeries:
        """The drive at another rate, where at some places attacked cases are; or with all its statistics given."""
        cases = [attacked.get(place, case) for place, case in enumerate(self.clean)]
        own = frames_of(self.scene, self.system, self.clean)
        stamps = (np.arange(len(cases)) * (NANOSECONDS / rate_hz)).astype(np.int64)
        here = np.ones((len(cases), len(self.system.sensors)), dtype=np.bool_)
        if statistics is None:
            statistics = frames_of(self.scene, self.system, cases).statistics_of(self.system.sensor_checks)
        brightness = brightness_of(cases, self.system)
        return FrameSeries(stamps, runs_of(stamps), statistics, here, ~here, own.strengths, brightness)

    def judged(self, series: FrameSeries) -> list[Verdict]:
        """The verdicts, as a scan has them."""
        return judge_frames(series, self.system, self.own(series))

    def own(self, series: FrameSeries) -> RobustThresholds:
        """The thresholds with what is usual of the drive itself."""
        return for_drive(self.thresholds, self.system.sensor_checks, series.statistics, series.stamps_ns)

    def scores(self) -> np.ndarray:
        """(F,) the largest z of each clean frame."""
        clean = clean_frames(self.scene, self.system)
        statistics = clean.statistics_of(self.system.sensor_checks)
        own = for_clean_drive(self.thresholds, self.system.sensor_checks, clean)
        z = normalised_scores(statistics, [own.expected.get(check) for check in self.system.sensor_checks])
        return attack_scores(z, self.system, [frozenset()] * len(z))

    def every(self, step: int, first: int) -> "Drive":
        """Every so many frames of it."""
        return replace(self, clean=self.clean[first::step])


def drives_of(scenes: Sequence[Scene], cameras: Sequence[int], r: Decimal, *, prior: bool = False) -> list[Drive]:
    """All scenes, each with the thresholds of the others' families, or by the prior alone."""
    thresholds = ByOtherFamilies([] if prior else scenes, cameras, r)
    systems = ((scene, system_of(scene, cameras)) for scene in scenes)
    return [drive_of(scene, system, thresholds.of(scene.family, system)[0]) for scene, system in systems]


def drive_of(scene: Scene, system: System, thresholds: RobustThresholds) -> Drive:
    clean = tuple(case for case in scene.cases if not case.attack)
    place_of = {case.frame: place for place, case in enumerate(clean)}
    attacks: dict[str, dict[tuple[int, ...], dict[int, Case]]] = defaultdict(lambda: defaultdict(dict))
    for case in scene.cases:
        if case.attack and set(case.attacked) <= set(system.sensors):
            attacks[case.attack][case.attacked][place_of[case.frame]] = case
    return Drive(scene, system, thresholds, clean, attacks)


class Tally(Counter[str]):
    """Attacked series, by what became of them, and their attacked frames, raised and named.

    `once` there is a single `incident`; what is `found` may be an alert. `by incident` says that an incident
    names exactly who is attacked, `by finding` that an incident or an alert does, `others` that one names others.
    """

    def add(
        self,
        drive: Drive,
        cases: Mapping[int, Case],
        who: tuple[int, ...],
        attacked: Collection[int] | None = None,
        rate_hz: float = MEASURED_HZ,
    ) -> None:
        """Judge a drive with these cases at their places, of which those `attacked` (else all) are attacked."""
        series = drive.series(cases, rate_hz)
        verdicts = drive.judged(series)
        self.count(verdicts, who, cases if attacked is None else attacked)
        self["once"] += count_incidents([one.finding for one in verdicts], series.stamps_ns) == 1

    def count(self, verdicts: Sequence[Verdict], who: tuple[int, ...], attacked: Collection[int] = ()) -> None:
        """Count one series, in which the frames at these places were attacked."""
        findings = [verdict.finding for verdict in verdicts if verdict.finding is not None]
        self["series"] += 1
        self["incident"] += any(not one.alert for one in findings)
        self["found"] += bool(findings)
        self["by incident"] += any(one.attacked == who and not one.alert for one in findings)
        self["by finding"] += any(one.attacked == who for one in findings)
        self["others"] += any(one.attacked and one.attacked != who for one in findings)
        self["frames"] += len(attacked)
        self["raised"] += sum(verdicts[place].kind in FINDINGS for place in attacked)
        self["named"] += sum(verdicts[place].attacked == who for place in attacked)

    def __str__(self) -> str:
        named = f"{self['once']} once, {self['by incident']} named; frames {self['raised']}/{self['frames']}"
        return f"{self['incident']}/{self['series']} ({named})" if self["series"] else "-"


def patterns() -> dict[str, tuple[Pattern, int]]:
    """The attacks in time, each with how many phases or starts there are."""
    return {
        "half a second": (lambda n: 0 <= n < 5, 0),
        "a second": (lambda n: 0 <= n < 10, 0),
        "1 in 3": (lambda n: n % 3 == 0, 3),
        "1 in 5": (lambda n: n % 5 == 0, 5),
    }


def attacked_series(
    drive: Drive, pattern: Pattern, starts: Sequence[int]
) -> Iterator[tuple[str, tuple[int, ...], dict[int, Case]]]:
    """The attack, the attacked sensors and the attacked cases by place, of each attack on one set of sensors."""
    for attack, sets in drive.attacks.items():
        for who, cases in sets.items():
            if len(cases) < len(drive.clean):  # drawn anew for each frame
                continue
            for start in starts:
                yield attack, who, {place: case for place, case in cases.items() if pattern(place - start)}


def tally_attacks(drives: Sequence[Drive], name: str, rate_hz: float, fewest: int) -> dict[str, Tally]:
    """By attack, how often it was found in this pattern, in drives that have so many frames."""
    pattern, phases = patterns()[name]
    found: dict[str, Tally] = defaultdict(Tally)
    for drive in drives:
        F = len(drive.clean)
        if fewest > F:
            continue
        starts = range(phases) if phases else range(0, F - 4, 3)
        for attack, who, cases in attacked_series(drive, pattern, starts):
            found[attack].add(drive, cases, who, rate_hz=rate_hz)
    return found


def clean_table(drives: Sequence[Drive]) -> Iterator[str]:
    """False incidents and single frames of clean drives at each rate."""
    for rate in RATES_HZ:
        step = max(round(MEASURED_HZ / rate), 1)
        parts = [drive.every(step, first) for drive in drives for first in range(min(step, 5))]
        hours, incidents, singles, frames, raised = 0.0, 0, 0, 0, 0
        told: list[str] = []
        for part in parts:
            series = part.series({}, rate)
            verdicts = part.judged(series)
            findings = [verdict.finding for verdict in verdicts]
            count = count_incidents(findings, series.stamps_ns)
            incidents += count
            singles += sum(f is not None and f.alert for f in findings)
            raised += sum(verdict.kind in FINDINGS for verdict in verdicts)
            frames += len(verdicts)
            hours += hours_of(series.stamps_ns)
            told += [_told(part, verdicts)] if count else []
        low, high = (end / hours for end in poisson_interval(incidents))
        yield (
            f"  {rate:g} Hz: {frames} frames, {60 * hours:.1f} minutes, {raised} raised; {incidents} incidents, "
            f"{incidents / hours:.1f} an hour [{low:.1f}, {high:.1f}]; {singles} single frames"
        )
        yield from (f"    {one}" for one in told if rate == MEASURED_HZ)


def _told(drive: Drive, verdicts: Sequence[Verdict]) -> str:
    own: dict[Finding, list[int]] = defaultdict(list)
    for place, verdict in enumerate(verdicts):
        if verdict.finding is not None and not verdict.finding.alert:
            own[verdict.finding._replace(added=0.0)].append(place)
    return f"{drive.scene.name}: " + "; ".join(
        f"{one.kind.value} {one.attacked} in frames {at[0]} to {at[-1]}, {len(at)} of them" for one, at in own.items()
    )


def ramp_table(drives: Sequence[Drive]) -> Iterator[str]:
    """Ramps: the log odds of all statistics go from those of the clean frames to those of the attacked ones.

    How much is lit and saturates is that of the attacked frames from the first one on.
    """
    for seconds in (0.5, 1.0, 2.0):
        delays, once, found, number = [], 0, 0, 0
        for drive in (one for one in drives if len(one.clean) >= FEWEST_FRAMES):
            steady = drive.series({}, MEASURED_HZ).statistics
            for attack, _, cases in attacked_series(drive, lambda n: True, [0]):
                if attack != "paper's facula":
                    continue
                full = drive.series(cases, MEASURED_HZ).statistics
                part = np.clip((np.arange(len(steady)) - 5) / (seconds * MEASURED_HZ), 0, 1)[:, None]
                lit = {place: case for place, case in cases.items() if part[place] > 0}
                series = drive.series(lit, MEASURED_HZ, steady + part * (full - steady))
                verdicts = drive.judged(series)
                incident = [f for f, one in enumerate(verdicts) if one.finding is not None and not one.finding.alert]
                raised = [f for f, one in enumerate(verdicts) if one.kind in FINDINGS]
                number, found = number + 1, found + bool(incident)
                once += count_incidents([one.finding for one in verdicts], series.stamps_ns) == 1
                delays += [(incident[0] - raised[0]) / MEASURED_HZ] if incident else []
        yield (
            f"  over {seconds:g} s: {found} of {number} are incidents, {once} one; from the first raised frame to "
            f"its beginning {np.median(delays):+.2f} s in the median, {min(delays):+.2f} to {max(delays):+.2f}"
        )


def delay_table(drives: Sequence[Drive], rates: Sequence[float]) -> Iterator[str]:
    """How many attacked frames it takes until a lasting attack is an incident, by rate."""
    for rate in rates:
        needed = []
        for drive in (one for one in drives if len(one.clean) >= FEWEST_FRAMES):
            for attack, _, cases in attacked_series(drive, lambda n: True, [0]):
                if attack not in ("paper's facula", "wall 2.5 m"):
                    continue
                frames = next(n for n in range(1, 30) if _is_incident(drive, cases, n, rate))
                needed.append(frames)
        yield (
            f"  {rate:g} Hz: {np.median(needed):.0f} frames ({min(needed)} to {max(needed)}), "
            f"{np.median(needed) / rate:.1f} s; a frame is worth {frame_worth(np.array([1 / rate]))[0]:.2f}"
        )


def _is_incident(drive: Drive, cases: Mapping[int, Case], frames: int, rate: float) -> bool:
    series = drive.series({place: case for place, case in cases.items() if place < frames}, rate)
    return count_incidents([one.finding for one in drive.judged(series)], series.stamps_ns) > 0


def fit(drives: Sequence[Drive]) -> Iterator[str]:
    """The tail of the largest z, the autocorrelation of the evidence, and the peaks of clean drives."""
    scores = [drive.scores() for drive in drives]
    limits = [joint_limit(INCIDENTS.tail_rate, drive.system.judged_together) for drive in drives]
    beyond = np.concatenate([one - limit for one, limit in zip(scores, limits, strict=True)])
    for start in (-1.0, -0.5, 0.0):
        over = beyond[beyond > start] - start
        slope = f"{1 / over.mean():.2f}" if over.size else "-"
        yield f"  {over.size} of {beyond.size} frames exceed the limit {start:+.1f}: slope {slope}"
    peaks, hours = [], 0.0
    added = []
    for drive, values in zip(drives, scores, strict=True):
        series = drive.series({}, MEASURED_HZ)
        stamps = series.stamps_ns
        evidence = evidence_of(values, drive.system.judged_together, periods_of(stamps, series.runs), series.runs)
        peaks += clean_peaks(series, drive.system, drive.own(series))
        hours += hours_of(stamps)
        added.append(evidence.added / frame_worth(np.array([1 / MEASURED_HZ])))
    excess = [peak - INCIDENTS.peaks_from for peak in peaks if peak > INCIDENTS.peaks_from]
    scale = f"{np.mean(excess):.2f}" if excess else "-"
    yield f"  {len(excess)} peaks beyond {INCIDENTS.peaks_from} in {hours:.3f} h, exceeding it by {scale} on average"
    yield f"  largest peaks {', '.join(f'{peak:.2f}' for peak in sorted(peaks)[:-6:-1])}"
    long = [one for one in added if len(one) >= FEWEST_FRAMES]
    if long:
        middle = np.concatenate(long).mean()
        lags = (1, 2, 3, 5, 7, 10)
        rho = [
            sum(((one[lag:] - middle) * (one[:-lag] - middle)).mean() for one in long)
            / sum(((one - middle) ** 2).mean() for one in long)
            for lag in lags
        ]
        told = ", ".join(f"{value:.2f} at {lag / MEASURED_HZ:g} s" for lag, value in zip(lags, rho, strict=True))
        yield f"  autocorrelation of the evidence: {told}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("folders", type=Path, nargs="+", help="scenes with attacks; with --fit any")
    parser.add_argument("--clean", type=Path, help="long clean drives")
    parser.add_argument("--fit", action="store_true", help="what the parameters come from")
    parser.add_argument("--r", type=Decimal, default=Decimal("0.01"))
    options = parser.parse_args()
    for cameras in RIGS:
        drives = [drive for folder in options.folders for drive in drives_of(load(folder), cameras, options.r)]
        print(f"LiDAR and {len(cameras)} cameras", flush=True)
        if options.fit:
            print(*fit(drives), sep="\n")
            continue
        if options.clean:
            print(*clean_table(drives_of(load(options.clean), cameras, options.r)), sep="\n", flush=True)
        for name, fewest in (
            ("half a second", 0),
            ("a second", 0),
            ("1 in 3", FEWEST_FRAMES),
            ("1 in 5", FEWEST_FRAMES),
        ):
            for attack, tally in tally_attacks(drives, name, MEASURED_HZ, fewest).items():
                print(f"  {name}, {attack}: {tally}", flush=True)
        for rate, name in ((rate, name) for rate in RATES_HZ for name in ("1 in 3", "1 in 5")):
            found = tally_attacks(drives, name, rate, FEWEST_FRAMES)
            print(
                f"  {rate:g} Hz, {name}: " + "; ".join(f"{attack} {found[attack]}" for attack in _PUBLISHED), flush=True
            )
        print(*ramp_table(drives), *delay_table(drives, RATES_HZ), sep="\n", flush=True)


_PUBLISHED = ("paper's facula", "wall 2.5 m")

if __name__ == "__main__":
    main()
