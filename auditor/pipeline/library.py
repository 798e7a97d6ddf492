"""The functions of `import auditor`: the steps of an audit with plain arguments, each a few lines over the rooms.

Keywords have the names, meanings and defaults of the options of the command line. Paths may be text.
"""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from decimal import Decimal
from pathlib import Path
from typing import TypeVar

from auditor import recordings as reading
from auditor.errors import AuditorError, SettingError, StoreError
from auditor.identification.thresholds import parse_r
from auditor.measurement import measure as measure_frame
from auditor.measurement.disparity.matchers import NO_NETWORK, Matcher, MatcherOptions, find_matcher
from auditor.model.calibration import Calibration
from auditor.model.frames import Frame
from auditor.model.measurement import Measurement, Statistic
from auditor.model.pictures import Pictures
from auditor.model.rig import Rig
from auditor.model.verdict import Method
from auditor.pipeline.asking import PathLike, opened
from auditor.pipeline.calibrations.making import make
from auditor.pipeline.calibrations.names import named_calibration
from auditor.pipeline.calibrations.versions import keep_calibrated
from auditor.pipeline.judge import Criteria
from auditor.pipeline.many import (
    Batch,
    Judged,
    JudgeSettings,
    MeasureSettings,
    choose_clean,
    find_batch,
    limits_by_size,
    measure_all,
)
from auditor.pipeline.measure import in_force, rigs_through
from auditor.pipeline.measured import Measured
from auditor.pipeline.scan import Scan
from auditor.pipeline.side_by_side import judge_side_by_side
from auditor.pipeline.workers import MEMORY_MB
from auditor.recordings import FrameStream, Recording
from auditor.store import Store
from auditor.store.log import logged
from auditor.store.maintenance.relations import relate

Rate = Decimal | float | str
"""The designated false-alarm rate r: 0.01, "0.01" or "1%"."""
Choice = TypeVar("Choice", Method, Statistic)
Progress = Callable[[object, str, int], None]
"""Called with a recording, what is being done, and the number of frames done (0: it is a remark)."""

_USUAL_R = Decimal("0.01")
"""The r that a calibration's rates by others are kept for."""


# Reading and measuring


def open_recording(path: PathLike) -> Recording:
    """Open one recording (a file or a folder) for reading, as a context manager.

    Raises RecordingError where it is missing, empty, unreadable or of no known kind.
    """
    return reading.open_recording(Path(path))


def find_rigs(recording: Recording, rig_file: PathLike | None = None) -> tuple[Rig, ...]:
    """The rigs of a recording: from its calibration and transforms, or the one of a rig.toml or camchain.yaml.

    Where its calibration changes, the rigs that come into force later follow those of its beginning. Raises RigError
    where no three sensors overlap, or where the rig file does not fit the recording.
    """
    path = Path(rig_file) if rig_file is not None else None
    return tuple(one.rig for one in rigs_through(recording, reading.survey(recording), path).rigs)


def synchronise(recording: Recording, rig: Rig, *, colour: bool = False) -> FrameStream:
    """The frames of a recording, in order; each iteration reads it again. What cannot be a frame comes as `Skipped`.

    A rig of `find_rigs` has the frames of the time in which it is in force, any other rig has all. Images are (H, W)
    uint8 grey, or (H, W, 3) BGR where `colour`; clouds are (N, 3) float32 in metres.
    """
    found = in_force(recording, reading.survey(recording), rig)
    return reading.synchronise(recording, rig, found.survey, colour=colour, stretches=found.stretches)


def measure(frame: Frame, rig: Rig, matcher: Matcher | str = "sgbm") -> Measurement:
    """Count the inconsistent pixels of every triple (Eq. 2), and the counts of the nine checks.

    `counts` follow `rig.measured_triples`, None where a sensor was missing. Raises RigError where the cameras have no
    view in common, and SettingError for an unknown matcher.
    """
    found = find_matcher(matcher) if isinstance(matcher, str) else matcher
    return measure_frame(frame, rig, found)[0]


# Calibrating, scanning, judging


@dataclass(frozen=True)
class Calibrated:
    """A calibration, which the store keeps, a sentence for each recording left out of it, and what went wrong."""

    calibration: Calibration
    left_out: tuple[str, ...]
    errors: tuple[AuditorError, ...]


