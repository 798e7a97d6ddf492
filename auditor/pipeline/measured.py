"""A recording to be measured, what becomes of it, and which files a store knows already."""

import hashlib
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from itertools import groupby
from operator import itemgetter
from pathlib import Path

from auditor.measurement.checks.found import measuring_digest
from auditor.measurement.disparity.matchers import NO_NETWORK, Matcher, MatcherOptions, find_matcher
from auditor.model.measurement import Procedure, procedure_of
from auditor.model.pictures import CellRetention, Pictures, Sampling
from auditor.model.rig_kind import ComparedTo
from auditor.model.text import storable
from auditor.pipeline.remote.finding import parts_of, together
from auditor.recordings import Location, Origin, located
from auditor.recordings.location import StoredObject
from auditor.recordings.parameters import synchronising_digest
from auditor.store.records import RecordingRecord, Sighting, StoredMeasurement, content_id
from auditor.store.store import Store

_UNKNOWN = Origin()


@dataclass(frozen=True)
class MeasureTask:
    """One recording to be measured into a store.

    `rig` is a rig.toml in place of the recording's own calibration. What `origin` knows of its vehicle, day, drive and
    weather goes before what its path says by `path_pattern`, and that before what the recording says. `again` measures
    also what the store has, and replaces it, as it does what was counted in an earlier way. `pictures` says of which
    frames a picture may be kept: those of incidents are frames in which a statistic is unusually large, since measuring
    knows no verdicts; so does `cells`. `given` is the task of the batch, where this is one of a copy of its recording.
    """

    recording: Path | Location
    store: Path
    matcher: str = "sgbm"
    network: MatcherOptions = NO_NETWORK
    rig: Path | None = None
    origin: Origin = _UNKNOWN
    path_pattern: str | None = None
    again: bool = False
    pictures: Pictures = Pictures.ALL
    cells: CellRetention = CellRetention.INCIDENTS
    given: "MeasureTask | None" = None

    def __str__(self) -> str:
        return str(self.recording)

    @property
    def location(self) -> Location:
        """Where its recording lies."""
        return located(self.recording)

    @property
    def size_bytes(self) -> int:
        """The bytes of its recording; 0 where they cannot be known, which is its own error later on."""
        try:
            return self.location.size_bytes
        except OSError:
            return 0

    def declared(self) -> Origin:
        """What is given and what its path says of its origin. Raises SettingError where the path says no date."""
        pattern = self.path_pattern
        return self.origin.over(Origin.of_path(self.location.given, pattern)) if pattern else self.origin

    def at(self, location: Location) -> "MeasureTask":
        """The same of a copy of its recording."""
        return replace(self, recording=location, given=self)


@dataclass(frozen=True)
class MeasureResult:
    """A recording that is in the store: its measurements, one a rig, and whether any of it was measured just now."""

    recording: Path | Location
    recording_id: str
    measurement_ids: tuple[str, ...]
    frames: int
    fresh: bool
    damage: tuple[str, ...]
    calibration_warnings: tuple[str, ...]
    remarks: tuple[str, ...] = ()


def measured_of(
    path: Path | Location, recording_id: str, measurements: Sequence[StoredMeasurement], *, fresh: bool = False
) -> MeasureResult:
    """What is said of a recording that has these measurements."""
    return MeasureResult(
        recording=path,
        recording_id=recording_id,
        measurement_ids=tuple(one.measurement_id for one in measurements),
        frames=sum(one.frames for one in measurements),
        fresh=fresh,
        damage=damage_of(measurements),
        calibration_warnings=tuple(dict.fromkeys(said for one in measurements for said in one.calibration_warnings)),
        remarks=tuple(dict.fromkeys(said for one in measurements for said in one.remarks)),
    )


def damage_of(measurements: Sequence[StoredMeasurement]) -> tuple[str, ...]:
    """The damage that measurements of one recording met, each piece once."""
    return tuple(dict.fromkeys(piece for one in measurements for piece in one.damage))


def procedure_by(matcher: Matcher, compared_to: ComparedTo) -> Procedure:
    """How this auditor measures with a matcher what a rig compares."""
    measuring, synchronising = measuring_digest(compared_to), synchronising_digest()
    return procedure_of(matcher.name, matcher.settings, compared_to, measuring=measuring, synchronising=synchronising)


def procedures_by(matcher: Matcher) -> tuple[Procedure, ...]:
    """How this auditor measures with a matcher, whatever a rig compares."""
    return tuple(procedure_by(matcher, compared_to) for compared_to in ComparedTo)


class CellsKept:
    """Chooses, among the frames of a recording in the order of their stamps, those whose cells are kept."""

    def __init__(self, cells: CellRetention) -> None:
        self._cells, self._sampling = cells, Sampling()

    def of(self, stamp_ns: int, *, unusual: bool) -> bool:
        """Whether the next frame's are; `unusual` says that a statistic of it is unusually large."""
        return self._sampling.takes(stamp_ns) or unusual or self._cells is CellRetention.ALL


