"""Batches for training: random crops of samples, with random changes of light and noise."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from auditor.errors import SettingError
from auditor.measurement.disparity.matchers.psmnet.inference import Image, seen
from auditor.measurement.disparity.matchers.scoring import Sample

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
    found = even[::2, ::2]
    for other in (even[::2, 1::2], even[1::2, ::2], even[1::2, 1::2]):
        found = np.where(np.isnan(found), other, found)
    return found


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
