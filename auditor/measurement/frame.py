"""A frame becomes a Measurement: counts for every triple, and for the checks counts on grids, or their statistics.

What the counts on grids say is told by `identification.statistics`.
"""

from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from itertools import islice
from queue import Full, Queue
from threading import Event, Thread
from typing import Generic, NamedTuple, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.measurement.checks.collect import with_scans
from auditor.measurement.checks.free_space_conflict import OwnScans
from auditor.measurement.disparity.matchers.interface import Matcher, PairMatcher, for_pair, pairs_at_once, takes_pairs
from auditor.measurement.disparity.rectification import PairView, rectification
from auditor.measurement.disparity.stereo import StereoMap, stereo_map, stereo_maps
from auditor.measurement.drawn_pixels import DrawnPixels
from auditor.measurement.fault_features.added_light import saturated_by_light
from auditor.measurement.fault_features.collect import fingerprints
from auditor.measurement.lidars_alone import LidarsAlone
from auditor.measurement.own_past import OwnPast
from auditor.measurement.pairwise_views import OF_TWO, join
from auditor.measurement.shared_view import FrameArrays, Maps, RectifiedFrame, compare, matched, prepare, present
from auditor.model.arrays import Image, Mask
from auditor.model.checks import Check, CountedPair, Pair
from auditor.model.frames import Frame, SkippedFrame
from auditor.model.measurement import Cells, Coverage, Measurement
from auditor.model.optics.common_view import shown_shares
from auditor.model.rig import LIDAR, Rig

_SATURATED = 254  # the two top levels of a byte are reported as saturated


Item = TypeVar("Item")

MeasuredFrame = tuple[Measurement, FrameArrays]

_POLL_S = 0.05


def prefetch(items: Iterable[Item], count: int = 1) -> Generator[Item]:
    """The items in their order, made in a thread that is at most `count` of them ahead.

    An error in making an item is raised in its place. The thread ends where this generator is closed or fails.
    """
    maker = _Maker(items, count)
    maker.thread.start()
    try:
        while (made := maker.made.get()) is not None:
            yield made[0]
        if maker.error is not None:
            raise maker.error
    finally:
        maker.left.set()
        maker.thread.join()


class _Maker(Generic[Item]):
    """Puts each item into a queue, in a tuple of its own, then None."""

    def __init__(self, items: Iterable[Item], count: int) -> None:
        self.items = items
        self.made: Queue[tuple[Item] | None] = Queue(count)
        self.left = Event()
        self.error: BaseException | None = None
        self.thread = Thread(target=self._run, daemon=True)

    def _run(self) -> None:
        try:
            for item in self.items:
                self._put((item,))
                if self.left.is_set():
                    break
        except BaseException as error:  # noqa: BLE001 - it is raised again where the items are used
            self.error = error
        if isinstance(self.items, Generator):
            self.items.close()  # here, where it runs
        self._put(None)

    def _put(self, made: tuple[Item] | None) -> None:
        while not self.left.is_set():
            try:
                self.made.put(made, timeout=_POLL_S)
            except Full:
                continue
            return


@dataclass(frozen=True, eq=False)
class _PreparedFrame:
    """A frame that is ready for matching: `whole`, and in `parts` each pair that has a view of its own in `views`.

    `of_picture` is the share of each camera's recorded picture that the view shows in which it is counted.
    """

    whole: RectifiedFrame
    parts: Mapping[Pair, RectifiedFrame]
    views: Mapping[Pair, PairView]
    of_picture: Mapping[int, float]

    @property
    def matched(self) -> list[RectifiedFrame]:
        """What the matcher sees."""
        return list(self.parts.values()) if self.views else [self.whole]


def measure(frame: Frame, rig: Rig, matcher: Matcher) -> MeasuredFrame:
    """Compare all disparity maps of a frame: each pair of cameras is matched once, the LiDAR projected once a view.

    Images are (H, W) or (H, W, 3) uint8 of the rig's sizes; cameras that are not rectified are so first. A triple with
    an absent sensor has no counts. One frame alone has no past, so that a lone camera is compared with nothing. Raises
    RigError where the cameras have no view in common.
    """
    return _measured(frame, rig, matcher, _Past.of(rig))


