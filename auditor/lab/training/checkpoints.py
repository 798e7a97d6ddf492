"""The checkpoint of a training: weights that can be used, and all that is needed to resume it."""

import csv
import dataclasses
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch

from auditor.errors import SettingError
from auditor.lab.training.samples import SampleFiles, SampleSet, Score, score
from auditor.measurement.disparity.matchers import SgbmMatcher, psmnet_module
from auditor.measurement.disparity.matchers.psmnet.network import PUBLISHED_WIDTH, PSMNet
from auditor.measurement.disparity.matchers.psmnet.safe_checkpoint import METADATA, load_safely
from auditor.store.records import content_id

CHECKPOINT = "checkpoint.pt"
"""The one file in the folder of a training: weights for `--weights`, and all that is needed to resume it."""

_MAY_CHANGE = ("steps", "validate_every", "device")


@dataclass(frozen=True)
class TrainingSettings:
    """A training run. `crop` (H, W) in the network's pixels, multiples of 16; `steps` batches in all.

    Width 32, range 192 and crops of 256 x 512 make the published network. With `step` 2 the network sees images at half
    resolution; `max_disparity` is in full-resolution pixels all the same. The learning rate rises to `learning_rate`
    over the first twentieth of the steps, then falls to zero along a cosine; a training that is resumed with another
    number of steps follows the cosine of that number. `precision` bf16 is for GPUs. `samples` identifies the training
    set, so that a training is not resumed with another one.
    """

    max_disparity: int = 192
    width: int = PUBLISHED_WIDTH
    step: int = 1
    align_corners: bool = False
    crop: tuple[int, int] = (256, 512)
    batch: int = 4
    steps: int = 20_000
    learning_rate: float = 1e-3
    validate_every: int = 500
    seed: int = 0
    device: str = "cpu"
    precision: str = "fp32"
    samples: str = ""

    @property
    def range_px(self) -> int:
        """The largest disparity in the network's pixels."""
        return self.max_disparity // self.step


@dataclass(frozen=True)
class TrainingRow:
    """A point of the curve: mean loss of the steps since the last one, and the scores on the validation samples."""

    step: int
    loss: float
    validation: dict[str, Score]


@dataclass(eq=False)
class TrainingRun:
    """A training between two steps."""

    settings: TrainingSettings
    network: PSMNet
    optimiser: torch.optim.Optimizer
    done: int = 0
    rows: list[TrainingRow] = field(default_factory=list)


def restore(run: TrainingRun, checkpoint: Path) -> None:
    """Bring a run that was just started to the state of a checkpoint.

    Raises SettingError where it cannot be read, or was made with settings that give another network.
    """
    content = _loaded(checkpoint)
    before, now = content["settings"], _plain(run.settings)
    changed = [name for name in now if name not in _MAY_CHANGE and before.get(name) != now[name]]
    if changed:
        raise SettingError(
            "the training was started with other settings: "
            + ", ".join(f"{name} {before.get(name)} instead of {now[name]}" for name in changed),
            where=checkpoint,
            remedy="go on with the same ones, or start again in another folder",
        )
    run.network.load_state_dict(content["state_dict"])
    run.optimiser.load_state_dict(content["optimizer"])
    run.done = content["step"]
    run.rows = _rows(content)


def write(run: TrainingRun, checkpoint: Path) -> None:
    """Write a run beside the checkpoint, then put it in its place. Raises SettingError where that cannot be done."""
    settings = run.settings
    content = {
        "state_dict": run.network.state_dict(),
        METADATA: {
            "align_corners": settings.align_corners,
            "max_disparity": settings.max_disparity,
            "step": settings.step,
            "colour": False,
        },
        "optimizer": run.optimiser.state_dict(),
        "step": run.done,
        "settings": _plain(settings),
        "rows": [dataclasses.asdict(row) for row in run.rows],
    }
    beside = checkpoint.with_suffix(".part")
    try:
        torch.save(content, beside)
        os.replace(beside, checkpoint)  # noqa: PTH105 - the same in one step on every platform
    except OSError as error:
        raise SettingError(error.strerror or str(error), where=checkpoint, remedy="choose another folder") from error


def training_curve(folder: Path) -> list[TrainingRow]:
    """The rows of a training so far, those before interruptions included. Raises SettingError where there is none."""
    return _rows(_loaded(folder / CHECKPOINT))


def _loaded(checkpoint: Path) -> dict[str, Any]:
    try:
        loaded = load_safely(checkpoint, checkpoint.read_bytes())
    except OSError as error:
        raise SettingError(error.strerror or str(error), where=checkpoint, remedy="name a training's folder") from error
    if not isinstance(loaded, dict) or not {"settings", "state_dict", "optimizer", "step", "rows"} <= set(loaded):
        raise SettingError("it is not a checkpoint of a training", where=checkpoint, remedy="name a training's folder")
    return loaded


def _rows(content: dict[str, Any]) -> list[TrainingRow]:
    return [
        TrainingRow(row["step"], row["loss"], {name: Score(**score) for name, score in row["validation"].items()})
        for row in content["rows"]
    ]


def _plain(settings: TrainingSettings) -> dict[str, Any]:
    return dataclasses.asdict(settings) | {"crop": list(settings.crop)}


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
class CurvePoint:
    """A point of the curve for one kind of sample: the network's score, and SGBM's on the same pixels."""

    step: int
    loss: float
    kind: str
    network: Score
    sgbm: Score


def training_set(made: Sequence[SampleSet], left_out: Sequence[SampleSet]) -> TrainingSet:
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


def train_on(training_set: TrainingSet, settings: "TrainingSettings", folder: Path) -> Iterator[list[CurvePoint]]:
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


def _points(row: "TrainingRow", sgbm: Mapping[str, Score]) -> list[CurvePoint]:
    return [CurvePoint(row.step, row.loss, kind, score, sgbm[kind]) for kind, score in row.validation.items()]


def _spread(files: Sequence[Path]) -> tuple[Path, ...]:
    """At most _VALIDATED of them, from the first to the last."""
    stride = -(-len(files) // _VALIDATED)
    return tuple(files[::stride])


def _write_curve(points: Sequence[CurvePoint], path: Path) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        out = csv.writer(file)
        out.writerow(
            ["step", "loss", "samples", "pixels", "mean_px", "over_3px_share", "sgbm_mean_px", "sgbm_over_3px_share"]
        )
        for point in points:
            network, sgbm = point.network, point.sgbm
            scores = (network.pixels, network.mean_px, network.over_3px_share, sgbm.mean_px, sgbm.over_3px_share)
            out.writerow([point.step, point.loss, point.kind, *scores])
