"""Preflight of PSMNet before a recording is measured: its cost, and errors that its disparities do not show.

The wrong upsampling and too low a precision give plausible disparities: the first frames are checked for both.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from time import perf_counter

import numpy as np
import torch
from numpy.typing import NDArray

from auditor.measurement.disparity.lidar import lidar_view
from auditor.measurement.disparity.matchers.psmnet.matcher import PsmnetMatcher
from auditor.measurement.disparity.rectification import rectification
from auditor.measurement.disparity.stereo import seen_by_both
from auditor.model.arrays import Mask
from auditor.model.frames import Frame
from auditor.model.rig import Rig

_FEWEST_PX = 500  # known pixels of a frame, from which on a warning is founded
_NEAREST_TRUST_PX = 4.0  # of disparity, where 1 px of misalignment is a quarter
_RATIO_OFF_BY = 0.03  # share by which a ratio of disparities is off
_BETTER_BY_PX = 0.25  # of disparity, by which another reading fits better
_PRECISION_PX = 0.1  # of disparity, the mean by which a lower precision differs


Pixels = NDArray[np.floating]
"""Disparities in px, of any shape."""

_PROBE_PX = (128, 256)
_ROUNDS = 2
_HOUR_S, _MINUTE_S = 3600.0, 60.0


def preflight(matcher: PsmnetMatcher, rig: Rig, first: Sequence[Frame], count: int) -> Iterator[str]:
    """Sentences for people, from the first frames of a recording of `count` frames; the cost comes first."""
    seen = rectification(rig)
    camera = seen.rig.cameras[-1]
    # A camera is another image in each pair that has a view of its own.
    images = 2 * len(rig.pairs) if seen.pairs else len({camera for pair in rig.pairs for camera in pair})
    cost = frame_cost(matcher, (camera.height_px, camera.width_px))
    frame_s = cost.frame_s(images, len(rig.pairs))
    where = cost.device if cost.device != "cpu" else f"cpu ({cost.threads} threads)"
    yield f"psmnet on {where}: about {_span(frame_s)} a frame, {_span(frame_s * count)} for {count} frames"
    if seen.pairs:
        own = seen.pairs[1, rig.n]
        yield from first_frames_warnings(matcher, own.seen.rig, [own.frame(frame) for frame in first], own.valid_masks)
    else:
        yield from first_frames_warnings(matcher, seen.rig, [seen.frame(frame) for frame in first])


@dataclass(frozen=True)
class ScaleCheck:
    """How PSMNet's disparities stand to the LiDAR's on the same pixels.

    `ratio` is the median of PSMNet / LiDAR, `residual_px` the median of |PSMNet - LiDAR|, `other_residual_px` the same
    with the other `align_corners`. `warning` is None where both fit.
    """

    pixels: int
    ratio: float
    residual_px: float
    other_residual_px: float
    warning: str | None


def check_scale(
    pairs: Iterable[tuple[Pixels, Pixels]], *, align_corners: bool, max_disparity: int, step: int = 1
) -> ScaleCheck | None:
    """Compare (M,) disparities of PSMNet with the LiDAR's at the same pixels, in a pair of arrays a frame or view.

    Pixels where either is NaN, where the LiDAR has under 4 px or where it leaves PSMNet's range are not used; None
    where under 500 are left. Upsampling D / 4 levels to D puts level i at i (D - 1) / (D / 4 - 1) with aligned corners
    and at 4 i + 1.5 without, in the network's own pixels, `step` of the full image wide: with the wrong convention d
    becomes a linear function of d, which is inverted here to see whether it agrees better with the LiDAR.
    """
    parts = list(pairs)
    if not parts:
        return None
    network, lidar = (np.concatenate([np.ravel(part[side]) for part in parts]) for side in (0, 1))
    used = (lidar >= _NEAREST_TRUST_PX) & (lidar < max_disparity) & ~np.isnan(network)
    network, lidar = network[used], lidar[used]
    if lidar.size < _FEWEST_PX:
        return None
    ratio = float(np.median(network / lidar))
    residual = float(np.median(np.abs(network - lidar)))
    other = float(np.median(np.abs(_under_other(network / step, align_corners, max_disparity // step) * step - lidar)))
    return ScaleCheck(int(lidar.size), ratio, residual, other, _warning(ratio, residual, other, align_corners))


def _under_other(disparity: Pixels, align_corners: bool, max_disparity: int) -> Pixels:  # noqa: FBT001 - private
    level = (max_disparity - 1) / (max_disparity / 4 - 1)
    return disparity / level * 4 + 1.5 if align_corners else (disparity - 1.5) / 4 * level


def _warning(ratio: float, residual: float, other: float, align_corners: bool) -> str | None:  # noqa: FBT001 - private
    figures = f"PSMNet / LiDAR has the median {ratio:.3f}, they differ by {residual:.2f} px"
    if other + _BETTER_BY_PX < residual:
        return (
            f"PSMNet's disparities are off scale: {figures}, but by {other:.2f} px with align_corners="
            f"{not align_corners}; the weights were probably trained with that"
        )
    if abs(ratio - 1) > _RATIO_OFF_BY:
        return f"PSMNet's disparities are off scale: {figures}; check the weights and the camera calibration"
    return None


@dataclass(frozen=True)
class PrecisionCheck:
    """Mean and largest difference in pixels of a lower precision's disparities from those of fp32."""

    mean_px: float
    largest_px: float
    warning: str | None


