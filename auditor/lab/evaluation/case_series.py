"""The series around each case of an evaluation: its drive as a scan would see it, with only this case attacked.

Only the frame of the case differs from the clean drive, or the frames of its interval, whose cases share a series.

An attacked frame also changes the fault features of the clean frame after it, which are taken between the two.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from auditor.identification.evidence_parameters import INCIDENTS, STRETCHES
from auditor.identification.faults import LONGEST_WINDOW_S, fault_scores
from auditor.identification.incidents.sequential import QUIET_FRAMES
from auditor.identification.incidents.series import FrameSeries
from auditor.identification.parameters import LIGHT_OF_CAUSES
from auditor.identification.statistics import MIN_FRAMES, frozen, runs_of, window_bounds
from auditor.identification.systems import System
from auditor.model.arrays import Indices, Integers, Mask
from auditor.model.calibration import CleanFrames
from auditor.model.checks import rig_sensor_checks
from auditor.model.fault_features import COLUMNS, ObservedFeatures
from auditor.model.rig import LIDAR
from auditor.store.case_arrays import Cases, Floats
from auditor.store.evaluation_tables import INTERVAL_FRAMES, LASTING

Scalar = TypeVar("Scalar", bound=np.generic)


@dataclass(frozen=True, eq=False)
class _Drive:
    """The F clean cases of one drive in their order: places among all cases, stamps and runs (F,), row by frame.

    `first` and `end` (F,) bound what the verdict on a frame can depend on, and an incident of it.
    """

    places: Indices
    stamps_ns: Integers
    runs: Integers
    row_of: dict[int, int]
    first: Indices
    end: Indices


@dataclass(frozen=True, eq=False)
class _Part:
    """Part of a drive: by row (R,) the place of the case that is there, with its features.

    `judged` are the rows of the cases that it is made for, by their place.
    """

    places: Indices
    features: Floats
    stamps_ns: Integers
    runs: Integers
    judged: dict[int, int]


@dataclass(frozen=True, eq=False)
class CleanSeries:
    """The F clean frames of a drive; `blocks` (F,) are the blocks of time that they belong to."""

    family: str
    blocks: Integers
    frames: CleanFrames

    def without(self, block: int) -> CleanFrames:
        """The frames of the other blocks."""
        kept, frames = self.blocks != block, self.frames
        return CleanFrames(
            frames.recording_id,
            frames.stamps_ns[kept],
            {},
            {check: values[kept] for check, values in frames.statistics.items()},
            {cause: scores[kept] for cause, scores in frames.strengths.items()},
            returns=frames.returns[kept] if frames.returns.size else frames.returns,
        )


class CaseSeries:
    """The series of all cases of one setup."""

    def __init__(self, cases: Cases) -> None:
        self._cases = cases
        rows: dict[tuple[str, str], list[int]] = defaultdict(list)
        self._intervals: dict[tuple[object, ...], list[int]] = defaultdict(list)
        for place, case in enumerate(cases.known):
            if case.experiment == "clean":
                rows[case.drive].append(place)
            elif case.experiment == "intervals":
                self._intervals[self._interval(place)].append(place)
        self._drives = {drive: self._drive(places) for drive, places in rows.items()}

    def has(self, place: int) -> bool:
        """True where the frame of the case at this place was also measured clean, so that it has a drive around it."""
        case = self._cases.known[place]
        return case.drive in self._drives and case.frame in self._drives[case.drive].row_of

    def clean(self, system: System) -> list[CleanSeries]:
        """The clean frames of each drive, as thresholds are learnt from them."""
        return [self._clean(drive, system) for drive in self._drives.values()]

    def _clean(self, drive: _Drive, system: System) -> CleanSeries:
        cases = [self._cases.known[place] for place in drive.places]
        statistics = self._statistics(drive.places, system)
        features = self._cases.features[drive.places]
        frames = CleanFrames(
            cases[0].recording_id,
            drive.stamps_ns,
            {},
            dict(zip(system.sensor_checks, statistics.T, strict=True)),
            fault_scores(self._observed(system, drive.places, features), drive.stamps_ns, system.sensors, drive.runs),
            returns=self._cases.returns[drive.places] if LIDAR in system.sensors else np.zeros(0),
        )
        return CleanSeries(cases[0].family, np.array([one.block[1] for one in cases], dtype=np.int64), frames)

    def series(self, chosen: Sequence[int], system: System) -> tuple[FrameSeries, list[int]]:
        """The parts of drives around the cases at these places, one after the other, and the row of each case.

        Clean cases share their whole drive, and those of one interval what lies around it: incidents are of many
        frames. `system` may have fewer sensors than the rig.
        """
        together: dict[tuple[object, ...], list[int]] = defaultdict(list)
        for place in chosen:
            together[self._shared(place)].append(place)
        # Backwards in time: a frame of one part is never taken for what follows on another's last (`bounds_nearby`).
        parts = sorted(map(self._part, together.values()), key=lambda part: -int(part.stamps_ns[0]))
        lengths = [len(part.places) for part in parts]
        places = np.concatenate([part.places for part in parts])
        stamps = np.concatenate([part.stamps_ns for part in parts])
        most = 1 + max(int(part.runs.max()) for part in parts)
        runs = np.repeat(np.arange(len(parts)) * most, lengths) + np.concatenate([part.runs for part in parts])
        seen = self._observed(system, places, np.concatenate([part.features for part in parts]))
        series = FrameSeries(
            stamps,
            runs,
            self._statistics(places, system),
            self._of_sensors(self._cases.present, places, system),
            np.concatenate([self._frozen(part.places, system) for part in parts]),
            fault_scores(seen, stamps, system.sensors, runs),
            seen.by_camera,
            agreeing=seen.agreeing,
        )
        starts = np.cumsum([0, *lengths[:-1]]).tolist()
        rows = {
            place: start + row for start, part in zip(starts, parts, strict=True) for place, row in part.judged.items()
        }
        return series, [rows[place] for place in chosen]

    def _shared(self, place: int) -> tuple[object, ...]:
        """The key of the cases that are judged in one series."""
        case = self._cases.known[place]
        if case.experiment == "clean":
            return case.experiment, case.drive
        return self._interval(place) if case.experiment == "intervals" else (place,)

    def _part(self, judged: Sequence[int]) -> _Part:
        """The part of a drive around cases that share a series."""
        case = self._cases.known[judged[0]]
        drive = self._drives[case.drive]
        together = list(judged) if case.experiment != "clean" else []
        if case.experiment == "intervals":
            together = self._intervals[self._interval(judged[0])]
        rows = [drive.row_of[self._cases.known[place].frame] for place in (together or judged)]
        first, end = int(drive.first[min(rows)]), int(drive.end[max(rows)])
        if case.experiment == "clean":
            first, end = 0, len(drive.places)
        places, features = drive.places[first:end].copy(), self._cases.features[drive.places[first:end]]
        changed = {drive.row_of[self._cases.known[other].frame] - first: other for other in together}
        for at, other in changed.items():
            places[at], features[at] = other, self._cases.features[other]
            if at + 1 < end - first and at + 1 not in changed:
                features[at + 1] = self._cases.features_after[other]
        own = {place: drive.row_of[self._cases.known[place].frame] - first for place in judged}
        return _Part(places, features, drive.stamps_ns[first:end], drive.runs[first:end], own)

    def _observed(self, system: System, places: Indices, features: Floats) -> ObservedFeatures:
        pairs = self._cases.rig.pairs
        chosen = [at for at, pair in enumerate(pairs) if set(pair) <= set(system.sensors)]
        cameras = tuple(sensor for sensor in system.sensors if sensor != LIDAR)
        columns = {name: features[:, chosen, at] for at, name in enumerate(COLUMNS)}
        brightness = {
            name: self._of_sensors(values, places, system)[:, -len(cameras) :]
            for name, values in self._cases.brightness.items()
        }
        return ObservedFeatures(tuple(pairs[at] for at in chosen), columns, cameras, brightness)

    def _statistics(self, places: Indices, system: System) -> Floats:
        """(R, M) the statistics of a system's sensor checks at these places."""
        place_of = {check: at for at, check in enumerate(rig_sensor_checks(self._cases.rig))}
        return np.asarray(self._cases.statistics[places][:, [place_of[check] for check in system.sensor_checks]])

    def _frozen(self, places: Indices, system: System) -> Mask:
        present = self._of_sensors(self._cases.present, places, system)
        return frozen(self._of_sensors(self._cases.fingerprints, places, system), present)

    def _of_sensors(self, values: NDArray[Scalar], places: Indices, system: System) -> NDArray[Scalar]:
        """The columns of a system's sensors at these places."""
        columns = [at for at, sensor in enumerate(self._cases.rig.sensors) if sensor in system.sensors]
        return np.asarray(values[places][:, columns])

    def _interval(self, place: int) -> tuple[object, ...]:
        """The key that the cases of one interval share, or of all intervals where an attack lasts."""
        case = self._cases.known[place]
        where = (case.drive,) if case.strength == LASTING else (case.evaluation_id, case.frame // INTERVAL_FRAMES)
        return *where, case.draw, case.attacked, case.strength

    def _drive(self, unordered: Sequence[int]) -> _Drive:
        places = np.array(sorted(unordered, key=lambda place: self._cases.known[place].frame), dtype=np.intp)
        cases = [self._cases.known[place] for place in places]
        stamps = np.array([one.stamp_ns for one in cases], dtype=np.int64)
        runs = runs_of(stamps)
        first, end = window_bounds(stamps, _around_s(), runs)
        # Whether a frame's sensors are frozen follows from the frames beside it, also across a gap.
        wider = max(MIN_FRAMES + 1, QUIET_FRAMES + STRETCHES.fewest_frames)
        row_of = {one.frame: row for row, one in enumerate(cases)}
        return _Drive(places, stamps, runs, row_of, np.maximum(first - wider, 0), np.minimum(end + wider, len(places)))


def _around_s() -> float:
    """The seconds around a case that its verdict and its incident follow from: half of them before it."""
    of_incidents = 2 * (INCIDENTS.quiet_s + STRETCHES.seconds)
    return max(LONGEST_WINDOW_S, LIGHT_OF_CAUSES.nearby_s, 2 * LIGHT_OF_CAUSES.further_s, of_incidents)