FEW = 50
"""So many measurements are read one by one, and more of them all at once."""


def stamp_of(where: Path | Location, procedures: Sequence[Procedure], rig: Path | None) -> str | None:
    """A hash of a recording's files, unread, of how it is measured, and of a rig file; None where files are gone."""
    with suppress(OSError):
        rig_file = hashlib.sha256(rig.read_bytes()).hexdigest() if rig is not None else None
        return content_id("files", located(where).identity, [list(vars(one).values()) for one in procedures], rig_file)
    return None


def sighted(
    before: Sequence[Sighting], name: str, place: str, stamp: str | None, measured: Sequence[str]
) -> tuple[Sighting, ...]:
    """The names and places that a content was read under, after it was read under these, in order."""
    now = [one for one in before if (one.name, one.path) == (name, place)]
    seen = now[0] if now else Sighting(name, place, datetime.now(UTC))
    read = replace(seen, stamp=stamp, measurements=tuple(measured))
    return (*(read if one == seen else one for one in before), *([] if now else [read]))


class KnownFiles:
    """The files of some tasks for one store, of which it knows some."""

    def __init__(self, tasks: Sequence[MeasureTask], store: Store | None, *, read_again: bool) -> None:
        self._seen: dict[str, list[tuple[RecordingRecord, Sighting]]] = {}
        """By path; what lies on an object store by its stamp, which has its addresses in it."""
        if store is None or read_again:
            return
        self._store = store
        self._procedures = procedures_by(find_matcher(tasks[0].matcher, tasks[0].network))
        if len(tasks) > FEW:
            self._store.measurements()  # at once: that takes far less than one by one
        for record in self._store.recordings():
            for sighting in record.sightings:
                for place in (sighting.path, *([sighting.stamp] if sighting.stamp else ())):
                    self._seen.setdefault(place, []).append((record, sighting))

    def found(self, task: MeasureTask) -> Iterator[tuple[MeasureTask, MeasureResult | None]]:
        """The recordings that a task is, as far as the store knows, and what it has of each: objects that by their
        names may be parts of a drive are one task, until copies of them are looked into.

        What is not known may go on with the recording before it, or with the one behind it: these are read with it.
        """
        result, remote = self.measured(task), task.location.remote
        parts = parts_of(remote) if self._seen and result is None and remote is not None else ()
        pieces = list(self._pieces(task, parts))
        is_known = [True, *(one is not None for _, one in pieces), True]
        stays = [all(is_known[place : place + 3]) for place in range(len(pieces))]
        if not any(stays):
            yield task, result
            return
        for alone, run in groupby(zip(stays, pieces, strict=True), key=itemgetter(0)):
            those = [piece for _, piece in run]
            if alone:
                yield from ((_of(task, some), one) for some, one in those)
            else:
                yield _of(task, [part for some, _ in those for part in some]), None

    def _pieces(
        self, task: MeasureTask, parts: Sequence[StoredObject]
    ) -> Iterator[tuple[Sequence[StoredObject], MeasureResult | None]]:
        """Parts, in their order: those that are known as one recording together, as many as there are, else each."""
        first = 0
        while first < len(parts):
            runs = (parts[first:end] for end in range(len(parts), first, -1))
            pieces = ((run, result) for run in runs if (result := self.measured(_of(task, run))) is not None)
            piece = next(pieces, (parts[first : first + 1], None))
            yield piece
            first += len(piece[0])

    def measured(self, task: MeasureTask) -> MeasureResult | None:
        """What the store has of a recording whose files are as they were when it read them; None where they are not."""
        if not self._seen:
            return None
        location = task.location
        if location.remote is not None:
            stamp = stamp_of(location, self._procedures, task.rig)
            seen: Sequence[tuple[RecordingRecord, Sighting]] = self._seen.get(stamp or "", ())
        else:
            seen = self._seen.get(storable(location.place), ())
            stamp = stamp_of(location, self._procedures, task.rig) if seen else None
        for record, sighting in seen:
            if sighting.stamp is None or sighting.stamp != stamp or _tells_more(task.declared(), record):
                continue
            if sighting.measurements and all(map(self._store.has_measurement, sighting.measurements)):
                measurements = [self._store.measurement(measurement) for measurement in sighting.measurements]
                return measured_of(location.here, record.recording_id, measurements)
        return None


def _of(task: MeasureTask, parts: Sequence[StoredObject]) -> MeasureTask:
    """The task of some of its objects."""
    return replace(task, recording=together(parts))


def _tells_more(origin: Origin, record: RecordingRecord) -> bool:
    """Whether an origin that is given is another than the store's."""
    store_origin = Origin(record.vehicle, record.date, record.drive)
    return origin.over(store_origin) != store_origin
