"""Cameras that share a view: what is matched, and what the maps then say of the sensors."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from auditor.measurement.checks.collect import FrameChecks, collect_checks
from auditor.measurement.checks.disparity_error import Comparison, compare_cameras, compare_with_lidar
from auditor.measurement.disparity.half_resolution import grey, halve
from auditor.measurement.disparity.lidar import LidarView, lidar_view
from auditor.measurement.disparity.stereo import StereoMap, textured, within
from auditor.measurement.disparity.warping import PairToSharedView
from auditor.model.checks import Pair
from auditor.model.frames import Frame
from auditor.model.rig import LIDAR, Rig, Triple

Mask = NDArray[np.bool_]
Maps = Mapping[Pair, StereoMap]


@dataclass(frozen=True, eq=False)
class Evidence:
    """What lies behind the counts of one frame, for drawing and localising: it is not stored for every frame.

    `rig` is the one that was measured, rectified where the recording's is not. `views` has the half-resolution (h, w)
    grey image of each camera present, `maps` the stereo maps by (witness, reference), `lidar` the LiDAR's points by
    reference.

    Where cameras do not stand on one line, `pairs` has what each pair matched, (i, k), saw in its own view. All else is
    of the common view, where `maps` were brought back to, but for `testimony`: pairs speak of their own views, of which
    cameras see only their `sights`, (H, W) masks at full resolution.
    """

    rig: Rig
    views: Mapping[int, NDArray[np.uint8]]
    comparisons: Mapping[Triple, Comparison]
    maps: Maps
    lidar: Mapping[int, LidarView]
    frame_checks: FrameChecks
    pairs: Mapping[Pair, "OwnEvidence"] = field(default_factory=dict)
    valid_masks: Mapping[int, Mask] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class OwnEvidence:
    """The evidence of a pair's own view, in which its cameras are S_1 and S_2, and the way back to the common view."""

    own: Evidence
    back: PairToSharedView


@dataclass(frozen=True, eq=False)
class RectifiedFrame:
    """A rectified frame with what its pairs of cameras (i, k) are matched from; `sights` as Evidence has them."""

    frame: Frame
    rig: Rig
    greys: Mapping[int, NDArray[np.uint8]]
    half_res: Mapping[int, NDArray[np.uint8]]
    texture: Mapping[int, Mask]
    inputs: Mapping[int, NDArray[np.uint8]]
    triples: Sequence[Triple]
    pairs: Sequence[Pair]
    valid_masks: Mapping[int, Mask] = field(default_factory=dict)


def prepare(
    frame: Frame, rig: Rig, triples: Sequence[Triple], pairs: Sequence[Pair], *, colour: bool
) -> RectifiedFrame:
    """Make what these pairs are matched from, in colour or grey, so that the triples can be compared."""
    greys = {number: grey(image.pixels) for number, image in frame.images.items()}
    half_res = {number: halve(pixels) for number, pixels in greys.items()}
    texture = {number: textured(half) for number, half in half_res.items()}
    inputs = {number: image.pixels for number, image in frame.images.items()} if colour else greys
    return RectifiedFrame(frame, rig, greys, half_res, texture, inputs, triples, pairs)


def compare(prepared: RectifiedFrame, maps: Maps) -> Evidence:
    """Compare all disparity maps of the triples, the LiDAR projected once a view, and hear the witnesses."""
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
    frame_checks = collect_checks(prepared.half_res, maps, lidar, rig)
    return Evidence(rig, prepared.half_res, comparisons, maps, lidar, frame_checks, valid_masks=prepared.valid_masks)


def present(triples: Sequence[Triple], frame: Frame) -> list[Triple]:
    """Those of the triples whose sensors are all there."""
    there = {*frame.images, *([LIDAR] if frame.cloud is not None else [])}
    return [triple for triple in triples if there.issuperset(triple)]


def matched(triples: Collection[Triple]) -> list[Pair]:
    """(i, k) of all cameras that triples compare, each once."""
    sources = ((source, triple.k) for triple in triples for source in triple[:2])
    return list(dict.fromkeys(pair for pair in sources if pair[0] != LIDAR))


def lidar_views(frame: Frame, rig: Rig, triples: Collection[Triple]) -> dict[int, LidarView]:
    """The LiDAR's points in the view of each reference that triples compare them in."""
    references = dict.fromkeys(triple.k for triple in triples if triple.i == LIDAR)
    return {k: lidar_view(frame.cloud, rig, k) for k in references if frame.cloud is not None}