def check_precision(
    matcher: PsmnetMatcher, images: Sequence[NDArray[np.uint8]], pairs: Sequence[tuple[int, int]]
) -> PrecisionCheck:
    """Match some pairs once more in fp32; warns where the disparities differ by over 0.1 px on average."""
    exact = matcher.exact().match_pairs(images, pairs)
    differences = np.abs(np.stack(matcher.match_pairs(images, pairs)) - np.stack(exact))
    mean, largest = float(differences.mean()), float(differences.max())
    warning = None
    if not mean <= _PRECISION_PX:  # an overflow's NaN is over it too
        warning = f"{matcher.precision} changes PSMNet's disparities by {mean:.2f} px on average; use fp32 or tf32"
    return PrecisionCheck(mean, largest, warning)


def first_frames_warnings(
    matcher: PsmnetMatcher, rig: Rig, frames: Iterable[Frame], valid_masks: Mapping[int, Mask] | None = None
) -> tuple[str, ...]:
    """Warnings about a matcher on the first frames of a recording; none where nothing can be checked.

    Each frame costs one pair more: the leftmost camera with the rightmost, whose disparities are the largest; with a
    lower precision than fp32 the first of them costs that pair twice again. Of images that are not seen whole only the
    pixels of `valid_masks` (H, W) are used.
    """
    measured: list[tuple[Pixels, Pixels]] = []
    warnings: list[str | None] = []
    leftmost, rightmost = rig.cameras[-1].number, rig.cameras[0].number
    for frame in frames:
        if not {leftmost, rightmost} <= set(frame.images):
            continue
        images = [frame.images[number].pixels for number in (leftmost, rightmost)]
        if matcher.precision != "fp32" and not measured:
            warnings.append(check_precision(matcher, images, [(0, 1)]).warning)
        disparity = matcher.match_pairs(images, [(0, 1)])[0]
        truth = np.full_like(disparity, np.nan)
        if frame.cloud is not None:
            view = lidar_view(frame.cloud, rig, leftmost)
            truth[view.row // matcher.step, view.column // matcher.step] = view.disparity_px(rightmost)
            if valid_masks:
                truth[~seen_by_both(truth, matcher.step, valid_masks[leftmost], valid_masks[rightmost])] = np.nan
        measured.append((disparity, truth))
    scale = check_scale(
        measured, align_corners=matcher.align_corners, max_disparity=matcher.range_px, step=matcher.step
    )
    warnings.append(scale.warning if scale else None)
    return tuple(warning for warning in warnings if warning)


@dataclass(frozen=True)
class Cost:
    """Seconds that the features of one image and the comparison of one pair take on this machine."""

    seconds_per_image: float
    seconds_per_pair: float
    device: str
    threads: int

    def frame_s(self, images: int, pairs: int) -> float:
        """Seconds for a frame of so many images, each used once, compared in so many pairs."""
        return images * self.seconds_per_image + pairs * self.seconds_per_pair


def frame_cost(matcher: PsmnetMatcher, size: tuple[int, int]) -> Cost:
    """The cost for images of `size` (H, W), from a small image measured on the spot and scaled by the pixels.

    Both parts of the network take time in proportion to the pixels; measuring takes about a second on a CPU.
    """
    scale = size[0] * size[1] / matcher.step**2 / (_PROBE_PX[0] * _PROBE_PX[1])
    image = np.zeros((*_PROBE_PX, 3), dtype=np.uint8)
    engine = matcher.engine
    features = engine.features([image])
    return Cost(
        scale * _seconds(lambda: engine.features([image]).cpu()),  # .cpu() waits for a GPU to have finished
        scale * _seconds(lambda: engine.disparities(features, features, _PROBE_PX)),
        str(engine.device),
        torch.get_num_threads(),
    )


def _seconds(work: Callable[[], object]) -> float:
    """The best of a few rounds: the first one also pays for setting up."""
    rounds = []
    for _ in range(_ROUNDS):
        started = perf_counter()
        work()
        rounds.append(perf_counter() - started)
    return min(rounds)


def _span(seconds: float) -> str:
    if seconds >= _HOUR_S:
        return f"{seconds / _HOUR_S:.1f} h"
    if seconds >= 2 * _MINUTE_S:
        return f"{seconds / _MINUTE_S:.0f} min"
    return f"{seconds:.2g} s" if seconds < 10 else f"{seconds:.0f} s"
