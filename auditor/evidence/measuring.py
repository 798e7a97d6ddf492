"""A frame becomes counts of inconsistent pixels for every triple, and what the witnesses say of every pair."""

from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from auditor.evidence.ahead import ahead
from auditor.evidence.comparing import Comparison, compare_cameras, compare_with_lidar
from auditor.evidence.fingerprints import fingerprints
from auditor.evidence.lidar import LidarView, lidar_view
from auditor.evidence.matchers.interface import Matcher, pairs_at_once
from auditor.evidence.rectifying import rectification
from auditor.evidence.reduction import grey, halve
from auditor.evidence.stereo import StereoMap, stereo_maps
from auditor.evidence.testimony import Testimony, testify
from auditor.evidence.texture import textured
from auditor.frames import Frame, Skipped
from auditor.results import Coverage, Measurement
from auditor.rig import LIDAR, Rig, Triple

_SATURATED = 254

Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Evidence:
    """What lies behind the counts of one frame, for drawing and localising: it is not stored for every frame.

    `rig` is the one that was measured, rectified where the recording's is not. `views` has the half-resolution (h, w)
    grey image of each camera present, `maps` the stereo maps by (witness, reference), `lidar` the LiDAR's points by
    reference.
    """

    rig: Rig
    views: Mapping[int, NDArray[np.uint8]]
    comparisons: Mapping[Triple, Comparison]
    maps: Mapping[tuple[int, int], StereoMap]
    lidar: Mapping[int, LidarView]
    testimony: Testimony


Measured = tuple[Measurement, Evidence]
_Maps = Mapping[tuple[int, int], StereoMap]


@dataclass(frozen=True, eq=False)
class _Looked:
    """A rectified frame with what its pairs of cameras are matched from."""

    frame: Frame
    rig: Rig
    greys: Mapping[int, NDArray[np.uint8]]
    halves: Mapping[int, NDArray[np.uint8]]
    texture: Mapping[int, Mask]
    triples: Sequence[Triple]
    inputs: Mapping[int, NDArray[np.uint8]]

    @property
    def pairs(self) -> list[tuple[int, int]]:
        """(i, k) of all cameras that are compared."""
        witnesses = ((witness, triple.k) for triple in self.triples for witness in triple[:2])
        return list(dict.fromkeys(pair for pair in witnesses if pair[0] != LIDAR))


def measure(frame: Frame, rig: Rig, matcher: Matcher) -> Measured:
    """Compare all disparity maps of a frame: each pair of cameras is matched once, the LiDAR projected once a view.

    Images are (H, W) or (H, W, 3) uint8 of the rig's sizes; cameras that are not rectified are so first. A triple with
    an absent sensor has no counts. Raises RigError where the cameras have no view in common.
    """
    looked = _look(frame, rig, matcher)
    return _compare(looked, _match([looked], matcher)[0])


def measure_stream(frames: Iterable[Frame | Skipped], rig: Rig, matcher: Matcher) -> Generator[Skipped | Measured]:
    """What `measure` gives for each frame, in their order; skipped ones pass through.

    For a matcher that takes many pairs at once, frames go to it in groups: while it matches one, the next is decoded
    in a thread, and the last is compared in the thread that asks. Others get frame after frame, and no thread.
    """
    at_once = pairs_at_once(matcher) // max(1, _pair_count(rig))
    if pairs_at_once(matcher) == 1:
        yield from (item if isinstance(item, Skipped) else measure(item, rig, matcher) for item in frames)
        return
    groups = ahead(_grouped(frames, rig, matcher, max(1, at_once)))
    with closing(ahead(_matched(groups, matcher))) as matched:
        for group, maps in matched:
            of_frames = iter(maps)
            for item in group:
                yield item if isinstance(item, Skipped) else _compare(item, next(of_frames))


def _pair_count(rig: Rig) -> int:
    return len({(witness, triple.k) for triple in rig.triples for witness in triple[:2] if witness != LIDAR})


def _grouped(
    frames: Iterable[Frame | Skipped], rig: Rig, matcher: Matcher, size: int
) -> Iterator[list[_Looked | Skipped]]:
    items = (item if isinstance(item, Skipped) else _look(item, rig, matcher) for item in frames)
    while group := list(islice(items, size)):
        yield group


def _matched(
    groups: Generator[list[_Looked | Skipped]], matcher: Matcher
) -> Iterator[tuple[list[_Looked | Skipped], list[_Maps]]]:
    with closing(groups):
        for group in groups:
            yield group, _match([item for item in group if isinstance(item, _Looked)], matcher)


def _look(frame: Frame, rig: Rig, matcher: Matcher) -> _Looked:
    seen = rectification(rig)
    frame, rig = seen.frame(frame), seen.rig
    greys = {number: grey(image.pixels) for number, image in frame.images.items()}
    halves = {number: halve(pixels) for number, pixels in greys.items()}
    texture = {number: textured(half) for number, half in halves.items()}
    triples = [triple for triple in rig.triples if _present(triple, frame)]
    inputs = {number: image.pixels for number, image in frame.images.items()} if matcher.colour else greys
    return _Looked(frame, rig, greys, halves, texture, triples, inputs)


def _match(looked: Sequence[_Looked], matcher: Matcher) -> list[_Maps]:
    """The maps of each frame; the matcher sees the pairs of all frames at once."""
    images = {(at, number): pixels for at, one in enumerate(looked) for number, pixels in one.inputs.items()}
    texture = {(at, number): mask for at, one in enumerate(looked) for number, mask in one.texture.items()}
    pairs = [((at, i), (at, k)) for at, one in enumerate(looked) for i, k in one.pairs]
    maps = stereo_maps(matcher, images, texture, pairs)
    found: list[dict[tuple[int, int], StereoMap]] = [{} for _ in looked]
    for ((at, i), (_, k)), stereo in maps.items():
        found[at][i, k] = stereo
    return list(found)


def _compare(looked: _Looked, maps: _Maps) -> Measured:
    frame, rig, triples = looked.frame, looked.rig, looked.triples
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
    testimony = testify(looked.halves, maps, lidar, rig)
    measurement = Measurement(
        number=frame.number,
        stamp_ns=frame.stamp_ns,
        presence=frame.presence,
        counts=tuple(comparisons[t].counts if t in comparisons else None for t in rig.triples),
        coverage=_coverage(frame, looked.greys, looked.texture, maps, lidar),
        cells=testimony.cells,
        shares=testimony.shares,
        fingerprints=fingerprints(frame),
    )
    return measurement, Evidence(rig, looked.halves, comparisons, maps, lidar, testimony)


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
            level=float(np.mean(pixels)),
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