@dataclass(frozen=True)
class _Past:
    """What frames of a recording are compared with: the LiDAR's last scan, and of a lone camera its own past.

    `drawn` is what was drawn into the pictures of cameras that others are compared with. LiDARs without cameras have a
    past of their own.
    """

    scans: OwnScans
    camera: OwnPast | None
    drawn: DrawnPixels
    lidars: LidarsAlone | None = None

    @classmethod
    def of(cls, rig: Rig) -> "_Past":
        own = OwnPast() if rig.by_time and rig.cameras else None
        return cls(OwnScans(), own, DrawnPixels(), None if rig.cameras else LidarsAlone(rig))

    def with_scans(self, frame: Frame, arrays: FrameArrays) -> FrameArrays:
        """The arrays with what the LiDAR's last scan says of its points."""
        from_nowhere = self.scans.conflicts(frame.cloud, arrays.rig)
        checks = with_scans(arrays.frame_checks, from_nowhere, arrays.lidar, arrays.rig)
        return replace(arrays, frame_checks=checks)

    def hide(self, prepared: _PreparedFrame) -> _PreparedFrame:
        """The frame without what was drawn into its pictures, where these are compared with others."""
        if self.camera is not None:
            return prepared
        if prepared.views:
            return replace(prepared, parts={p: self.drawn.hidden(part, p) for p, part in prepared.parts.items()})
        return replace(prepared, whole=self.drawn.hidden(prepared.whole))


def _measured(frame: Frame, rig: Rig, matcher: Matcher, past: _Past) -> MeasuredFrame:
    prepared = past.hide(_prepare(frame, rig, matcher))
    return _compare(prepared, _match([prepared], matcher)[0], past)


def measure_stream(
    frames: Iterable[Frame | SkippedFrame], rig: Rig, matcher: Matcher
) -> Generator[SkippedFrame | MeasuredFrame]:
    """What `measure` gives for each frame, in their order; skipped ones pass through. A lone camera has its own past.

    A matcher that takes many pairs at once gets frames in groups: while it matches one, a thread decodes the next, and
    the caller's thread compares the last. Other matchers get frame after frame, and there is no thread.
    """
    past = _Past.of(rig)
    at_once = pairs_at_once(matcher) // max(1, len(rig.pairs))
    if pairs_at_once(matcher) == 1:
        yield from (item if isinstance(item, SkippedFrame) else _measured(item, rig, matcher, past) for item in frames)
        return
    groups = prefetch(_grouped(frames, rig, matcher, past, max(1, at_once)))
    with closing(prefetch(_matched(groups, matcher))) as done:
        for group, maps in done:
            of_frames = iter(maps)
            for item in group:
                yield item if isinstance(item, SkippedFrame) else _compare(item, next(of_frames), past)


def _grouped(
    frames: Iterable[Frame | SkippedFrame], rig: Rig, matcher: Matcher, past: _Past, size: int
) -> Iterator[list[_PreparedFrame | SkippedFrame]]:
    items = (item if isinstance(item, SkippedFrame) else past.hide(_prepare(item, rig, matcher)) for item in frames)
    while group := list(islice(items, size)):
        yield group


def _matched(
    groups: Generator[list[_PreparedFrame | SkippedFrame]], matcher: Matcher
) -> Iterator[tuple[list[_PreparedFrame | SkippedFrame], list[list[Maps]]]]:
    with closing(groups):
        for group in groups:
            yield group, _match([item for item in group if isinstance(item, _PreparedFrame)], matcher)


