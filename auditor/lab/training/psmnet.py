"""Training of a PSMNet on a fleet's own clean recordings and on synthetic streets."""

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from auditor.errors import SettingError
from auditor.lab.training.checkpoints import (
    CHECKPOINT,
    TrainingRow,
    TrainingRun,
    TrainingSettings,
    restore,
    training_curve,
    write,
)
from auditor.lab.training.samples import Sample, score
from auditor.measurement.disparity.matchers.psmnet.inference import Image, InferenceEngine, seen
from auditor.measurement.disparity.matchers.psmnet.network import MULTIPLE, PSMNet, Residual
from auditor.measurement.frame import prefetch
from auditor.model.arrays import Floats32

if TYPE_CHECKING:
    from auditor.lab.training.checkpoints import TrainingSettings


# Two cameras never record the same light: a part of the change is common to both, a part is each camera's own.
_GAMMAS, _GAINS, _OFFSETS = (0.7, 1.4), (0.75, 1.25), (-15.0, 15.0)

_OWN_GAINS, _OWN_OFFSETS, _NOISE = (0.92, 1.08), (-6.0, 6.0), (0.0, 4.0)


def crops(samples: Sequence[Sample], settings: "TrainingSettings", first: int) -> Iterator[list[Sample]]:
    """Batches of crops without end, from batch `first`: a pass takes every sample once, in an order of its own.

    A crop depends on the seed and its number alone, so that a resumed training gets the same crops as one without a
    break. Raises SettingError where there are no samples, or one is smaller than a crop.
    """
    if not len(samples):
        raise SettingError("there are no samples to train on", where="training", remedy="name clean recordings")
    number = first * settings.batch
    while True:
        batch = range(number, number + settings.batch)
        yield [_crop(samples[_place(one, len(samples), settings.seed)], settings, one) for one in batch]
        number = batch.stop


def _place(number: int, count: int, seed: int) -> int:
    turn, place = divmod(number, count)
    return int(np.random.default_rng((seed, 1, turn)).permutation(count)[place])


def _crop(sample: Sample, settings: "TrainingSettings", number: int) -> Sample:
    """A window of the network's pixels, grey, with disparities of the network's pixels."""
    left, right, truth = sample
    rows, columns = settings.crop
    if left.shape[:2] != truth.shape or right.shape[:2] != truth.shape:
        raise SettingError(
            f"images {left.shape[:2]} and {right.shape[:2]}, disparities {truth.shape}", where="training samples"
        )
    left, right = (seen(image, step=settings.step, colour=False) for image in (left, right))
    if settings.step == 2:
        truth = _one_of_four(truth) / 2
    spare = truth.shape[0] - rows, truth.shape[1] - columns
    if min(spare) < 0:
        raise SettingError(
            f"images of {truth.shape} pixels: no crop of {settings.crop}", where="training", remedy="use smaller crops"
        )
    rng = np.random.default_rng((settings.seed, number))
    top, start = (int(rng.integers(room + 1)) for room in spare)
    window = slice(top, top + rows), slice(start, start + columns)
    left, right = _varied((left[window], right[window]), rng)
    return left, right, truth[window]


def _one_of_four(truth: NDArray[np.floating]) -> NDArray[np.floating]:
    """(ceil(H / 2), ceil(W / 2)): of 2 x 2 disparities the first known one; their mean would be wrong at every edge."""
    padding = [(0, length % 2) for length in truth.shape]
    even = np.pad(truth, padding, constant_values=np.nan)
    chosen = even[::2, ::2]
    for other in (even[::2, 1::2], even[1::2, ::2], even[1::2, 1::2]):
        chosen = np.where(np.isnan(chosen), other, chosen)
    return chosen


def _varied(images: tuple[Image, Image], rng: np.random.Generator) -> tuple[Image, Image]:
    """The pair in another light, each image with a gain, an offset and noise of its own camera."""
    gamma, gain, offset = (float(rng.uniform(*bounds)) for bounds in (_GAMMAS, _GAINS, _OFFSETS))
    varied = []
    for image in images:
        own_gain, own_offset, noise = (float(rng.uniform(*bounds)) for bounds in (_OWN_GAINS, _OWN_OFFSETS, _NOISE))
        light = 255 * (image.astype(np.float32) / 255) ** gamma * (gain * own_gain) + (offset + own_offset)
        light += noise * rng.standard_normal(image.shape, dtype=np.float32)
        varied.append(np.clip(np.rint(light), 0, 255).astype(np.uint8))
    return varied[0], varied[1]


