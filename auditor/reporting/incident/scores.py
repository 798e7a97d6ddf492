"""The scores of the robust method by sensor: what the incident page draws, and what an incident's evidence was."""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from statistics import fmean
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auditor.model.checks import SensorCheck, counting_checks
from auditor.reporting.incident.page import EvidenceLine

_Subject = tuple[int, int | None, str]
"""The sensor of a check, the other one where two alone do not see the same, and the name of the check."""


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


def evidence_lines(evidence: Iterable[Sequence[Mapping[str, Any]]]) -> tuple[EvidenceLine, ...]:
    """The evidence of some frames by sensor and check, the sensor with the largest z first.

    A check that a frame has of several views counts with its largest z.
    """
    scores: defaultdict[_Subject, list[float]] = defaultdict(list)
    for of_frame in evidence:
        largest: dict[_Subject, float] = {}
        for one in of_frame:
            subject = one["i"], one["k"], one["check_name"]
            largest[subject] = max(one["score"], largest.get(subject, one["score"]))
        for subject, value in largest.items():
            scores[subject].append(value)
    lines = [
        EvidenceLine(check, sensor, other, len(values), fmean(values), max(values))
        for (sensor, other, check), values in scores.items()
    ]
    strongest: dict[int, float] = {}
    for line in lines:
        strongest[line.sensor] = max(line.largest, strongest.get(line.sensor, line.largest))
    return tuple(sorted(lines, key=lambda line: (-strongest[line.sensor], line.sensor, -line.largest)))
