"""A frame becomes counts of inconsistent pixels for every triple, and what the witnesses say of every pair."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from auditor.evidence.comparing import Comparison, compare_cameras, compare_with_lidar
from auditor.evidence.fingerprints import fingerprints
from auditor.evidence.lidar import LidarView, lidar_view
from auditor.evidence.matchers.interface import Matcher
from auditor.evidence.rectifying import rectification
from auditor.evidence.reduction import grey, halve
from auditor.evidence.stereo import StereoMap, stereo_maps
from auditor.evidence.testimony import Testimony, testify
from auditor.evidence.texture import textured
from auditor.frames import Frame
from auditor.results import Coverage, Measurement
from auditor.rig import LIDAR, Rig, Triple

_SATURATED = 254

Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Evidence:
    """What lies behind the counts of one frame, for drawing and localising: it is not stored for every frame.

    `views` has the half-resolution (h, w) grey image of each camera present, `maps` the stereo maps by (witness,
    reference), `lidar` the LiDAR's points by reference.
    """

    views: Mapping[int, NDArray[np.uint8]]
    comparisons: Mapping[Triple, Comparison]
    maps: Mapping[tuple[int, int], StereoMap]
    lidar: Mapping[int, LidarView]
    testimony: Testimony


def measure(frame: Frame, rig: Rig, matcher: Matcher) -> tuple[Measurement, Evidence]:
    """Compare all disparity maps of a frame: each pair of cameras is matched once, the LiDAR projected once a view.

    Images are (H, W) or (H, W, 3) uint8 of the rig's sizes; cameras that are not rectified are so first. A triple with
    an absent sensor has no counts. Raises RigError where the cameras have no view in common.
    """
    seen = rectification(rig)
    frame, rig = seen.frame(frame), seen.rig
    greys = {number: grey(image.pixels) for number, image in frame.images.items()}
    halves = {number: halve(pixels) for number, pixels in greys.items()}
    texture = {number: textured(half) for number, half in halves.items()}
    triples = [triple for triple in rig.triples if _present(triple, frame)]

    pairs = dict.fromkeys((witness, triple.k) for triple in triples for witness in triple[:2] if witness != LIDAR)
    inputs = {number: image.pixels for number, image in frame.images.items()} if matcher.colour else greys
    maps = stereo_maps(matcher, inputs, texture, pairs)
    references = dict.fromkeys(triple.k for triple in triples if triple.i == LIDAR)
    lidar = {k: lidar_view(frame.cloud, rig, k) for k in references if frame.cloud is not None}

    comparisons = {
        triple: compare_with_lidar(lidar[triple.k], maps[triple.j, triple.k], rig, triple.j)
        if triple.i == LIDAR
        else compare_cameras(
            maps[triple.i, triple.k],
            maps[triple.j, triple.k],
            rig.baseline_m(triple.i, triple.k),
            rig.baseline_m(triple.j, triple.k),
        )
        for triple in triples
    }
    testimony = testify(halves, maps, lidar, rig)
    measurement = Measurement(
        number=frame.number,
        stamp_ns=frame.stamp_ns,
        presence=frame.presence,
        counts=tuple(comparisons[t].counts if t in comparisons else None for t in rig.triples),
        coverage=_coverage(frame, greys, texture, maps, lidar),
        cells=testimony.cells,
        shares=testimony.shares,
        fingerprints=fingerprints(frame),
    )
    return measurement, Evidence(halves, comparisons, maps, lidar, testimony)


def _present(triple: Triple, frame: Frame) -> bool:
    return all(frame.cloud is not None if sensor == LIDAR else sensor in frame.images for sensor in triple)


def _coverage(
    frame: Frame,
    greys: Mapping[int, NDArray[np.uint8]],
    texture: Mapping[int, Mask],
    maps: Mapping[tuple[int, int], StereoMap],
    lidar: Mapping[int, LidarView],
) -> dict[int, Coverage]:
    coverage = {
        number: Coverage(
            saturated_share=float(np.mean(pixels >= _SATURATED)),
            textureless_share=1.0 - float(np.mean(texture[number])),
            unmatched_share=_unmatched_share(number, maps),
        )
        for number, pixels in greys.items()
    }
    if frame.cloud is not None:
        leftmost = max(lidar, default=None)
        coverage[LIDAR] = Coverage(returns=lidar[leftmost].returns if leftmost is not None else None)
    return coverage


def _unmatched_share(witness: int, maps: Mapping[tuple[int, int], StereoMap]) -> float | None:
    references = [k for i, k in maps if i == witness]
    if not references:
        return None
    return float(np.mean(np.isnan(maps[witness, max(references)].disparity_px)))
