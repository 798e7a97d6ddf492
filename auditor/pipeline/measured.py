"""A recording to be measured, what becomes of it, and how this auditor measures."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from auditor.measurement.checks.found import measuring_digest
from auditor.measurement.disparity.matchers import NO_NETWORK, Matcher, MatcherOptions
from auditor.model.measurement import Procedure, procedure_of
from auditor.model.pictures import Cells, Pictures, Sampling
from auditor.model.rig_kind import ComparedTo
from auditor.recordings import Location, Origin, located
from auditor.recordings.parameters import synchronising_digest
from auditor.store import StoredMeasurement

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
    cells: Cells = Cells.INCIDENTS
    given: "MeasureTask | None" = None

    def __str__(self) -> str:
        return str(self.recording)

    @property
    def location(self) -> Location:
        """Where its recording lies."""
        return located(self.recording)

    def declared(self) -> Origin:
        """What is given and what its path says of its origin. Raises SettingError where the path says no date."""
        pattern = self.path_pattern
        return self.origin.over(Origin.of_path(self.location.given, pattern)) if pattern else self.origin

    def at(self, location: Location) -> "MeasureTask":
        """The same of a copy of its recording."""
        return replace(self, recording=location, given=self)


@dataclass(frozen=True)
class Measured:
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
) -> Measured:
    """What is said of a recording that has these measurements."""
    return Measured(
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

    def __init__(self, cells: Cells) -> None:
        self._cells, self._sampling = cells, Sampling()

    def of(self, stamp_ns: int, *, unusual: bool) -> bool:
        """Whether the next frame's are; `unusual` says that a statistic of it is unusually large."""
        return self._sampling.takes(stamp_ns) or unusual or self._cells is Cells.ALL
