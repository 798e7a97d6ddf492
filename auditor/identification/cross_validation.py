"""Leave one recording out: each clean recording judged by the others. And the thresholds of the robust method."""

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from functools import lru_cache
from math import ceil, inf, sqrt

import numpy as np

from auditor.identification.drive_level import for_clean_drive
from auditor.identification.evidence_parameters import INCIDENTS
from auditor.identification.incidents.sequential import incident_limit
from auditor.identification.incidents.series import FrameSeries
from auditor.identification.robust import clean_peaks, judge_frames
from auditor.identification.scores import CleanDrives, thresholds_from
from auditor.identification.systems import System
from auditor.identification.thresholds import BELOW_EVERY_ERROR, Largest, LargestValues, checked, threshold_rank
from auditor.model.arrays import Flags, Integers
from auditor.model.calibration import Calibration, CleanFrames, RobustThresholds
from auditor.model.measurement import Statistic
from auditor.model.rig import Triple
from auditor.model.stamps import NANOSECONDS
from auditor.model.verdict import FINDINGS, Finding, VerdictKind

NS_PER_HOUR = 3600 * NANOSECONDS

MOST_GROUPS = 200
"""Thresholds of the others are made no oftener: they take a time that grows with the number of recordings."""

_Z = 1.959963984540054  # the 97.5 % quantile of the normal distribution


@dataclass(frozen=True)
class LeftOut:
    """The false alarms in one clean recording, by thresholds that were calibrated on all the others."""

    recording: str
    frames: int
    findings: int
    incidents: int
    hours: float


def robust_thresholds(
    calibration: Calibration,
    system: System,
    r: Decimal,
    incidents_per_hour: float | None = None,
    *,
    transferred: bool = False,
) -> RobustThresholds:
    """Thresholds at r; with `incidents_per_hour` also what clean recordings exceed in no more incidents than that.

    Without it the limit of incidents is the prior's at the usual rate; with it the clean recordings count, each judged
    by the others. `transferred` says that the calibration is of another rig kind. Raises SettingError where r is not
    in [0, 1].
    """
    thresholds = _drives_of(calibration, system).thresholds(system.judged_together, r, calibration.calibration_id)
    limit = thresholds.evidence_limit
    if incidents_per_hour is not None:
        limit = incident_limit(incidents_per_hour, left_out_peaks(calibration, system, r), clean_hours(calibration))
    return replace(thresholds, evidence_limit=limit, incidents_per_hour=incidents_per_hour, transferred=transferred)


def thresholds_of(clean: Sequence[CleanFrames], system: System, r: Decimal) -> RobustThresholds:
    """The robust thresholds at r from some drives; the prior's from none."""
    return thresholds_from(clean, system.sensor_checks, system.judged_together, r, fitted_on=system.fitted_on)


class ThresholdsOfOthers:
    """The robust thresholds by which each clean recording is judged: those of all recordings outside its group."""

    def __init__(self, drives: CleanDrives, groups: Mapping[str, int], system: System, r: Decimal) -> None:
        self._drives = drives
        self._groups = groups
        self._members = defaultdict[int, list[str]](list)
        for recording, group in groups.items():
            self._members[group].append(recording)
        self._system, self._r = system, r
        self._known: dict[int, RobustThresholds] = {}

    def of(self, recording_id: str) -> RobustThresholds:
        """The thresholds for a recording; those of its group are made once."""
        group = self._groups[recording_id]
        if group not in self._known:
            used = self._drives.others(*self._members[group])
            self._known[group] = self._drives.thresholds(self._system.judged_together, self._r, used=used)
        return self._known[group]


def judge_by_others(left_out: CleanFrames, learnt: RobustThresholds, system: System) -> LeftOut:
    """The false alarms in a clean recording by robust thresholds that were learnt from others."""
    series, thresholds = as_scanned(left_out, learnt, system)
    verdicts = judge_frames(series, system, thresholds)
    findings = sum(verdict.kind in FINDINGS for verdict in verdicts)
    incidents = count_incidents([verdict.finding for verdict in verdicts], left_out.stamps_ns)
    return _result(left_out, findings, incidents)


def errors_asked_for(r: Decimal, frames: Counter[str]) -> int:
    """How many of the largest E theta at r depends on, whichever recording is left out; `frames` are those of each."""
    return ceil(checked(r) * frames.total()) + max(frames.values(), default=0) + 2


class CleanErrors:
    """The largest disparity errors of clean recordings, so `many` of each triple, and how many there are in all."""

    def __init__(self, statistic: Statistic, many: int) -> None:
        self.recordings: list[str] = []
        self._statistic = statistic
        self._many = many
        self._largest: dict[Triple, Largest] = {}

    def add(self, drive: CleanFrames) -> None:
        """Take the next recording."""
        for (statistic, triple), E in drive.errors.items():
            if statistic is self._statistic:
                self._of(triple).add(E, len(self.recordings))
        self.recordings.append(drive.recording_id)

    def join(self, later: "CleanErrors") -> None:
        """Take recordings that follow."""
        for triple, largest in later._largest.items():
            self._of(triple).join(largest, len(self.recordings))
        self.recordings += later.recordings

    def ordered(self) -> dict[Triple, LargestValues]:
        """The largest E in ascending order, by triple."""
        return {triple: largest.ordered(len(self.recordings)) for triple, largest in self._largest.items()}

    def _of(self, triple: Triple) -> Largest:
        return self._largest.setdefault(triple, Largest(self._many))