_OUTPUT_WEIGHTS = (0.5, 0.7, 1.0)
_WARM_UP = 20  # the share of the steps is one over it
_PRECISIONS = ("fp32", "bf16")
_LARGEST_POOL_PX = 256
_BATCHES_AHEAD = 2


def train(
    samples: Sequence[Sample],
    validation: Mapping[str, Sequence[Sample]],
    settings: TrainingSettings,
    folder: Path,
    *,
    resume: bool = False,
) -> Iterator[TrainingRow]:
    """Train on random crops of the samples, grey and in changing light; yields rows of the curve.

    Known disparities may be as sparse as a LiDAR's. Loss: smooth L1 of the three outputs, weighted 0.5, 0.7 and 1.0
    (Chang and Chen, section 3.6), over the known pixels within the range. With each row a checkpoint is written whole
    into `folder`. With `resume` it goes on from there: on a CPU every bit is that of an uninterrupted run.
    `validation` has samples by the name of their group. Raises SettingError for impossible settings, for samples that
    do not fit, for a checkpoint that is there without `resume`, and for `resume` without a checkpoint.
    """
    check_settings(settings)
    checkpoint = folder / CHECKPOINT
    if checkpoint.exists() != resume:
        problem = "no training to resume" if resume else "a training is here already"
        raise SettingError(
            problem, where=checkpoint, remedy="start one" if resume else "resume it, or use another folder"
        )
    run = _started(settings)
    if resume:
        restore(run, checkpoint)
    folder.mkdir(parents=True, exist_ok=True)
    losses: list[float] = []
    with closing(prefetch(crops(samples, settings, run.done), _BATCHES_AHEAD)) as batches:
        while run.done < settings.steps:
            losses.append(_step(run, next(batches)))
            if run.done % settings.validate_every == 0 or run.done == settings.steps:
                trained = _TrainedMatcher(run.network, settings)
                scores = {name: score(trained, group) for name, group in validation.items()}
                run.rows.append(TrainingRow(run.done, sum(losses) / len(losses), scores))
                losses.clear()
                write(run, checkpoint)
                yield run.rows[-1]


def best_precision(device: str) -> str:
    """bf16 (mixed precision) on GPUs that have it, else fp32."""
    capable = device != "cpu" and torch.cuda.is_available() and torch.cuda.is_bf16_supported()
    return "bf16" if capable else "fp32"


def use_threads(count: int) -> None:
    """Let the CPU train on so many threads."""
    torch.set_num_threads(count)


@dataclass(frozen=True, eq=False)
class _TrainedMatcher:
    """The network under training as a matcher."""

    network: PSMNet
    training: TrainingSettings
    name: str = "psmnet"
    settings: str = ""
    colour: bool = False

    @property
    def range_px(self) -> int:
        return self.training.max_disparity

    @property
    def step(self) -> int:
        return self.training.step

    def match(self, left: Image, right: Image) -> Floats32:
        self.network.eval()
        engine = InferenceEngine(self.network, torch.device(self.training.device))
        left, right = (seen(image, step=self.step, colour=False) for image in (left, right))
        features = engine.features([left, right])
        size = (left.shape[0], left.shape[1])
        disparity: Floats32 = engine.disparities(features[:1], features[1:], size)[0]
        return disparity * np.float32(self.step)


def _step(run: TrainingRun, crops: list[Sample]) -> float:
    settings = run.settings
    device = torch.device(settings.device)
    engine = InferenceEngine(run.network.train(), device)
    left, right = engine.load([crop[0] for crop in crops]), engine.load([crop[1] for crop in crops])
    truth = torch.from_numpy(np.stack([crop[2] for crop in crops]).astype(np.float32)).to(device)
    for group in run.optimiser.param_groups:
        group["lr"] = settings.learning_rate * _rate(run.done, settings.steps)
    run.optimiser.zero_grad()
    with torch.autocast(device.type, dtype=torch.bfloat16, enabled=settings.precision == "bf16"):
        outputs = run.network(left, right)
    loss = _loss(outputs, truth, settings.range_px)
    loss.backward()  # type: ignore[no-untyped-call]
    run.optimiser.step()
    run.done += 1
    value = loss.item()
    if not math.isfinite(value):
        raise SettingError(
            f"the loss is {value} at step {run.done}", where="training", remedy="use a smaller --learning-rate"
        )
    return value


