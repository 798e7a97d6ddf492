"""Pictures of what was missed: the frames of a few missed cases are read and attacked again."""

import json
from collections import defaultdict, deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import cast

from auditor.lab.attacks.kinds import OnCamera, OnLidar
from auditor.lab.evaluation.experiments import DELAYS, AttackCase, Experiment, SeededDraws, parameters_of
from auditor.lab.evaluation.runner import Progress, experiments_of
from auditor.lab.evaluation.sources import CleanFrameSource, Source
from auditor.measurement import use_one_thread
from auditor.measurement.drawing.clouds import changed_cloud, small_jpeg
from auditor.model.frames import Frame
from auditor.model.rig import LIDAR, Rig
from auditor.pipeline.workers import LimitsOf, run_all
from auditor.store.evaluation_tables import CaseKey, MissedPicture, case_key, missed_pictures, write_missed_pictures
from auditor.store.export import rows_of
from auditor.store.queries import run_query
from auditor.store.store import Store

NOT_HERE = "its recording was not among those that were evaluated last, or it could not be read"
NOT_AGAIN = "its frame could not be attacked again as it was"


@dataclass(frozen=True)
class MissedCase:
    """A missed case, and what makes it again; `parameters` decide the effect of its attack."""

    key: CaseKey
    recording_id: str
    rig_id: str
    experiment: str
    inputs: str | None
    seed: int | None
    parameters: str

    @property
    def frame(self) -> int:
        """Number of its frame."""
        return self.key[1]


@dataclass(frozen=True)
class PicturesTask:
    """The missed cases of one source."""

    source: Source
    patterns: tuple[Path, ...]
    cases: tuple[MissedCase, ...]

    def __str__(self) -> str:
        return str(self.source)


def keep_missed(
    store: Store,
    sources: Mapping[str, Source],
    patterns: tuple[Path, ...] = (),
    jobs: int = 1,
    limits: LimitsOf | None = None,
) -> None:
    """Keep pictures of the missed cases that `evaluation_missed` chooses, in place of those of others.

    `sources` are those that can be read, by recording. What has a picture is not read again. With `limits` each source
    is read in a process of its own. Raises StoreError.
    """
    cases = [_missed(row) for row in rows_of(run_query(store, "evaluation_missed", {}))]
    earlier = missed_pictures(store)
    kept = {one.key: earlier[one.key] for one in cases if one.key in earlier and earlier[one.key].jpeg}
    by_source: dict[Source, list[MissedCase]] = defaultdict(list)
    for case in cases:
        if case.key not in kept and case.recording_id in sources:
            by_source[sources[case.recording_id]].append(case)
    tasks = [PicturesTask(source, patterns, tuple(wanted)) for source, wanted in by_source.items()]
    of_task = (lambda task: limits(task.source.path)) if limits else None
    for outcome in run_all(take_pictures, tasks, jobs, lambda *_: None, of_task):
        made = outcome.result or {}
        reason = outcome.error.what if outcome.error else NOT_AGAIN
        kept |= {
            one.key: MissedPicture(one.key, made.get(one.key), None if one.key in made else reason)
            for one in outcome.item.cases
        }
    write_missed_pictures(store, [kept.get(one.key) or MissedPicture(one.key, None, NOT_HERE) for one in cases])


def take_pictures(task: PicturesTask, progress: Progress) -> dict[CaseKey, bytes]:
    """The pictures of a source's cases as JPEGs, of those that can be made again. Raises RecordingError and RigError.

    The source is read up to the last of their frames.
    """
    use_one_thread()
    experiments = {(one.name, one.inputs): one for one in experiments_of(task.patterns)}
    with task.source.open() as drives:
        return {key: jpeg for drive in drives for key, jpeg in _of_drive(drive, task.cases, experiments, progress)}


def _missed(row: Mapping[str, object]) -> MissedCase:
    names = ("recording_id", "rig_id", "experiment", "inputs", "seed", "parameters")
    return MissedCase(case_key(row), **{name: row[name] for name in names})  # type: ignore[arg-type]  # as the query has them


def _of_drive(
    drive: CleanFrameSource,
    cases: Sequence[MissedCase],
    experiments: Mapping[tuple[str, str | None], Experiment],
    progress: Progress,
) -> Iterator[tuple[CaseKey, bytes]]:
    wanted: dict[int, list[MissedCase]] = defaultdict(list)
    for missed in cases:
        if (missed.recording_id, missed.rig_id) == (drive.recording_id, drive.rig.rig_id):
            wanted[missed.frame].append(missed)
    past: deque[Frame] = deque(maxlen=max(DELAYS))
    frames = drive.frames if wanted else ()
    for frame in frames:
        if isinstance(frame, Frame):
            for missed in wanted.pop(frame.number, ()):
                case = _again(
                    missed, frame, drive.rig, tuple(past), experiments.get((missed.experiment, missed.inputs))
                )
                if case is not None:
                    yield missed.key, _picture(case, frame, drive.rig)
            past.append(frame)
            progress(drive.name, frame.number + 1)
        if not wanted:
            return


def _again(
    missed: MissedCase, frame: Frame, rig: Rig, past: Sequence[Frame], experiment: Experiment | None
) -> AttackCase | None:
    """The case with the same attacks, drawn again; None where there is none any more."""
    draws = SeededDraws(missed.seed or 0, int(missed.recording_id[:8], 16), frame.number, missed.key[2])
    cases = experiment.cases(rig, draws, past) if experiment else ()
    same = (case for case in cases if json.dumps(parameters_of(case.attacks), sort_keys=True) == missed.parameters)
    return next(same, None)


def _picture(case: AttackCase, frame: Frame, rig: Rig) -> bytes:
    """The attacked sensor's data, of a frame that holds them."""
    (sensor,) = case.attacked
    attack = case.attacks[sensor]
    if sensor != LIDAR:
        return small_jpeg(cast(OnCamera, attack).apply(frame.images[sensor]).pixels)
    assert frame.cloud is not None
    assert rig.lidar is not None
    after = cast(OnLidar, attack).apply(frame.cloud, rig)
    return small_jpeg(changed_cloud(frame.cloud.xyz_m, after.xyz_m, rig.lidar.rig_SE3_lidar))
