"""Cameras that share a view: their rectified frame, its maps, and what comparing them gives."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.measurement.checks.collect import FrameChecks, collect_checks
from auditor.measurement.count_grid import ImageGrid
from auditor.measurement.disparity.disparity_error import Comparison, compare_cameras, compare_with_lidar
from auditor.measurement.disparity.half_resolution import grey, halve
from auditor.measurement.disparity.lidar import LidarView, lidar_view
from auditor.measurement.disparity.stereo import StereoMap, textured, within
from auditor.measurement.disparity.warping import PairToSharedView
from auditor.measurement.parameters import HALF
from auditor.model.arrays import Image, Mask
from auditor.model.checks import Pair
from auditor.model.frames import Frame, PointCloud
from auditor.model.measurement import REGION_STEP
from auditor.model.rig import LIDAR, Rig, Triple

Maps = Mapping[Pair, StereoMap]


@dataclass(frozen=True, eq=False)
class FrameArrays:
    """The arrays from which the counts of one frame come, for drawing and localising: they are not stored.

    `rig` is the one that was measured, rectified where the recording's is not. `views` has the half-resolution (h, w)
    grey image of each camera present, `maps` the stereo maps by (source, reference), `lidar` the LiDAR's points by
    reference, `cloud` all of them.

    Where cameras do not stand on one line, `pairs` has the arrays of each matched pair (i, k) in its own view. All else
    is of the common view, to which `maps` were warped, but for `frame_checks`: those of pairs are of their own views,
    of which cameras see only their `valid_masks`, (H, W) at full resolution.
    """

    rig: Rig
    views: Mapping[int, NDArray[np.uint8]]
    comparisons: Mapping[Triple, Comparison]
    maps: Maps
    lidar: Mapping[int, LidarView]
    frame_checks: FrameChecks
    pairs: Mapping[Pair, "PairArrays"] = field(default_factory=dict)
    valid_masks: Mapping[int, Mask] = field(default_factory=dict)
    cloud: PointCloud | None = None

    @cached_property
    def small_views(self) -> Mapping[int, Image]:
        """The `views` shrunk to a region's pixels, by camera."""
        return {number: _shrunk(half) for number, half in self.views.items()}


@dataclass(frozen=True, eq=False)
class PairArrays:
    """The arrays of a pair's own view, in which its cameras are S_1 and S_2, and the warp to the common view."""

    own: FrameArrays
    to_shared: PairToSharedView


@dataclass(frozen=True, eq=False)
class RectifiedFrame:
    """A rectified frame with the `inputs` that its pairs (i, k) are matched from; `valid_masks` as in FrameArrays.

    By camera: `greys` (H, W), at half resolution `half_res` (h, w), and of colour cameras `colours` (h, w, 3). `grid`
    is that of the cameras' images where this is not their view.
    """

    frame: Frame
    rig: Rig
    greys: Mapping[int, NDArray[np.uint8]]
    colours: Mapping[int, NDArray[np.uint8]]
    half_res: Mapping[int, NDArray[np.uint8]]
    texture: Mapping[int, Mask]
    inputs: Mapping[int, NDArray[np.uint8]]
    triples: Sequence[Triple]
    pairs: Sequence[Pair]
    valid_masks: Mapping[int, Mask] = field(default_factory=dict)
    grid: ImageGrid | None = None


def prepare(
    frame: Frame, rig: Rig, triples: Sequence[Triple], pairs: Sequence[Pair], *, colour: bool
) -> RectifiedFrame:
    """Prepare a frame for matching these pairs, in colour or grey, so that the triples can be compared."""
    greys = {number: grey(image.pixels) for number, image in frame.images.items()}
    colours = {number: halve(one.pixels) for number, one in frame.images.items() if one.pixels.ndim > 2}
    half_res = {number: halve(pixels) for number, pixels in greys.items()}
    texture = {number: textured(half) for number, half in half_res.items()}
    inputs = {number: image.pixels for number, image in frame.images.items()} if colour else greys
    return RectifiedFrame(frame, rig, greys, colours, half_res, texture, inputs, triples, pairs)


def compare(prepared: RectifiedFrame, maps: Maps) -> FrameArrays:
    """Compare all disparity maps of the triples, the LiDAR projected once a view, and run the checks."""
    rig = prepared.rig
    if prepared.valid_masks:
        maps = {
            (i, k): within(stereo, prepared.valid_masks[k], prepared.valid_masks[i]) for (i, k), stereo in maps.items()
        }
    lidar = lidar_views(prepared.frame, rig, prepared.triples)
    comparisons = {
        triple: compare_with_lidar(lidar[triple.k], maps[triple.j, triple.k], triple.j)
        if triple.i == LIDAR
        else compare_cameras(
            maps[triple.i, triple.k],
            maps[triple.j, triple.k],
            rig.baseline_m(triple.i, triple.k),
            rig.baseline_m(triple.j, triple.k),
        )
        for triple in prepared.triples
    }
    masks, cloud = prepared.valid_masks, prepared.frame.cloud
    frame_checks = collect_checks(prepared.half_res, prepared.colours, maps, lidar, rig, prepared.grid, masks)
    return FrameArrays(rig, prepared.half_res, comparisons, maps, lidar, frame_checks, valid_masks=masks, cloud=cloud)


def _shrunk(half: Image) -> Image:
    size = (-(-half.shape[1] * HALF // REGION_STEP), -(-half.shape[0] * HALF // REGION_STEP))
    return np.asarray(cv2.resize(half, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def present(triples: Sequence[Triple], frame: Frame) -> list[Triple]:
    """Those of the triples whose sensors are all present."""
    there = {*frame.images, *([LIDAR] if frame.cloud is not None else [])}
    return [triple for triple in triples if there.issuperset(triple)]


def matched(triples: Collection[Triple]) -> list[Pair]:
    """(i, k) of all cameras that triples compare, each once."""
    sources = ((source, triple.k) for triple in triples for source in triple[:2])
    return list(dict.fromkeys((i, k) for i, k in sources if i not in (LIDAR, k)))


def lidar_views(frame: Frame, rig: Rig, triples: Collection[Triple]) -> dict[int, LidarView]:
    """The LiDAR's points in the view of each reference that triples compare them in."""
    references = dict.fromkeys(triple.k for triple in triples if triple.i == LIDAR)
    return {k: lidar_view(frame.cloud, rig, k) for k in references if frame.cloud is not None}
