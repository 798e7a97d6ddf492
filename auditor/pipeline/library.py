"""The functions of `import auditor`: the steps of an audit with plain arguments, each a few lines over the rooms.

Keywords that are settings have the meanings and defaults of the options of the command line. Paths may be text.
"""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar, Unpack

from auditor import recordings as reading
from auditor.errors import AuditorError, StoreError
from auditor.measurement import measure as measure_frame
from auditor.measurement.disparity.matchers import NO_NETWORK, Matcher, MatcherOptions, find_matcher
from auditor.model.calibration import Calibration
from auditor.model.frames import Frame
from auditor.model.measurement import Measurement
from auditor.model.rig import Rig
from auditor.model.settings import (
    Criteria,
    MeasureSettings,
    settings_of,
    unknown_setting,
)
from auditor.pipeline.asking import PathLike, named_calibration
from auditor.pipeline.calibrations.batch import judge_batch
from auditor.pipeline.calibrations.clean import choose_clean
from auditor.pipeline.calibrations.making import by_kind, make_each
from auditor.pipeline.calibrations.versions import keep_calibrated
from auditor.pipeline.geometry import in_force, rigs_through
from auditor.pipeline.judged import JudgeResult, JudgeSettings
from auditor.pipeline.keywords import (
    JudgingKeywords,
    MeasuringKeywords,
    ScanKeywords,
    criteria,
    explained,
    measuring_of,
)
from auditor.pipeline.many import Batch, find_batch, measure_all
from auditor.pipeline.measured import MeasureResult
from auditor.pipeline.remote.addresses import Address, path_or_address
from auditor.pipeline.remote.mirror import mirrored
from auditor.pipeline.scan import Scan
from auditor.recordings import FrameStream, Recording
from auditor.store.log.runs import logged
from auditor.store.maintenance.relations import relate
from auditor.store.store import Store

Result = TypeVar("Result")

Progress = Callable[[object, str, int], None]
"""Called with a recording, what is being done, and the number of frames done (0: it is a remark)."""


# Reading and measuring


def open_recording(path: PathLike) -> Recording:
    """Open one recording for reading, as a context manager.

    Parameters
    ----------
    path
        A file or a folder: MCAP, rosbag, or a drive of a dataset.

    Returns
    -------
    Recording
        What it holds by topic; nothing is decoded yet.

    Raises
    ------
    RecordingError
        It is missing, empty, unreadable or of no known kind.
    """
    return reading.open_recording(Path(path))


def find_rigs(recording: Recording, rig_file: PathLike | None = None) -> tuple[Rig, ...]:
    """Find the rigs of a recording.

    Parameters
    ----------
    recording
        An opened one.
    rig_file
        A rig.toml or a camchain.yaml, in place of the recording's own calibration and transforms.

    Returns
    -------
    tuple of Rig
        Those of its beginning; where its calibration changes, behind them those that come into force later.

    Raises
    ------
    RigError
        No three sensors overlap, or the rig file does not fit the recording.
    """
    path = Path(rig_file) if rig_file is not None else None
    return tuple(one.rig for one in rigs_through(recording, reading.survey(recording), path).rigs)


def synchronise(recording: Recording, rig: Rig, *, colour: bool = False) -> FrameStream:
    """Put the messages of a recording together to frames, in the order of time.

    Parameters
    ----------
    recording
        An opened one.
    rig
        One of `find_rigs` has the frames of the time in which it is in force, any other rig has all.
    colour
        Whether images of colour cameras are (H, W, 3) uint8 BGR; else all are (H, W) uint8 grey.

    Returns
    -------
    FrameStream
        Of `Frame`, whose clouds are (N, 3) float32 in metres, and of `SkippedFrame` with the reason. Each iteration
        reads the recording again.
    """
    rig_in_force = in_force(recording, reading.survey(recording), rig)
    return reading.synchronise(recording, rig, rig_in_force.survey, colour=colour, stretches=rig_in_force.stretches)


