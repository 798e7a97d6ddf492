"""The training of a network on samples: its curve beside SGBM's, and the weights for scans."""

import csv
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from auditor.errors import SettingError
from auditor.lab.training.samples import Made, SampleFiles
from auditor.measurement.disparity.matchers import SgbmMatcher, psmnet_module
from auditor.measurement.disparity.matchers.scoring import Score, score
from auditor.store.records import content_id

if TYPE_CHECKING:
    from auditor.lab.training.checkpoints import TrainingRow, TrainingSettings


WEIGHTS = "psmnet.safetensors"
CURVE = "curve.csv"

_VALIDATED = 24
"""The most samples of each kind that are scored for a point of the curve."""


@dataclass(frozen=True)
class TrainingSet:
    """The samples that a network is trained on, and by kind (recordings, streets) those it is validated on."""

    training: SampleFiles
    validation: Mapping[str, SampleFiles]

    @property
    def known(self) -> str:
        """An id that follows from the samples, in their order."""
        every = (self.training, *self.validation.values())
        # The first word is part of the ids of trainings begun earlier, which can still be resumed.
        return content_id("lesson", *([str(Path(*file.parts[-2:])) for file in files.files] for files in every))


@dataclass(frozen=True)
class Point:
    """A point of the curve for one kind of sample: the network's score, and SGBM's on the same pixels."""

    step: int
    loss: float
    kind: str
    network: Score
    sgbm: Score


def training_set(made: Sequence[Made], left_out: Sequence[Made]) -> TrainingSet:
    """The training and the validation samples; no source is in both.

    Raises SettingError where a source is in both, or nothing is left.
    """
    both = {one.source_id for one in made} & {one.source_id for one in left_out}
    if both:
        raise SettingError(
            "the same recording to train on and to validate on",
            where="--validate",
            remedy="validate on recordings that are not trained on",
        )
    training = SampleFiles(tuple(file for one in made for file in one.files))
    kinds = dict.fromkeys(one.kind for one in left_out)
    groups = {kind: [file for one in left_out if one.kind == kind for file in one.files] for kind in kinds}
    validation = {kind: SampleFiles(_spread(files)) for kind, files in groups.items() if files}
    if not len(training) or not validation:
        raise SettingError(
            "no samples: the recordings have no frame with a LiDAR's scan and two cameras",
            where="train-matcher",
            remedy="name other recordings, or give --synthetic",
        )
    return TrainingSet(training, validation)


def train_on(training_set: TrainingSet, settings: "TrainingSettings", folder: Path) -> Iterator[list[Point]]:
    """Train, or resume the training of the folder; yields the points of the curve as they come.

    After each the folder holds the checkpoint and the curve, at the end the weights. Points from before an
    interruption come first. Raises SettingError as `train` does, and where PSMNet's packages are missing.
    """
    training = psmnet_module("psmnet", "auditor.lab.training")
    sgbm = {kind: score(SgbmMatcher(), samples) for kind, samples in training_set.validation.items()}
    checkpoint = folder / training.CHECKPOINT
    resume = checkpoint.exists()
    rows: list[TrainingRow] = training.training_curve(folder) if resume else []
    points = [point for row in rows for point in _points(row, sgbm)]
    yield from ([one] for one in points)
    for row in training.train(training_set.training, training_set.validation, settings, folder, resume=resume):
        points += _points(row, sgbm)
        _write_curve(points, folder / CURVE)
        yield points[-len(sgbm) :]
    weights = folder / WEIGHTS
    weights.unlink(missing_ok=True)
    psmnet_module("weights").convert_weights(checkpoint, weights)


def _points(row: "TrainingRow", sgbm: Mapping[str, Score]) -> list[Point]:
    return [Point(row.step, row.loss, kind, score, sgbm[kind]) for kind, score in row.validation.items()]


def _spread(files: Sequence[Path]) -> tuple[Path, ...]:
    """At most _VALIDATED of them, from the first to the last."""
    stride = -(-len(files) // _VALIDATED)
    return tuple(files[::stride])


def _write_curve(points: Sequence[Point], path: Path) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        out = csv.writer(file)
        out.writerow(
            ["step", "loss", "samples", "pixels", "mean_px", "over_3px_share", "sgbm_mean_px", "sgbm_over_3px_share"]
        )
        for point in points:
            network, sgbm = point.network, point.sgbm
            scores = (network.pixels, network.mean_px, network.over_3px_share, sgbm.mean_px, sgbm.over_3px_share)
            out.writerow([point.step, point.loss, point.kind, *scores])
