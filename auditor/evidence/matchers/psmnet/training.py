"""Training on a fleet's own clean recordings and on synthetic scenes: for teams without the published weights."""

import dataclasses
import itertools
import math
import os
from collections.abc import Iterable, Iterator, Sized
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from auditor.errors import SettingError
from auditor.evidence.matchers.psmnet.files import METADATA, load_safely
from auditor.evidence.matchers.psmnet.inference import Engine, Image
from auditor.evidence.matchers.psmnet.network import MULTIPLE, PUBLISHED_WIDTH, PSMNet
from auditor.evidence.matchers.scoring import Sample, Score, score

CHECKPOINT = "checkpoint.pt"
"""The one file in the folder of a training: weights for `--weights`, and all that is needed to go on."""

_OUTPUT_WEIGHTS = (0.5, 0.7, 1.0)
_PRECISIONS = ("fp32", "bf16")
_MAY_CHANGE = ("steps", "validate_every", "device")
_LARGEST_POOL_PX = 256


@dataclass(frozen=True)
class TrainingSettings:
    """A training run. `crop` (H, W) in pixels, multiples of 16; `steps` batches in all, counted over resumptions.

    Width 32, range 192 and crops of 256 x 512 make the published network; width 4, range 32 and crops of 64 x 128
    make one that a CPU trains in a minute. `precision` bf16 is for GPUs.
    """

    max_disparity: int = 192
    width: int = PUBLISHED_WIDTH
    align_corners: bool = False
    crop: tuple[int, int] = (256, 512)
    batch: int = 4
    steps: int = 20_000
    learning_rate: float = 1e-3
    validate_every: int = 500
    seed: int = 0
    device: str = "cpu"
    precision: str = "fp32"


@dataclass(frozen=True)
class TrainingRow:
    """A point of the curve: mean loss of the steps since the last one, and the score on the validation samples."""

    step: int
    loss: float
    validation: Score


@dataclass(eq=False)
class _Run:
    """A training between two steps."""

    settings: TrainingSettings
    network: PSMNet
    optimiser: torch.optim.Adam
    step: int = 0
    rows: list[TrainingRow] = field(default_factory=list)


def train(
    samples: Iterable[Sample],
    validation: Iterable[Sample],
    settings: TrainingSettings,
    folder: Path,
    *,
    resume: bool = False,
) -> Iterator[TrainingRow]:
    """Train on random crops, in the samples' own order, passing over them again and again; yields rows of the curve.

    Known disparities may be as sparse as a LiDAR's. Loss: smooth L1 of the three outputs, weighted 0.5, 0.7 and 1.0
    (Chang and Chen, section 3.6), over the known pixels within the range. With each row a checkpoint is written whole
    into `folder`. With `resume` it goes on from there: on a CPU every bit is that of an undisturbed run, provided that
    the samples come again in the same order. Raises SettingError for settings that make no sense, samples that do not
    fit, a checkpoint that is there without `resume` or not there with it.
    """
    _check(settings)
    checkpoint = folder / CHECKPOINT
    if checkpoint.exists() != resume:
        what = "no training to resume" if resume else "a training is here already"
        raise SettingError(
            what, where=checkpoint, remedy="leave --resume out" if resume else "use --resume or another folder"
        )
    run = _resumed(checkpoint, settings) if resume else _started(settings)
    folder.mkdir(parents=True, exist_ok=True)
    stream = _from(samples, run.step * settings.batch)
    losses: list[float] = []
    while run.step < settings.steps:
        losses.append(_step(run, list(itertools.islice(stream, settings.batch))))
        if run.step % settings.validate_every == 0 or run.step == settings.steps:
            row = TrainingRow(run.step, sum(losses) / len(losses), score(_Validated(run.network, settings), validation))
            losses.clear()
            run.rows.append(row)
            _write(run, checkpoint)
            yield row


def training_curve(folder: Path) -> list[TrainingRow]:
    """The rows of a training so far, those before resumptions included. Raises SettingError where there is none."""
    return _rows(_loaded(folder / CHECKPOINT))