@dataclass(frozen=True)
class Scanned:
    """What became of one recording: measured and judged once for each of its rigs, or the error that ended it."""

    recording: str
    measured: Measured | None = None
    judged: tuple[Judged, ...] = ()
    error: AuditorError | None = None

    @property
    def found(self) -> bool:
        """True where frames belong to an incident or an alert."""
        return any(one.found for one in self.judged)

    @property
    def complete(self) -> bool:
        """True where everything was measured and judged: only then does nothing found mean clean."""
        return bool(self.judged) and all(one.complete for one in self.judged)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences about the recording's calibration, its gaps, and the thresholds."""
        measured = self.measured.calibration_warnings if self.measured else ()
        return (*measured, *(warning for one in self.judged for warning in one.warnings))


def calibrate(
    sources: PathLike | Iterable[PathLike],
    *,
    store: PathLike = "audit",
    frames: range | None = None,
    matcher: str = "sgbm",
    network: MatcherOptions = NO_NETWORK,
    rig: PathLike | None = None,
    jobs: int | None = None,
    time_limit: float | None = None,
    memory_limit: float = MEMORY_MB,
    measure_again: bool = False,
    on_progress: Progress | None = None,
) -> Calibrated:
    """Make thresholds from recordings that are known to be clean, or from the clean measurements of stores.

    They are measured into `store`, which keeps the calibration; the first of a rig kind is in force, later ones are
    once somebody promotes them. `frames` restricts it to these frame numbers of each.
    Raises ThresholdsError where nothing clean remains or rig kinds differ, SettingError, RigError and StoreError.
    """
    paths = _paths(sources)
    folder, stores = Path(store), [Store.open(path) for path in paths if Store.is_at(path)]
    settings = _settings(matcher, network, rig, jobs, time_limit, memory_limit, again=measure_again)
    batch = find_batch([path for path in paths if not Store.is_at(path)], folder, settings)
    kept = Store.open(folder, create=True)
    with logged(kept.folder):
        outcomes = list(measure_all(batch, on_progress or _silent))
        relate(kept)
        given = [(kept, one) for outcome in outcomes if outcome.result for one in outcome.result.measurement_ids]
        clean = choose_clean(given, stores)
        made = make(clean, _USUAL_R, frames, jobs=settings.jobs)
        keep_calibrated(kept, made)
    failed = (outcome.error for outcome in outcomes if outcome.error is not None)
    return Calibrated(made.calibration, clean.left_out, (*batch.errors, *failed))


def scan(
    recordings: PathLike | Iterable[PathLike],
    *,
    store: PathLike = "audit",
    calibration: str | None = None,
    r: Rate = "0.01",
    method: Method | str = Method.ROBUST,
    statistic: Statistic | str = Statistic.GATED,
    incidents_per_hour: float | None = None,
    transfer: bool = False,
    strict: bool = False,
    recount: bool = False,
    min_coverage: float = 0.99,
    no_sensors: Iterable[str] = (),
    matcher: str = "sgbm",
    network: MatcherOptions = NO_NETWORK,
    rig: PathLike | None = None,
    jobs: int | None = None,
    time_limit: float | None = None,
    memory_limit: float = MEMORY_MB,
    measure_again: bool = False,
    verify_content: bool = False,
    pictures: Pictures | str = Pictures.ALL,
    on_progress: Progress | None = None,
) -> Iterator[Scanned]:
    """Audit recordings (files, or folders of them) as `auditor scan` does, and yield what became of each.

    What could not be measured comes first, as soon as it is known; the others once all are judged, in the order given:
    recordings may contradict one another. Parameters are named after the options of the command.

    `calibration` is an id of the store's, the beginning of one, or a file; None takes the one in force that fits, or
    the prior where none does. `jobs` recordings (None: as many as cores) are measured at a time, each in a process of
    its own that may take `memory_limit` MB and `time_limit` seconds. What the store has measured already is not
    measured again, unless `measure_again`; then the earlier measurement goes, with its judgements.

    `no_sensors` names topics that are neither cameras nor LiDARs, so that it does not matter that they cannot be read.

    A recording that fails is a `Scanned` with its error; the others go on. What is wrong with the call itself raises
    before any work: SettingError, ThresholdsError, RigError, StoreError.
    """
    folder = Path(store)
    judging = judge_settings(
        folder,
        calibration,
        r,
        method,
        statistic,
        incidents_per_hour,
        transfer=transfer,
        strict=strict,
        recount=recount,
        min_coverage=min_coverage,
        no_sensors=no_sensors,
    )
    settings = _settings(matcher, network, rig, jobs, time_limit, memory_limit, again=measure_again)
    settings = replace(settings, pictures=Pictures(pictures), verify_content=verify_content)
    return _scan(find_batch(_paths(recordings), folder, settings), folder, judging, on_progress or _silent)


