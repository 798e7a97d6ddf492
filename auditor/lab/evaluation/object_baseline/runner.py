"""The object-level baseline on one recording: its frames times the cases that compare with the method's."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import KW_ONLY, asdict, dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from auditor.errors import SettingError
from auditor.lab.evaluation.attacked_frame import AttackedFrame, InTime
from auditor.lab.evaluation.experiments import EXPERIMENTS, AttackCase, Experiment
from auditor.lab.evaluation.object_baseline.agreement import AttackedObjects, in_view, scenarios
from auditor.lab.evaluation.object_baseline.average_precision import ScoredObjects, score_in_image, score_on_ground
from auditor.lab.evaluation.object_baseline.detectors import CAR, Detectors, find_detectors
from auditor.lab.evaluation.object_baseline.kitti_labels import ObjectLabel, read_object_labels
from auditor.lab.evaluation.runner import DriveEvaluation, EvaluationWork, Progress, Task, together
from auditor.lab.evaluation.sources import CleanFrameSource
from auditor.lab.simulation.drives import SyntheticDrive
from auditor.measurement import use_one_thread
from auditor.measurement.disparity.matchers import Matcher, find_matcher
from auditor.model.optics.geometry import Matrix
from auditor.model.rig import LIDAR, Camera, Rig, Triple
from auditor.store.evaluation_tables import ObjectCase, ObjectPart
from auditor.store.store import Store

_LEAST_SEEN_BY_LEVEL = (0.8, 0.4, 0.1)
"""Of a vehicle that is seen less than this, the level of occlusion is one more; KITTI's levels are 0 to 3."""


def street_labels(drive: SyntheticDrive, number: int, camera: int) -> tuple[ObjectLabel, ...]:
    """The vehicles of a frame that lie at least in part in the picture of S_camera."""
    optics = drive.rig.camera(camera)
    labels = (_label(corners, seen, optics) for corners, seen in drive.vehicles_ahead(number, camera))
    return tuple(label for label in labels if label is not None)


def _label(corners_m: Matrix, seen_share: float, camera: Camera) -> ObjectLabel | None:
    u, v, depth = camera.projection @ np.append(corners_m, np.ones((8, 1)), axis=1).T
    ends = [(u / depth).min(), (v / depth).min(), (u / depth).max(), (v / depth).max()]
    inside = np.clip(ends, 0, [camera.width_px, camera.height_px] * 2)
    area, whole = (np.prod(np.subtract(box[2:], box[:2])) for box in (inside, ends))
    if area <= 0:
        return None
    x, z = corners_m[3, [0, 2]] - corners_m[0, [0, 2]]
    sides = corners_m[0] - corners_m[4], corners_m[1] - corners_m[0], corners_m[3] - corners_m[0]
    height, width, length = (float(np.linalg.norm(side)) for side in sides)
    return ObjectLabel(
        kind=CAR,
        truncated=float(1 - area / whole),
        occluded=sum(seen_share < least for least in _LEAST_SEEN_BY_LEVEL),
        box_px=(float(inside[0]), float(inside[1]), float(inside[2]), float(inside[3])),
        size_m=(height, width, length),
        place_m=(float(corners_m[:4, 0].mean()), float(corners_m[:4, 1].mean()), float(corners_m[:4, 2].mean())),
        yaw_rad=float(np.arctan2(-z, x)),
    )


_SENSITIVITY = "sensitivity"


@dataclass(frozen=True)
class ObjectTask(Task):
    """Compare objects; `detectors` are names, `labels` a folder of KITTI's."""

    _: KW_ONLY
    detectors: tuple[str, ...]
    labels: Path | None = None

    def __str__(self) -> str:
        return f"{super().__str__()}, objects"


def check_detectors(detectors: Sequence[str], labels: Path | None) -> None:
    """Raises SettingError where a detector cannot be used, or labels have no detector that they could score."""
    pair = find_detectors(detectors)
    if labels is not None and pair.camera is None and pair.cloud is None:
        raise SettingError(
            "labels need a detector whose objects have kinds", where="--labels", remedy="add --detector streets"
        )


def evaluate_objects(task: ObjectTask, progress: Progress) -> EvaluationWork:
    """Compare the sensors' objects in every case; finished chunks are not compared again.

    Raises RecordingError, RigError, SettingError and StoreError.
    """
    use_one_thread()
    matcher, detectors = find_matcher(task.matcher, task.network), find_detectors(task.detectors)
    store = Store.open(task.store, create=True)
    with task.source.open() as drives:
        return together(
            _Run(task, drive, matcher, store, detectors, _labels_of(drive, task.labels)).go(progress)
            for drive in drives
        )