@dataclass(frozen=True, eq=False)
class _Validated:
    """The network under training as a matcher."""

    network: PSMNet
    training: TrainingSettings
    name: str = "psmnet"
    settings: str = ""
    step: int = 1
    colour: bool = True

    @property
    def range_px(self) -> int:
        return self.training.max_disparity

    def match(self, left: Image, right: Image) -> NDArray[np.float32]:
        self.network.eval()
        engine = Engine(self.network, torch.device(self.training.device))
        features = engine.features([left, right])
        size = (left.shape[0], left.shape[1])
        disparity: NDArray[np.float32] = engine.disparities(features[:1], features[1:], size)[0]
        return disparity


def _step(run: _Run, samples: list[Sample]) -> float:
    settings = run.settings
    first = run.step * settings.batch
    crops = [_crop(sample, settings, first + place) for place, sample in enumerate(samples)]
    device = torch.device(settings.device)
    engine = Engine(run.network.train(), device)
    left, right = engine.load([crop[0] for crop in crops]), engine.load([crop[1] for crop in crops])
    truth = torch.from_numpy(np.stack([crop[2] for crop in crops]).astype(np.float32)).to(device)
    run.optimiser.zero_grad()
    with torch.autocast(device.type, dtype=torch.bfloat16, enabled=settings.precision == "bf16"):
        outputs = run.network(left, right)
    loss = _loss(outputs, truth, settings.max_disparity)
    loss.backward()  # type: ignore[no-untyped-call]
    run.optimiser.step()
    run.step += 1
    value = loss.item()
    if not math.isfinite(value):
        raise SettingError(
            f"the loss is {value} at step {run.step}", where="training", remedy="use a smaller --learning-rate"
        )
    return value


def _loss(outputs: tuple[Tensor, ...], truth: Tensor, max_disparity: int) -> Tensor:
    known = (truth > 0) & (truth < max_disparity)  # False where it is NaN
    target = torch.where(known, truth, torch.zeros_like(truth))
    count = known.sum().clamp(min=1)
    losses = [functional.smooth_l1_loss(output, target, reduction="none") for output in outputs]
    return sum(
        (weight * (loss * known).sum() / count for weight, loss in zip(_OUTPUT_WEIGHTS, losses, strict=True)),
        start=torch.zeros((), device=truth.device),
    )


def _crop(sample: Sample, settings: TrainingSettings, number: int) -> Sample:
    """A window of a sample, drawn by its number alone, so that a resumed run draws the same."""
    left, right, truth = sample
    rows, columns = settings.crop
    spare = truth.shape[0] - rows, truth.shape[1] - columns
    if min(spare) < 0 or left.shape[:2] != truth.shape or right.shape[:2] != truth.shape:
        raise SettingError(
            f"images {left.shape[:2]} and {right.shape[:2]}, disparities {truth.shape}: no crop of {settings.crop}",
            where="training",
            remedy="use smaller crops",
        )
    rng = np.random.default_rng((settings.seed, number))
    top, start = (int(rng.integers(room + 1)) for room in spare)
    window = slice(top, top + rows), slice(start, start + columns)
    return left[window], right[window], truth[window]


def _from(samples: Iterable[Sample], skipped: int) -> Iterator[Sample]:
    """All samples, pass after pass, without the first ones that an earlier run has used."""
    if isinstance(samples, Sized) and len(samples):
        skipped %= len(samples)
    return itertools.islice(_passes(samples), skipped, None)


def _passes(samples: Iterable[Sample]) -> Iterator[Sample]:
    while True:
        sample = None
        for sample in samples:
            yield sample
        if sample is None:
            raise SettingError("there are no samples to train on", where="training", remedy="name clean recordings")


