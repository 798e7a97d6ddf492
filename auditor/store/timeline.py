"""The frames of one judged recording over time: what the incident page draws and counts of them."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from auditor.results import FINDINGS, VerdictKind
from auditor.store.page import Agreement, IncidentPart, RecordingPart, Remark
from auditor.store.plots import NS_PER_S, Figure, Row, Series, draw
from auditor.store.records import FrameErrors

MARGIN_NS = 2 * NS_PER_S
MARGIN_SHARE = 0.5
"""Before and after an incident at least so much is drawn: 2 s, and half of its duration."""

MOST_STATES = 3
"""Different e vectors, and reasons, that an incident's text gives."""


class Timeline:
    """The frames of one judged recording, ready to be drawn."""

    def __init__(self, part: RecordingPart, errors: FrameErrors, frames: Sequence[dict[str, Any]]) -> None:
        self._part = part
        self._frames = frames
        self._stamps_ns: list[int] = [frame["stamp_ns"] for frame in frames]
        places = {frame: place for place, frame in enumerate(errors.frames.tolist())}
        self._E = errors.E[[places[frame["frame"]] for frame in frames]]

    def overview(self) -> Figure:
        """The verdicts of all frames, and the ground truth where there is one."""
        return draw(self._stamps_ns, origin_ns=self._part.clock.origin_ns, rows=self._rows(slice(None)))

    def drawn(self, incident: IncidentPart) -> IncidentPart:
        """The incident with its figure, and with what its frames' verdicts say."""
        own = [frame for frame in self._frames[self._around(incident, 0)] if _belongs(frame, incident)]
        return replace(
            incident,
            figure=self._figure(incident),
            states=tuple(Counter(frame["e"] for frame in own).most_common(MOST_STATES)),
            reasons=tuple(Counter(frame["reason"] for frame in own if frame["reason"]).most_common(MOST_STATES)),
        )

    def agreement(self) -> Agreement:
        """Compare verdicts with the ground truth, frame by frame."""
        labelled = [frame for frame in self._frames if frame["truth"]]
        others = [frame for frame in self._frames if not frame["truth"]]
        return Agreement(
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

    def _around(self, incident: IncidentPart, margin_ns: float) -> slice:
        bounds = [incident.from_ns - margin_ns, incident.to_ns + margin_ns + 1]
        low, high = np.searchsorted(np.array(self._stamps_ns), bounds)
        return slice(int(low), int(high))

    def _figure(self, incident: IncidentPart) -> Figure:
        """E against theta, verdicts and e around an incident."""
        part = self._around(incident, max(MARGIN_NS, MARGIN_SHARE * (incident.to_ns - incident.from_ns)))
        thresholds = self._part.provenance.thresholds
        return draw(
            self._stamps_ns[part],
            origin_ns=self._part.clock.origin_ns,
            series=[
                Series(line.triple, [None if np.isnan(E) else E for E in self._E[part, place].tolist()], line.theta)
                for place, line in enumerate(thresholds)
            ],
            rows=[*self._rows(part), *self._element_rows(part)],
            shaded=[(incident.from_ns, incident.to_ns)],
        )

    def _rows(self, part: slice) -> list[Row]:
        stamps_ns, frames = self._stamps_ns[part], self._frames[part]
        rows = [
            Row(
                "verdict",
                stamps_ns,
                [frame["kind"] for frame in frames],
                [_sensors(frame["attacked"]) for frame in frames],
            )
        ]
        if self._part.truths:
            truth = ["truth" if frame["truth"] else "" for frame in frames]
            rows.append(Row("labelled", stamps_ns, truth, [_sensors(frame["truth"]) for frame in frames]))
        return rows

    def _element_rows(self, part: slice) -> list[Row]:
        stamps_ns, vectors = self._stamps_ns[part], [frame["e"] for frame in self._frames[part]]
        return [
            Row("", stamps_ns, [e[place] for e in vectors], (), triple)
            for place, triple in enumerate(self._part.triples)
        ]


def _belongs(frame: dict[str, Any], incident: IncidentPart) -> bool:
    return frame["kind"] == incident.kind and tuple(frame["attacked"]) == incident.attacked


def _sensors(numbers: Sequence[int]) -> str:
    return ", ".join(f"S{number}" for number in numbers)