def _prepare(frame: Frame, rig: Rig, matcher: Matcher) -> _PreparedFrame:
    seen = rectification(rig)
    rectified = seen.frame(frame)
    triples = present(seen.triples, rectified)
    pairs = matched(triples)
    whole = prepare(rectified, seen.rig, triples, pairs, colour=matcher.colour)
    parts = {pair: _prepare_pair(seen.pairs[pair], frame, matcher) for pair in pairs if seen.pairs}
    return _PreparedFrame(whole, parts, seen.pairs, shown_shares(rig))


def _prepare_pair(view: PairView, frame: Frame, matcher: Matcher) -> RectifiedFrame:
    of_two, rig = view.frame(frame), view.seen.rig
    prepared = prepare(of_two, rig, present(rig.triples, of_two), [OF_TWO], colour=matcher.colour)
    return replace(prepared, valid_masks=view.valid_masks, grid=view.to_shared.grid)


def _match(prepared: Sequence[_PreparedFrame], matcher: Matcher) -> list[list[Maps]]:
    """The maps of all that is matched in each frame."""
    if takes_pairs(matcher):
        return _match_together(prepared, matcher)
    return [[_maps_of(part, matcher) for part in frame.matched] for frame in prepared]


def _maps_of(part: RectifiedFrame, matcher: Matcher) -> Maps:
    inputs, texture = part.inputs, part.texture
    return {
        (i, k): stereo_map(for_pair(matcher, part.rig, i, k), inputs[k], inputs[i], texture[k], texture[i])
        for i, k in part.pairs
    }


def _match_together(prepared: Sequence[_PreparedFrame], matcher: PairMatcher) -> list[list[Maps]]:
    """The matcher gets the pairs of all frames at once."""
    every = [one for frame in prepared for one in frame.matched]
    images = {(at, number): pixels for at, one in enumerate(every) for number, pixels in one.inputs.items()}
    texture = {(at, number): mask for at, one in enumerate(every) for number, mask in one.texture.items()}
    pairs = [((at, i), (at, k)) for at, one in enumerate(every) for i, k in one.pairs]
    maps: list[dict[Pair, StereoMap]] = [{} for _ in every]
    for ((at, i), (_, k)), stereo in stereo_maps(matcher, images, texture, pairs).items():
        maps[at][i, k] = stereo
    of_frames = iter(maps)
    return [list(islice(of_frames, len(frame.matched))) for frame in prepared]


def _compare(prepared: _PreparedFrame, maps: Sequence[Maps], past: _Past) -> MeasuredFrame:
    if past.camera is not None:
        arrays = past.camera.compare(prepared.whole)
    elif prepared.views:
        parts = {pair: compare(part, its) for (pair, part), its in zip(prepared.parts.items(), maps, strict=True)}
        arrays = join(prepared.whole, parts, prepared.views)
    else:
        arrays = compare(prepared.whole, maps[0])
    frame, comparisons = prepared.whole.frame, arrays.comparisons
    if past.lidars is None:
        arrays = past.with_scans(frame, arrays)
        coverage = _coverage(prepared, arrays)
    else:
        shares, coverage, disputed = past.lidars.compare(frame)
        arrays = replace(arrays, frame_checks=replace(arrays.frame_checks, of_lidars=shares, disputed=disputed))
    measurement = Measurement(
        number=frame.number,
        stamp_ns=frame.stamp_ns,
        presence=frame.presence,
        counts=tuple(comparisons[t].counts if t in comparisons else None for t in arrays.rig.measured_triples),
        coverage=coverage,
        cells=arrays.frame_checks.cells,
        shares=arrays.frame_checks.shares,
        unmasked_cells=arrays.frame_checks.unmasked_cells,
        fingerprints=fingerprints(frame),
    )
    return measurement, arrays