def _started(settings: TrainingSettings) -> _Run:
    with torch.random.fork_rng(devices=[]):  # constructing draws numbers that are drawn again below
        network = PSMNet(
            max_disparity=settings.max_disparity, align_corners=settings.align_corners, width=settings.width
        )
    generator = torch.Generator().manual_seed(settings.seed)
    for layer in network.modules():
        if isinstance(layer, nn.Conv2d | nn.Conv3d | nn.ConvTranspose3d):
            spread = math.sqrt(2 / (math.prod(layer.kernel_size) * layer.out_channels))
            nn.init.normal_(layer.weight, 0.0, spread, generator=generator)
    network.to(settings.device)
    return _Run(settings, network, torch.optim.Adam(network.parameters(), lr=settings.learning_rate))


def _resumed(checkpoint: Path, settings: TrainingSettings) -> _Run:
    content = _loaded(checkpoint)
    before, now = content["settings"], _plain(settings)
    changed = [name for name in now if name not in _MAY_CHANGE and before.get(name) != now[name]]
    if changed:
        raise SettingError(
            "the training was started with other settings: "
            + ", ".join(f"{name} {before.get(name)} instead of {now[name]}" for name in changed),
            where=checkpoint,
            remedy="resume with the same ones, or start again in another folder",
        )
    run = _started(settings)
    run.network.load_state_dict(content["state_dict"])
    run.optimiser.load_state_dict(content["optimizer"])
    run.step = content["step"]
    run.rows = _rows(content)
    return run


def _loaded(checkpoint: Path) -> dict[str, Any]:
    try:
        loaded = load_safely(checkpoint, checkpoint.read_bytes())
    except OSError as error:
        raise SettingError(error.strerror or str(error), where=checkpoint, remedy="name a training's folder") from error
    if not isinstance(loaded, dict) or not {"settings", "state_dict", "optimizer", "step", "rows"} <= set(loaded):
        raise SettingError("no checkpoint of a training", where=checkpoint, remedy="name a training's folder")
    return loaded


def _rows(content: dict[str, Any]) -> list[TrainingRow]:
    return [TrainingRow(row["step"], row["loss"], Score(**row["validation"])) for row in content["rows"]]


def _plain(settings: TrainingSettings) -> dict[str, Any]:
    return dataclasses.asdict(settings) | {"crop": list(settings.crop)}


def _write(run: _Run, checkpoint: Path) -> None:
    settings = run.settings
    content = {
        "state_dict": run.network.state_dict(),
        METADATA: {"align_corners": settings.align_corners, "max_disparity": settings.max_disparity},
        "optimizer": run.optimiser.state_dict(),
        "step": run.step,
        "settings": _plain(settings),
        "rows": [dataclasses.asdict(row) for row in run.rows],
    }
    beside = checkpoint.with_suffix(".part")
    try:
        torch.save(content, beside)
        os.replace(beside, checkpoint)  # noqa: PTH105 - the same in one step on every platform
    except OSError as error:
        raise SettingError(error.strerror or str(error), where=checkpoint, remedy="choose another folder") from error


def _check(settings: TrainingSettings) -> None:
    rows, columns = settings.crop
    pooled = settings.batch * math.prod(max(1, length // _LARGEST_POOL_PX) for length in settings.crop)
    for wrong, what, remedy in (
        (
            settings.max_disparity < MULTIPLE or settings.max_disparity % MULTIPLE,
            "--max-disparity",
            f"a multiple of {MULTIPLE}",
        ),
        (min(settings.crop) < MULTIPLE or rows % MULTIPLE or columns % MULTIPLE, "--crop", f"multiples of {MULTIPLE}"),
        (not 1 <= settings.width <= 256, "--width", "1 to 256"),
        (pooled < 2, "--batch", "2 or more: batch normalisation needs two values of the widest pool"),
        (min(settings.steps, settings.validate_every) < 1, "--steps", "1 or more"),
        (not settings.learning_rate > 0, "--learning-rate", "above 0"),
        (settings.precision not in _PRECISIONS, "--precision", " or ".join(_PRECISIONS)),
        (settings.precision != "fp32" and settings.device == "cpu", "--precision", "fp32 on the CPU"),
        (settings.device != "cpu" and not torch.cuda.is_available(), "--device", "cpu where there is no GPU"),
    ):
        if wrong:
            raise SettingError("no training can be done so", where=what, remedy=f"it is {remedy}")
