"""The frames of one judged recording over time: what the incident page draws and counts of them."""

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import fmean
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auditor.model.checks import SensorCheck, counting_checks
from auditor.model.checks.words import found_of
from auditor.model.verdict import FINDINGS, Method, VerdictKind
from auditor.reporting.incident.page import EvidenceLine, IncidentPart, LabelAgreement, RecordingPart, Remark
from auditor.reporting.plots import NS_PER_S, Figure, Series, StripRow, draw

_Subject = tuple[int, int | None, str]
"""The sensor of a check, the other one where two alone do not see the same, and what the check says."""


def sensor_scores(
    z: NDArray[np.float64],
    sensor_checks: Sequence[SensorCheck],
    sensors: Sequence[int],
    missing: Sequence[frozenset[int]],
) -> NDArray[np.float64]:
    """(F, S) the largest z of each sensor's checks that count in a frame, NaN where none was measured.

    `z` is (F, M), NaN where not measured; `missing` are the sensors that each frame was judged without.
    """
    largest = np.full((len(z), len(sensors)), np.nan)
    frames_of: defaultdict[frozenset[int], list[int]] = defaultdict(list)
    for frame, absent in enumerate(missing):
        frames_of[absent].append(frame)
    for absent, frames in frames_of.items():
        counting = counting_checks(tuple(sensor_checks), absent)
        for place, sensor in enumerate(sensors):
            own = [check for check in counting if sensor in sensor_checks[check].nameable]
            if own:
                largest[frames, place] = np.fmax.reduce(z[np.ix_(frames, own)], axis=1)
    return largest


def with_evidence(
    scores: NDArray[np.float64], evidence: Sequence[Sequence[Mapping[str, Any]]], sensors: Sequence[int]
) -> NDArray[np.float64]:
    """(F, S) the scores, or what the evidence of F frames says of a sensor where that is more.

    Where two cameras are attacked each is shown by those that are not, whose votes alone do not count else.
    """
    shown, places = scores.copy(), {sensor: place for place, sensor in enumerate(sensors)}
    for frame, of_frame in enumerate(evidence):
        for evidence_of in of_frame:
            place = places[evidence_of["i"]]
            shown[frame, place] = np.fmax(shown[frame, place], evidence_of["score"])
    return shown


def evidence_lines(evidence: Iterable[Sequence[Mapping[str, Any]]]) -> tuple[EvidenceLine, ...]:
    """The evidence of some frames by sensor and check, the sensor with the largest z first.

    A check that a frame has of several views counts with its largest z, and so do checks that say it in the same words.
    """
    scores: defaultdict[_Subject, list[float]] = defaultdict(list)
    checks: dict[_Subject, str] = {}
    for of_frame in evidence:
        largest: dict[_Subject, float] = {}
        for evidence_of in of_frame:
            other, check = evidence_of["k"], evidence_of["check_name"]
            subject = evidence_of["i"], other, found_of(check, by_two=other is not None)
            checks.setdefault(subject, check)
            largest[subject] = max(evidence_of["score"], largest.get(subject, evidence_of["score"]))
        for subject, value in largest.items():
            scores[subject].append(value)
    lines = [
        EvidenceLine(checks[subject], subject[0], subject[1], len(values), fmean(values), max(values))
        for subject, values in scores.items()
    ]
    strongest: dict[int, float] = {}
    for line in lines:
        strongest[line.sensor] = max(line.largest, strongest.get(line.sensor, line.largest))
    return tuple(sorted(lines, key=lambda line: (-strongest[line.sensor], line.sensor, -line.largest)))


MARGIN_NS = 2 * NS_PER_S
MARGIN_SHARE = 0.5
"""Before and after an incident at least so much is drawn: 2 s, and half of its duration."""

MOST_STATES = 3
"""Different e vectors, and reasons, that an incident's text gives."""

MOST_CHARTS = 8
"""Sensors that an incident draws: those whose z exceeds the limit in most of its frames."""


@dataclass(frozen=True, eq=False)
class ThresholdComparison:
    """What a judgement compared with its thresholds: disparity errors E by triple, or the largest z by sensor.

    `values` are (F, C), one column a curve, NaN where not measured; `frames` the (F,) frame numbers. `curves` are
    without values.
    """

    frames: NDArray[np.int64]
    values: NDArray[np.float64]
    curves: Sequence[Series]