class ErrorsOfOthers:
    """The paper's theta at r by which each clean recording is judged: that of all other recordings."""

    def __init__(self, errors: CleanErrors, r: Decimal) -> None:
        self._places = defaultdict[str, list[int]](list)
        for place, recording in enumerate(errors.recordings):
            self._places[recording].append(place)
        self._ordered, self._r = errors.ordered(), r

    def of(self, recording_id: str) -> dict[Triple, float]:
        """Theta by triple, for a recording; none where the others have no E."""
        thetas = {}
        for triple, ordered in self._ordered.items():
            others = ordered.without(self._places[recording_id])
            if others.size:
                rank = threshold_rank(others.size, self._r)
                thetas[triple] = others.at(rank - 1) if rank else BELOW_EVERY_ERROR
        return thetas


def judge_by_thetas(
    left_out: CleanFrames, theta: Mapping[Triple, float], statistic: Statistic, fallback: Triple | None
) -> LeftOut:
    """The false alarms in a clean recording by the paper's thresholds of others."""
    above, measured = (np.zeros(left_out.frames, dtype=np.bool_) for _ in range(2))
    triples = [triple for kind, triple in left_out.errors if kind is statistic]
    # The fallback, which comes last, counts where no other E of a frame was measured.
    for triple in sorted(triples, key=lambda triple: triple == fallback):
        if triple in theta:
            E = left_out.errors[statistic, triple]
            judged = ~np.isnan(E) & ~(measured & (triple == fallback))
            above |= judged & (theta[triple] < E)
            measured |= judged
    return _result(left_out, int(np.count_nonzero(above)), _count_runs(above))


def groups_of(recording_ids: Iterable[str]) -> dict[str, int]:
    """By recording the group that is left out when it is judged; each is one by itself, of no more than MOST_GROUPS."""
    recordings = dict.fromkeys(recording_ids)
    groups = min(len(recordings), MOST_GROUPS)
    return {one: place * groups // len(recordings) for place, one in enumerate(recordings)}


@lru_cache(maxsize=2)
def _drives_of(calibration: Calibration, system: System) -> CleanDrives:
    """What all thresholds of a calibration are learnt from: of many recordings it takes long."""
    groups = groups_of(one.recording_id for one in calibration.clean)
    return CleanDrives.of(calibration.clean, system.sensor_checks, groups=groups, fitted_on=system.fitted_on)


def left_out_peaks(calibration: Calibration, system: System, r: Decimal) -> list[float]:
    """The peaks of the evidence of all clean frames, each recording by the thresholds of the others.

    Those of one recording alone are in sample.
    """
    alone = len(calibration.recordings) == 1
    drives = _drives_of(calibration, system)
    peaks: list[float] = []
    for left_out in calibration.clean:
        used = None if alone else drives.others(left_out.recording_id)
        learnt = drives.thresholds(system.judged_together, r, used=used)
        series, thresholds = as_scanned(left_out, learnt, system)
        peaks += clean_peaks(series, system, thresholds)
    return peaks


def count_incidents(findings: Sequence[Finding | None], stamps_ns: Integers) -> int:
    """How many incidents the findings of F successive frames make.

    Frames of one event are one, and so are events of one kind and one set of sensors that are no further apart than
    INCIDENTS.gap_s; alerts are none. Where the clock is set back a new one begins. The query `incidents`
    counts the same.
    """
    clock = np.cumsum(np.diff(stamps_ns, prepend=stamps_ns[:1]) < 0)
    latest: dict[tuple[VerdictKind, tuple[int, ...], int], tuple[int, float]] = {}
    count = 0
    for finding, stamp_ns, since in zip(findings, stamps_ns.tolist(), clock.tolist(), strict=True):
        if finding is not None and not finding.alert:
            key = finding.kind, finding.attacked, since
            event, before = latest.get(key, (0, -inf))
            count += event != finding.event and stamp_ns - before > INCIDENTS.gap_s * NANOSECONDS
            latest[key] = finding.event, stamp_ns
    return count


def clean_hours(calibration: Calibration) -> float:
    """The time that the clean frames of a calibration cover, in hours."""
    return float(np.sum([hours_of(one.stamps_ns) for one in calibration.clean]))


def hours_of(stamps_ns: Integers) -> float:
    """The time that frames cover, in hours: their number times the usual time between two; 0 of a single frame."""
    return len(stamps_ns) * float(np.median(np.diff(stamps_ns))) / NS_PER_HOUR if len(stamps_ns) > 1 else 0.0


def wilson(k: float, n: float) -> tuple[float, float]:
    """Both ends of Wilson's 95 % interval of k out of n, which may be effective numbers; 0 and 1 where n = 0."""
    if n == 0:
        return 0.0, 1.0
    p = k / n
    middle, half = p + _Z * _Z / (2 * n), _Z * sqrt(p * (1 - p) / n + _Z * _Z / (4 * n * n))
    scale = 1 + _Z * _Z / n
    # The low end of none and the high end of all are exact, which rounding misses.
    return (middle - half) / scale if k > 0 else 0.0, (middle + half) / scale if k < n else 1.0


def _result(left_out: CleanFrames, findings: int, incidents: int) -> LeftOut:
    """Of a recording and rig: several rigs of one kind may have measured it."""
    return LeftOut(left_out.recording_id, left_out.frames, findings, incidents, hours_of(left_out.stamps_ns))


def as_scanned(clean: CleanFrames, learnt: RobustThresholds, system: System) -> tuple[FrameSeries, RobustThresholds]:
    """The frames of a clean recording, and thresholds as a scan has them that knows its own usual statistics."""
    series = FrameSeries.of_clean(clean, system)
    return series, for_clean_drive(learnt, system.sensor_checks, clean)


def _count_runs(above: Flags) -> int:
    return int(np.count_nonzero(np.diff(above.astype(np.int8), prepend=0) == 1))