def measure(frame: Frame, rig: Rig, matcher: Matcher | str = "sgbm") -> Measurement:
    """Count the inconsistent pixels of every triple of sensors (Eq. 2), and what the checks count.

    Parameters
    ----------
    frame
        One of `synchronise`, by the same rig.
    rig
        The sensors and where they stand.
    matcher
        The stereo matcher or its name: sgbm, sgbm-full, psmnet or onnx:FILE.

    Returns
    -------
    Measurement
        `counts` in pixels follow `rig.measured_triples`, None where a sensor was missing. A lone camera has no past
        in one frame.

    Raises
    ------
    RigError
        The cameras have no view in common.
    SettingError
        There is no such matcher.
    """
    stereo_matcher = find_matcher(matcher) if isinstance(matcher, str) else matcher
    return measure_frame(frame, rig, stereo_matcher)[0]


# Calibrating, scanning, judging


@dataclass(frozen=True)
class CalibrationResult:
    """The calibrations of all rig kinds, which the store keeps, a sentence for each recording left out, and errors."""

    calibrations: tuple[Calibration, ...]
    left_out: tuple[str, ...]
    errors: tuple[AuditorError, ...]

    @property
    def calibration(self) -> Calibration:
        """The first one: there is one for each rig kind, as of the cameras of a ring."""
        return self.calibrations[0]


@dataclass(frozen=True)
class ScanResult:
    """What became of one recording: measured and judged once for each of its rigs, or the error that ended it."""

    recording: str
    measured: MeasureResult | None = None
    judged: tuple[JudgeResult, ...] = ()
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
        measured = (*self.measured.calibration_warnings, *self.measured.remarks) if self.measured else ()
        return (*measured, *(warning for one in self.judged for warning in one.warnings))


@explained(MeasureSettings)
def calibrate(
    sources: PathLike | Iterable[PathLike],
    *,
    store: PathLike = "audit",
    frames: range | None = None,
    network: MatcherOptions = NO_NETWORK,
    on_progress: Progress | None = None,
    **measuring: Unpack[MeasuringKeywords],
) -> CalibrationResult:
    """Make thresholds from recordings that are known to be clean, or from the clean measurements of stores.

    The store keeps a calibration of each rig kind: the first of a kind is in force, later ones are once somebody
    promotes them.

    Parameters
    ----------
    sources
        Paths and addresses of recordings, of folders of them, and of stores.
    store
        The folder or address of the store that recordings are measured into.
    frames
        The numbers of the frames that are learnt from; all where it is None.
    network
        Several settings of a network at once.
    on_progress
        Is called with a recording, what is being done, and the number of frames done (0: it is a remark).
    **measuring
        See Other Parameters.

    Returns
    -------
    CalibrationResult
        The calibrations by rig kind, and what was left out or failed.

    Raises
    ------
    ThresholdsError
        Nothing clean remains.
    SettingError, RigError, StoreError
        A setting, the rig file or the store does not fit.
    """
    if isinstance(address := path_or_address(store), Address):
        with mirrored(address) as here:
            return calibrate(sources, store=here, frames=frames, network=network, on_progress=on_progress, **measuring)
    places, settings = _places(sources), measuring_of(network, measuring)
    given = [one for one in places if isinstance(one, Path) and Store.is_at(one)]
    folder, stores = Path(store), [Store.open(path) for path in given]
    batch = find_batch([one for one in places if one not in given], folder, settings)
    kept = Store.open(folder, create=True)
    with logged(kept.folder):
        outcomes = list(measure_all(batch, on_progress or (lambda *_: None)))
        relate(kept)
        measured = [(kept, one) for outcome in outcomes if outcome.result for one in outcome.result.measurement_ids]
        clean = choose_clean(measured, stores)
        made = list(make_each(by_kind(clean), Criteria.r, frames, jobs=settings.jobs))
        for calibration in made:
            keep_calibrated(kept, calibration)
    failed = (outcome.error for outcome in outcomes if outcome.error is not None)
    return CalibrationResult(tuple(one.calibration for one in made), clean.left_out, (*batch.errors, *failed))