def _scan(batch: Batch, folder: Path, judging: JudgeSettings, on_progress: Progress) -> Iterator[Scanned]:
    yield from (Scanned(error.where, error=error) for error in batch.errors)
    scan = Scan(batch, folder)
    with scan.logged():
        for outcome in scan.measure(on_progress):
            if outcome.result is None:
                yield Scanned(str(outcome.item), error=outcome.error)
        deque(scan.relate(), maxlen=0)
        judged = {one.measurement_id: one for one in scan.judge(judging)}
        deque(scan.finish(), maxlen=0)
    for one in scan.measured:
        yield Scanned(str(one.recording), one, tuple(judged[known] for known in one.measurement_ids))


def judge(
    store: Store | PathLike = "audit",
    *,
    calibration: str | None = None,
    r: Rate = "0.01",
    method: Method | str = Method.ROBUST,
    statistic: Statistic | str = Statistic.GATED,
    incidents_per_hour: float | None = None,
    transfer: bool = False,
    strict: bool = False,
    recount: bool = False,
    min_coverage: float = 0.99,
    no_sensors: Iterable[str] = (),
    jobs: int | None = None,
) -> Iterator[Judged]:
    """Judge every measurement of a store again, without its recordings, and yield what became of each.

    The new verdicts become the current ones. Many are judged by `jobs` processes at a time (None: as many as cores).
    Raises before any work: SettingError, ThresholdsError where no calibration has that name, and StoreError where
    nothing has been measured.
    """
    kept = opened(store)
    measurements = kept.ids("measurements")
    if not measurements:
        raise StoreError("nothing has been measured", where=kept.folder, remedy="measure recordings with auditor scan")
    settings = judge_settings(
        kept.folder,
        calibration,
        r,
        method,
        statistic,
        incidents_per_hour,
        transfer=transfer,
        strict=strict,
        recount=recount,
        min_coverage=min_coverage,
        no_sensors=no_sensors,
    )
    return judge_side_by_side(kept, measurements, settings, jobs)


def judge_settings(
    store: Path,
    calibration: str | None = None,
    r: Rate = "0.01",
    method: Method | str = Method.ROBUST,
    statistic: Statistic | str = Statistic.GATED,
    incidents_per_hour: float | None = None,
    *,
    transfer: bool = False,
    strict: bool = False,
    recount: bool = False,
    min_coverage: float = 0.99,
    no_sensors: Iterable[str] = (),
) -> JudgeSettings:
    """The settings of a call. Raises SettingError, and ThresholdsError for an unknown calibration."""
    criteria = Criteria(
        parse_r(str(r)),
        _one_of(Method, method),
        _one_of(Statistic, statistic),
        incidents_per_hour,
        transfer=transfer,
        strict=strict,
        recount=recount,
    )
    thresholds = named_calibration(store, calibration)
    return JudgeSettings(criteria, thresholds, min_coverage, no_sensors=frozenset(no_sensors))


def _one_of(kind: type[Choice], value: str) -> Choice:
    try:
        return kind(value)
    except ValueError:
        known = ", ".join(kind)
        raise SettingError(
            f"there is no {kind.__name__.lower()} {value!r}", where="judging", remedy=f"use one of: {known}"
        ) from None


def _settings(
    matcher: str,
    network: MatcherOptions,
    rig: PathLike | None,
    jobs: int | None,
    time_limit: float | None,
    memory_limit: float,
    *,
    again: bool,
) -> MeasureSettings:
    limits = limits_by_size(time_limit, memory_limit)
    settings = MeasureSettings(matcher, network, Path(rig) if rig is not None else None, limits=limits, again=again)
    return settings if jobs is None else replace(settings, jobs=jobs)


def _paths(sources: PathLike | Iterable[PathLike]) -> list[Path]:
    return [Path(sources)] if isinstance(sources, str | Path) else [Path(path) for path in sources]


def _silent(item: object, what: str, frames: int) -> None:
    """The default of `on_progress`."""