@dataclass(frozen=True)
class Labels:
    """The objects of a frame by its number, None where it is not labelled; `content` says where they are from."""

    content: str
    of: Callable[[int], Sequence[ObjectLabel] | None]


def _labels_of(drive: CleanFrameSource, folder: Path | None) -> Labels | None:
    """The truth of a street, or the labels of a recording in a folder; None without any. Raises SettingError."""
    street = drive.street
    if street is not None:
        remembered = lru_cache(maxsize=1)(lambda number: street_labels(street, number, street.rig.n))
        return Labels("the street's own truth", remembered)
    if folder is None:
        return None
    read = read_object_labels(folder, drive.name)
    return Labels(read.content, read.frames.get)


class _Run(DriveEvaluation):
    def __init__(
        self,
        task: ObjectTask,
        drive: CleanFrameSource,
        matcher: Matcher,
        store: Store,
        detectors: Detectors,
        labels: Labels | None,
    ) -> None:
        scored = labels is not None and (detectors.camera is not None or detectors.cloud is not None)
        experiments = [one for one in EXPERIMENTS if scored or one.name != _SENSITIVITY]
        super().__init__(task, drive, matcher, store, experiments)
        self._detectors = detectors
        self._labels = labels

    def part(self, experiment: Experiment, chunk: int) -> ObjectPart:
        return ObjectPart(
            **self.shared_columns(experiment, chunk),
            detector=self._detectors.name,
            detector_settings=self._detectors.settings,
            labels=self._labels.content if self._labels else None,
        )

    def versions(self) -> Mapping[str, str]:
        return {**super().versions(), **self._detectors.libraries}

    def results(
        self, now: InTime, experiment: Experiment, draw: int, cases: Sequence[AttackCase]
    ) -> Iterator[ObjectCase]:
        attacked_frame = now.attacked_frame
        frame, objects = attacked_frame.frame, AttackedObjects(attacked_frame, self._detectors)
        if self._detectors.camera is None and experiment.name != _SENSITIVITY:
            matched = (case.attacks for case in cases if self._triples(attacked_frame, case, experiment))
            attacked_frame.match_together(matched, scenarios(attacked_frame.rig))
        triples = attacked_frame.rig.triples
        for case in cases:
            compared = self._triples(attacked_frame, case, experiment)
            agreements = {triple: objects.agreement(triple, case.attacks) for triple in compared}
            overlaps = [[one.iou for one in agreements[triple]] if triple in agreements else None for triple in triples]
            scores = [
                [one.score for one in agreements[triple]]
                if triple in agreements and objects.has_scores(triple)
                else None
                for triple in triples
            ]
            scored = self._scored(objects, attacked_frame, case)
            if scored or agreements:
                rows = [asdict(one) for one in scored]
                varied = case.strength, case.size, case.visible_share
                yield ObjectCase(frame.number, frame.stamp_ns, draw, case.attacked, *varied, overlaps, scores, rows)

    @staticmethod
    def _triples(attacked_frame: AttackedFrame, case: AttackCase, experiment: Experiment) -> list[Triple]:
        """The triples whose sensors are all present, and that contain all attacked sensors."""
        compared = scenarios(attacked_frame.rig) if experiment.name != _SENSITIVITY else ()
        return [triple for triple in compared if set(attacked_frame.sensors) >= set(triple) >= set(case.attacked)]

    def _scored(self, objects: AttackedObjects, attacked_frame: AttackedFrame, case: AttackCase) -> list[ScoredObjects]:
        """The detectors' objects against the labels: of clean data, and of data that a sensitivity case varies."""
        labels = self._labels.of(attacked_frame.frame.number) if self._labels else None
        if labels is None or (case.attacked and case.size is None):
            return []
        return list(_score(objects, attacked_frame, case, labels, self._detectors))


def _score(
    objects: AttackedObjects,
    attacked_frame: AttackedFrame,
    case: AttackCase,
    labels: Sequence[ObjectLabel],
    detectors: Detectors,
) -> Iterator[ScoredObjects]:
    rig: Rig = attacked_frame.view_rig
    changed = set(case.attacked or rig.sensors) & set(attacked_frame.sensors)
    if detectors.camera is not None and rig.n in changed:
        yield from score_in_image(rig.n, objects.in_image(rig.n, case.attacks), labels, detectors.camera.labels)
    if detectors.cloud is not None and LIDAR in changed:
        detections = objects.in_cloud(case.attacks)
        yield from score_on_ground(
            LIDAR, detections, labels, detectors.cloud.labels, lambda box: in_view(box, rig.camera(rig.n))
        )