def _rate(done: int, steps: int) -> float:
    """The share of the learning rate after a share of the steps: it rises linearly, then falls along a cosine."""
    warm_up = max(1, steps // _WARM_UP)
    return min(1.0, (done + 1) / warm_up) * 0.5 * (1 + math.cos(math.pi * done / steps))


def _loss(outputs: tuple[Tensor, ...], truth: Tensor, max_disparity: int) -> Tensor:
    labelled = (truth > 0) & (truth < max_disparity)  # False where it is NaN
    target = torch.where(labelled, truth, torch.zeros_like(truth))
    count = labelled.sum().clamp(min=1)
    losses = [functional.smooth_l1_loss(output, target, reduction="none") for output in outputs]
    return sum(
        (weight * (loss * labelled).sum() / count for weight, loss in zip(_OUTPUT_WEIGHTS, losses, strict=True)),
        start=torch.zeros((), device=truth.device),
    )


def _started(settings: TrainingSettings) -> TrainingRun:
    with torch.random.fork_rng(devices=[]):  # the constructor draws numbers, which are drawn again below
        network = PSMNet(max_disparity=settings.range_px, align_corners=settings.align_corners, width=settings.width)
    generator = torch.Generator().manual_seed(settings.seed)
    for layer in network.modules():
        if isinstance(layer, nn.Conv2d | nn.Conv3d | nn.ConvTranspose3d):
            spread = math.sqrt(2 / (math.prod(layer.kernel_size) * layer.out_channels))
            nn.init.normal_(layer.weight, 0.0, spread, generator=generator)
    _compare_from_the_start(network, settings.width)
    network.to(settings.device)
    return TrainingRun(settings, network, torch.optim.Adam(network.parameters(), lr=settings.learning_rate))


def _compare_from_the_start(network: PSMNet, width: int) -> None:
    """Initialise the network so that it compares features from the first step on.

    The first layer over the volume begins with f_L - f_R and its opposite, which after ReLU are what a matching cost is
    made of; and all that is added to a shortcut (residuals, hourglasses) begins at zero, as Goyal et al. do. Otherwise
    a small network learns no more than the mean disparity in its first hundreds of steps.
    """
    first = next(layer for layer in network.dres0.modules() if isinstance(layer, nn.Conv3d))
    with torch.no_grad():
        first.weight *= 0.1
        for output in range(width):
            feature, sign = output // 2, 1.0 - 2.0 * (output % 2)
            first.weight[output, feature, 1, 1, 1] += sign
            first.weight[output, width + feature, 1, 1, 1] -= sign
    hourglasses = (network.dres2, network.dres3, network.dres4)
    residuals = (module for module in network.modules() if isinstance(module, Residual))
    for added in (network.dres1, *(one.conv6 for one in hourglasses), *(one.conv2 for one in residuals)):
        *_, last = (layer for layer in added.modules() if isinstance(layer, nn.BatchNorm2d | nn.BatchNorm3d))
        nn.init.zeros_(last.weight)


def check_settings(settings: TrainingSettings) -> None:
    """Raises SettingError for settings with which training is impossible."""
    rows, columns = settings.crop
    pooled = settings.batch * math.prod(max(1, length // _LARGEST_POOL_PX) for length in settings.crop)
    multiple = MULTIPLE * settings.step
    for wrong, problem, remedy in (
        (
            settings.max_disparity < multiple or settings.max_disparity % multiple,
            "--max-disparity",
            f"a multiple of {multiple}",
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
            raise SettingError("training is not possible with this value", where=problem, remedy=f"it is {remedy}")


__all__ = [
    "CHECKPOINT",
    "TrainingRow",
    "TrainingSettings",
    "best_precision",
    "check_settings",
    "train",
    "training_curve",
    "use_threads",
]