@explained(Criteria, MeasureSettings)
def scan(
    recordings: PathLike | Iterable[PathLike],
    *,
    store: PathLike = "audit",
    network: MatcherOptions = NO_NETWORK,
    on_progress: Progress | None = None,
    **settings: Unpack[ScanKeywords],
) -> Iterator[ScanResult]:
    """Audit recordings as `auditor scan` does, and yield what became of each.

    What the store has measured already is not measured again, unless `measure_again`. A recording that fails is a
    result with its error, and the others go on.

    Parameters
    ----------
    recordings
        Paths and addresses of recordings, and of folders of them.
    store
        The folder or address of the store.
    network
        Several settings of a network at once.
    on_progress
        Is called with a recording, what is being done, and the number of frames done (0: it is a remark).
    **settings
        See Other Parameters.

    Yields
    ------
    ScanResult
        First those that could not be measured, as soon as it is known; the others once all are judged, in the order
        given, since recordings may contradict one another.

    Raises
    ------
    SettingError, ThresholdsError, RigError, StoreError
        Something is wrong with the call itself: before any work, or of a store at an address when the first result
        is asked for.
    """
    judging = {name: value for name, value in settings.items() if name in settings_of(Criteria)}
    measuring = {name: value for name, value in settings.items() if name not in judging}
    if unknown := measuring.keys() - settings_of(MeasureSettings).keys():
        raise unknown_setting(min(unknown), settings_of(Criteria, MeasureSettings))
    places, by, how = _places(recordings), criteria(judging), measuring_of(network, measuring)

    def into(folder: Path) -> Iterator[ScanResult]:
        chosen = judge_settings(folder, by)
        return _scan(find_batch(places, folder, how), folder, chosen, on_progress or (lambda *_: None))

    return _at(path_or_address(store), into)


def _at(place: Path | Address, steps: Callable[[Path], Iterator[Result]]) -> Iterator[Result]:
    """What is done to a store, or to the mirror of one."""
    return _mirrored(place, steps) if isinstance(place, Address) else steps(place)


def _mirrored(address: Address, steps: Callable[[Path], Iterator[Result]]) -> Iterator[Result]:
    """What is done to the mirror of a store, which is put back behind the last step."""
    with mirrored(address) as here:
        yield from steps(here)


def _scan(batch: Batch, folder: Path, judging: JudgeSettings, on_progress: Progress) -> Iterator[ScanResult]:
    yield from (ScanResult(error.where, error=error) for error in batch.errors)
    scan = Scan(batch, folder)
    with scan.logged():
        for outcome in scan.measure(on_progress):
            if outcome.result is None:
                yield ScanResult(str(outcome.item), error=outcome.error)
        deque(scan.relate(), maxlen=0)
        judged = {one.measurement_id: one for one in scan.judge(judging)}
        deque(scan.finish(), maxlen=0)
    for result in scan.measured:
        verdicts = (judged[known] for known in result.measurement_ids if known in judged)
        yield ScanResult(str(result.recording), result, tuple(verdicts))


@explained(Criteria)
def judge(
    store: Store | PathLike = "audit", *, jobs: int | None = None, **judging: Unpack[JudgingKeywords]
) -> Iterator[JudgeResult]:
    """Judge every measurement of a store again, without its recordings, and yield what became of each.

    The new verdicts become the current ones.

    Parameters
    ----------
    store
        A store, or its folder or address.
    jobs
        Processes that judge at a time; as many as cores where it is None.
    **judging
        See Other Parameters.

    Yields
    ------
    JudgeResult
        One a measurement.

    Raises
    ------
    SettingError
        A setting does not fit; before any work.
    ThresholdsError
        No calibration has that name.
    StoreError
        Nothing has been measured.
    """
    by = criteria(judging)
    if isinstance(store, Store):
        return judge_store(store, by, jobs)
    return _at(path_or_address(store), lambda here: judge_store(Store.open(here), by, jobs))


def judge_store(store: Store, judging: Criteria, jobs: int | None = None) -> Iterator[JudgeResult]:
    """Judge every measurement of a store again, as `judge`."""
    measurements = store.ids("measurements")
    if not measurements:
        raise StoreError("nothing has been measured", where=store.folder, remedy="measure recordings with auditor scan")
    return judge_batch(store, measurements, judge_settings(store.folder, judging), jobs)


def judge_settings(store: Path, judging: Criteria) -> JudgeSettings:
    """The criteria with the calibration that they name. Raises ThresholdsError for an unknown one."""
    return JudgeSettings(judging, named_calibration(store, judging.calibration))


def _places(sources: PathLike | Iterable[PathLike]) -> list[Path | Address]:
    """Paths, and addresses of object stores. Raises SettingError."""
    return [path_or_address(one) for one in ([sources] if isinstance(sources, str | Path) else sources)]