def _coverage(prepared: _PreparedFrame, arrays: FrameArrays) -> dict[int, Coverage]:
    whole, cells = prepared.whole, arrays.frame_checks.cells
    maps: Maps = {pair: part.own.maps[OF_TWO] for pair, part in arrays.pairs.items()} or arrays.maps
    saturated = saturated_by_light(cells, whole.half_res)
    cloud = whole.frame.cloud
    of_pasts = arrays.frame_checks.of_pasts.values()
    by_past = {k: max(of[k].looked_share for of in of_pasts if k in of) for of in of_pasts for k in of}
    looked = looked_at(cells, prepared.of_picture, None if cloud is None else len(cloud.xyz_m))
    coverage = {
        number: replace(
            brightness(whole.frame.images[number].pixels, pixels),
            saturated_px=saturated.get(number),
            textureless_share=1.0 - _share(whole.texture[number]),
            unmatched_share=arrays.frame_checks.unmatched.get(number, _unmatched_share(number, maps)),
            compared_share=by_past.get(number, looked[number].by_one),
            compared_by_two_share=looked[number].by_two,
        )
        for number, pixels in whole.greys.items()
    }
    if cloud is not None:
        leftmost = max(arrays.lidar, default=None)
        coverage[LIDAR] = Coverage(
            returns=arrays.lidar[leftmost].returns if leftmost is not None else None,
            compared_share=looked[LIDAR].by_one,
            compared_by_two_share=looked[LIDAR].by_two,
        )
    return coverage


def brightness(image: NDArray[np.uint8], greys: NDArray[np.uint8]) -> Coverage:
    """How bright an image (H, W), or (H, W, 3) BGR, is, and how blue and red it is; `greys` is it in grey."""
    blue, _, red, _ = (total / greys.size for total in cv2.sumElems(image))
    coverage = Coverage(_share(greys >= _SATURATED), level=cv2.sumElems(greys)[0] / greys.size)
    return coverage if image.shape == greys.shape else replace(coverage, blue_level=blue, red_level=red)


def _unmatched_share(source: int, maps: Maps) -> float | None:
    references = [k for i, k in maps if i == source]
    if not references:
        return None
    return _share(np.isnan(maps[source, max(references)].disparity_px))


def _share(mask: Mask) -> float:
    return float(np.count_nonzero(mask)) / mask.size


class ComparedShares(NamedTuple):
    """Shares, 0 to 1, of a camera's picture or of the LiDAR's points, that one other sensor or two compared."""

    by_one: float
    by_two: float


NOT_LOOKED_AT = ComparedShares(0.0, 0.0)


def looked_at(
    cells: Mapping[CountedPair, Cells], of_picture: Mapping[int, float], points: int | None
) -> dict[int, ComparedShares]:
    """What was looked at of each camera of `of_picture`, and of the LiDAR where it has so many `points`.

    `of_picture` is the share of each camera's recorded picture that the grids of its counts cover. A camera is compared
    by each other one that sees the same place; a LiDAR's point by pairs of cameras, or by one camera and its own past.
    """
    voters = {camera: _grids(cells, camera, Check.ADDED_LIGHT) for camera in of_picture}
    shares = {camera: _of_camera(voters[camera], share) for camera, share in of_picture.items()}
    if points is not None:
        pairs, pasts = (_grids(cells, LIDAR, check) for check in (Check.LIDAR_CONFLICT, Check.PARALLAX_CONFLICT))
        shares[LIDAR] = ComparedShares(_of_points([*pairs, *pasts], points), _of_points(pairs, points))
    return shares


def _grids(cells: Mapping[CountedPair, Cells], sensor: int, check: Check) -> list[Image]:
    """What was compared of a sensor by a check, by cell, a grid for each pair."""
    return [counts.valid for counted, counts in cells.items() if (counted.sensor, counted.check) == (sensor, check)]


def _of_camera(grids: list[Image], of_picture: float) -> ComparedShares:
    if not grids:
        return NOT_LOOKED_AT
    voters = np.sum([valid > 0 for valid in grids], axis=0)
    return ComparedShares(*(of_picture * float((voters >= fewest).mean()) for fewest in (1, 2)))


def _of_points(grids: list[Image], points: int) -> float:
    return min(int(np.maximum.reduce(grids).sum()) / max(points, 1), 1.0) if grids else 0.0