class Timeline:
    """The frames of one judged recording, ready to be drawn."""

    def __init__(self, part: RecordingPart, measured: ThresholdComparison, frames: Sequence[dict[str, Any]]) -> None:
        self._part = part
        self._frames = frames
        self._robust = part.provenance.method == Method.ROBUST
        self._stamps_ns: list[int] = [frame["stamp_ns"] for frame in frames]
        places = {frame: place for place, frame in enumerate(measured.frames.tolist())}
        self._values = measured.values[[places[frame["frame"]] for frame in frames]]
        self._curves = measured.curves

    def overview(self) -> Figure:
        """The verdicts of all frames, and the ground truth where there is one."""
        return draw(self._stamps_ns, origin_ns=self._part.clock.origin_ns, rows=self._rows(slice(None)))

    def drawn(self, incident: IncidentPart) -> IncidentPart:
        """The incident with its figure, and with its frames' verdicts."""
        own = self._own(incident)
        return replace(
            incident,
            figure=self._figure(incident),
            checks=evidence_lines(frame["evidence"] or () for frame in own) if self._robust else (),
            states=tuple(Counter(frame["e"] for frame in own).most_common(MOST_STATES)),
            reasons=tuple(Counter(frame["reason"] for frame in own if frame["reason"]).most_common(MOST_STATES)),
        )

    def frames_of(self, incident: IncidentPart) -> set[int]:
        """The numbers of its frames."""
        return {frame["frame"] for frame in self._own(incident)}

    def agreement(self) -> LabelAgreement:
        """Compare verdicts with the ground truth, frame by frame."""
        labelled = [frame for frame in self._frames if frame["truth"]]
        others = [frame for frame in self._frames if not frame["truth"]]
        return LabelAgreement(
            labelled=len(labelled),
            exact=sum(
                frame["kind"] == VerdictKind.ATTACKED and frame["attacked"] == frame["truth"] for frame in labelled
            ),
            unlabelled=len(others),
            raised=sum(frame["kind"] in FINDINGS for frame in others),
        )

    def remarks(self) -> tuple[Remark, ...]:
        """What the verdicts without a finding add, the most frequent first."""
        counts = Counter(
            (VerdictKind(frame["kind"]), frame["reason"])
            for frame in self._frames
            if frame["reason"] and frame["kind"] not in FINDINGS
        )
        return tuple(Remark(kind, reason, frames) for (kind, reason), frames in counts.most_common())

    def _own(self, incident: IncidentPart) -> list[dict[str, Any]]:
        return [frame for frame in self._frames[self._around(incident, 0)] if self._belongs(frame, incident)]

    def _around(self, incident: IncidentPart, margin_ns: float) -> slice:
        bounds = [incident.from_ns - margin_ns, incident.to_ns + margin_ns + 1]
        low, high = np.searchsorted(np.array(self._stamps_ns), bounds)
        return slice(int(low), int(high))

    def _figure(self, incident: IncidentPart) -> Figure:
        """E against theta or z against the limit, verdicts and e around an incident."""
        part = self._around(incident, max(MARGIN_NS, MARGIN_SHARE * (incident.to_ns - incident.from_ns)))
        return draw(
            self._stamps_ns[part],
            origin_ns=self._part.clock.origin_ns,
            series=[
                replace(curve, values=_or_none(self._values[part, place]))
                for place, curve in self._charted(self._around(incident, 0))
            ],
            rows=[*self._rows(part), *self._state_rows(part)],
            shaded=[(incident.from_ns, incident.to_ns)],
        )

    def _charted(self, during: slice) -> list[tuple[int, Series]]:
        """All triples; by the robust method all sensors, or of many those above the limit in most frames."""
        curves = list(enumerate(self._curves))
        if not self._robust or len(curves) <= MOST_CHARTS:
            return curves
        theta = np.array([np.nan if curve.theta is None else curve.theta for _, curve in curves], dtype=np.float64)
        above = np.count_nonzero(self._values[during] > theta, axis=0)
        return [curves[place] for place in sorted(np.argsort(-above, kind="stable")[:MOST_CHARTS].tolist())]

    def _belongs(self, frame: dict[str, Any], incident: IncidentPart) -> bool:
        whole = self._robust and incident.grade == "incident"  # frames of an alert are found each by itself
        kind, attacked = ("finding", "finding_attacked") if whole else ("kind", "attacked")
        within = incident.first_frame <= frame["frame"] <= incident.last_frame
        return within and frame[kind] == incident.kind and tuple(frame[attacked]) == incident.attacked

    def _rows(self, part: slice) -> list[StripRow]:
        stamps_ns, frames = self._stamps_ns[part], self._frames[part]
        rows = [
            StripRow(
                "verdict",
                stamps_ns,
                [frame["kind"] for frame in frames],
                [_sensors(frame["attacked"]) for frame in frames],
            )
        ]
        if self._robust:
            around = [frame["finding"] or "" for frame in frames]
            rows.append(
                StripRow("incident", stamps_ns, around, [_sensors(frame["finding_attacked"]) for frame in frames])
            )
        if self._part.truths:
            truth = ["truth" if frame["truth"] else "" for frame in frames]
            rows.append(StripRow("labelled", stamps_ns, truth, [_sensors(frame["truth"]) for frame in frames]))
        return rows

    def _state_rows(self, part: slice) -> list[StripRow]:
        """The states in e by triple; the fallback has a row where frames were judged by it."""
        stamps_ns, vectors = self._stamps_ns[part], [frame["e"] for frame in self._frames[part]]
        longest = max(map(len, vectors), default=0)
        return [
            StripRow("", stamps_ns, [e[place : place + 1] or "-" for e in vectors], (), triple)
            for place, triple in enumerate(self._part.triples[:longest])
        ]


def _or_none(values: NDArray[np.float64]) -> list[float | None]:
    return [None if np.isnan(value) else value for value in values.tolist()]


def _sensors(numbers: Sequence[int] | None) -> str:
    return ", ".join(f"S{number}" for number in numbers or ())
