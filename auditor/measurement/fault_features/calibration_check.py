"""Whether a rig fits the images and points that were recorded with it.

A wrong calibration makes every frame look attacked: images that are not rectified though the rig has them so, another
vehicle's rig, a baseline counted twice, a LiDAR that was moved. Unlike an attack it affects the whole view of every
frame, so a few frames are enough, and users are warned before they read verdicts.
"""

from array import array
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from itertools import chain, islice
from math import isnan, nan

import numpy as np

from auditor.measurement.checks.point_distribution import is_rounded
from auditor.measurement.disparity.lidar import LidarView
from auditor.measurement.fault_features.geometry_fit import (
    FrameFit,
    better_quarter,
    fit_of_sides,
    geometry_fit,
    views_of_sides,
)
from auditor.measurement.pairwise_views import OF_TWO
from auditor.measurement.parameters import COUNT_GRID, HALF, PATCH_CORRELATION
from auditor.measurement.point_parameters import FALSE_RANGES, LOST_RETURNS
from auditor.measurement.shared_view import FrameArrays
from auditor.measurement.warning_parameters import CALIBRATION_CHECK, GEOMETRY_FIT
from auditor.model.checks import Pair
from auditor.model.fault_features import PairFaultFeatures, relative_excess
from auditor.model.rig import LIDAR, Rig

_REPAIR = (
    "wrong unit, axes or mounting of its points, or another vehicle's cameras; put it right, or give a rig file (--rig)"
)
_TURNED = (
    "a wrong rectification flag, a camera that turned, or another vehicle's rig; put it right, or give a rig file "
    "(--rig)"
)

_FAR_APART = (
    "lie so far apart, as where only some were recorded, that lost returns and rough ranges are not measured: what is "
    "removed from the cloud may pass unseen"
)
_ROUNDED = (
    "are rounded so coarsely that rough ranges and isolated points are not measured: ranges that jitter, and points at "
    "random ranges, may pass unseen"
)
_CROPPED = "do not reach as near, or as far, as lost returns are looked for: what is removed there passes unseen"
_EVERY = 5  # frames, of which one is used: it bounds the work
_MOST_FRAMES = 200  # frames that are used: it bounds the work
_SUCCESSIVE = 20  # first frames, each of which is held against the cloud before: it bounds the work


class CalibrationMonitor:
    """Collects some frames of one recording, and warns of what does not fit even in the better ones.

    In every tried clean frame of KITTI's drives at least 63 % of the points followed lie on the same row, and at least
    60 % of LiDAR points agree with stereo within 1 px. Half a degree of roll leaves at most 24 % on the same row, an
    image that is not rectified 35 %, a LiDAR half a degree too low 40 % agreeing.
    """

    def __init__(self) -> None:
        self._frames = 0
        self._rig: Rig | None = None
        self._features: dict[Pair, list[PairFaultFeatures]] = {}
        self._scales: dict[Pair, list[float]] = {}
        self._fits: list[FrameFit] = []
        self._thinned: list[bool] = []
        self._rounded: list[bool] = []
        self._cropped: list[bool] = []
        self._ground: list[float] = []
        self._before: Mapping[Pair, LidarView] = {}
        self._fits_before: list[float] = []
        self._lags: dict[int, array[float]] = {}

    def offer(self, arrays: FrameArrays, fault_features: Mapping[Pair, PairFaultFeatures]) -> None:
        """Consider the next measured frame; most are skipped."""
        number, self._frames = self._frames, self._frames + 1
        for sensor, by in lags(fault_features).items():
            self._lags.setdefault(sensor, array("d")).append(by)  # of every frame: eight bytes each
        if number < _SUCCESSIVE:
            before, self._before = self._before, views_of_sides(arrays)
            self._fits_before.append(fit_of_sides(arrays, before) - fit_of_sides(arrays, self._before))
        if number % _EVERY == 0 and number // _EVERY < _MOST_FRAMES:
            self.add(arrays, fault_features)

    def add(self, arrays: FrameArrays, fault_features: Mapping[Pair, PairFaultFeatures]) -> None:
        """Take this frame."""
        self._rig = arrays.rig
        self._fits.append(geometry_fit(arrays))
        owns = (arrays, *(one.own for one in arrays.pairs.values()))
        for those, k in islice(((own, k) for own in owns for k in own.lidar), 1):
            view = those.lidar[k]
            self._thinned.append(those.frame_checks.thinned[k])
            self._rounded.append(is_rounded(view))
            self._cropped.append(_is_cropped(view))
            self._ground.append(_ground(view))
        for pair, seen in fault_features.items():
            self._features.setdefault(pair, []).append(seen)
            scale = _scale(arrays, pair)
            if scale is not None:
                self._scales.setdefault(pair, []).append(scale)

    def warnings(self) -> tuple[str, ...]:
        """One sentence each about what does not fit; none where rig and recording agree."""
        if self._rig is None:
            return ()
        off = [f"{misfit}: {why}" for misfit, why in self._rows_off(self._rig)]
        # Where rows do not fit, stereo's distances cannot check the LiDAR's.
        return tuple(off or self._lidar_warnings(self._rig))

    def _rows_off(self, rig: Rig) -> Iterator[tuple[str, str]]:
        """The pairs with the leftmost camera whose rows do not fit, in words, and the likely reasons."""
        for pair, seen in sorted(self._features.items()):
            if pair[1] == rig.n and (misfit := _row_misfit(pair, seen, rig)) is not None:
                yield misfit

    def remarks(self) -> tuple[str, ...]:
        """Which checks say nothing of how most clouds were recorded; lone cameras have none of them.

        That casts no doubt on the rig.
        """
        rig = self._rig
        if rig is None or rig.lidar is None or rig.n < 2:
            return ()
        of_clouds = ((self._thinned, _FAR_APART), (self._rounded, _ROUNDED), (self._cropped, _CROPPED))
        said = (what for frames, what in of_clouds if 2 * sum(frames) > len(frames))
        return tuple(f"the points of the LiDAR {rig.lidar.name} {what}" for what in said)

    @property
    def pictures(self) -> float:
        """How well the images of pairs fit each other in the better frames, a share; NaN where it is not known."""
        return better_quarter([fit.pictures for fit in self._fits])

    @property
    def of_cameras(self) -> Mapping[int, float]:
        """How well the images of each camera fit another's in the better frames, a share; NaN where it is not known."""
        cameras = {camera for fit in self._fits for camera in fit.of_cameras}
        return {one: better_quarter([fit.of_cameras.get(one, nan) for fit in self._fits]) for one in sorted(cameras)}

    def withheld(self) -> str:
        """Why no verdict may be given: a sensor is late, or in most frames the points fit the images nowhere; or empty.

        No attack does the latter: it leaves regions, pairs or frames in which points and images fit.
        """
        if self._rig is None:
            return ""
        unfit = self._unfit(self._rig, self._rig.lidar.name) if self._rig.lidar else ()
        return next(chain(self._late(self._rig), unfit), "")

    def _late(self, rig: Rig) -> Iterator[str]:
        """A sensor whose data, in most frames, fit those that others have of the frame before, and not their own."""
        for sensor in sorted(self._lags, reverse=True):  # where the reference is late the LiDAR seems to be
            if _mostly_before(self._lags[sensor]):
                yield (
                    f"{'the points' if sensor == LIDAR else 'the images'} of {rig.name(sensor)} fit what the other "
                    "sensors have of the frame before their own: its stamps are a period late, or its old data are "
                    "replayed; where they are late, put them right, or give its offset in a rig file (--rig)"
                )

    def _unfit(self, rig: Rig, lidar: str) -> Iterator[str]:
        in_view = [fit.in_view for fit in self._fits if fit.in_view >= 0]
        if not in_view:
            return
        if max(in_view) < GEOMETRY_FIT.fewest_in_view:
            yield f"no camera sees points of the LiDAR {lidar} in any frame: {_REPAIR}"
        if _mostly_before(self._fits_before):
            yield (
                f"the points of the LiDAR {lidar} fit the images of the frame behind their own, and not those: its "
                "stamps are a period early; put them right, or give its offset in a rig file (--rig)"
            )
        if rig.n > 1 and better_quarter(self._ground) < CALIBRATION_CHECK.least_ground:
            yield (
                f"the points of the LiDAR {lidar} hold no ground, which was taken out before they were recorded: what "
                "an attack removes cannot be told from it; record the sensor's own points"
            )
        points = better_quarter([fit.points for fit in self._fits])
        name, other = self._best_axes()
        if other >= GEOMETRY_FIT.fits and not other - points < GEOMETRY_FIT.better_by:
            yield f"the points of the LiDAR {lidar} fit the images with {name}, and not as they are: {_REPAIR}"
        if points < GEOMETRY_FIT.at_chance:
            off = next((f"{misfit}, and " for misfit, _ in self._rows_off(rig)), "")
            why = _TURNED if off else _REPAIR
            yield f"{off}the points of the LiDAR {lidar} fit the images nowhere, {points:.0%} by chance: {why}"

    def _best_axes(self) -> tuple[str, float]:
        """The other axes of points that fit best, and how well, in the better frames."""
        names = sorted({name for fit in self._fits for name in fit.other_axes})
        fits = {name: better_quarter([fit.other_axes.get(name, 0.0) for fit in self._fits]) for name in names}
        return max(fits.items(), key=lambda one: np.nan_to_num(one[1]), default=("", 0.0))

    def _lidar_warnings(self, rig: Rig) -> Iterator[str]:
        pairs = [pair for pair in self._features if pair[1] == rig.n]
        agreeing = {pair: better_quarter([s.agreement.agreeing for s in self._features[pair]]) for pair in pairs}
        measured = [pair for pair in pairs if not isnan(agreeing[pair])]
        if not measured or rig.lidar is None:
            return
        best = max(measured, key=lambda pair: agreeing[pair])
        sentence = self._lidar_warning(best, agreeing[best], measured)
        if sentence is not None:
            yield f"the LiDAR {rig.lidar.name} and stereo {sentence}"
            return
        for pair in measured:
            if agreeing[pair] < CALIBRATION_CHECK.least_agreeing:
                yield (
                    f"the LiDAR {rig.lidar.name} and stereo agree at {agreeing[best]:.0%} of points within 1 px by "
                    f"{rig.name(best[0])}, but at {agreeing[pair]:.0%} by {rig.name(pair[0])}: is that camera rotated?"
                )

    def _lidar_warning(self, best: Pair, agreeing: float, measured: list[Pair]) -> str | None:
        agreements = [s.agreement for s in self._features[best]]
        excesses = [
            _median(
                [relative_excess(s.agreement.rotated_only, s.agreement.unrotated_only) for s in self._features[pair]]
            )
            for pair in measured
        ]
        rotated = _median([one.rotated for one in agreements])
        moved = min(excesses) >= CALIBRATION_CHECK.least_excess and rotated >= CALIBRATION_CHECK.least_agreeing
        if agreeing >= CALIBRATION_CHECK.least_agreeing and not moved:
            return None
        shares = f"agree at {agreeing:.0%} of points within 1 px"
        if moved:
            ways = Counter((one.right_px, one.down_px) for one in agreements if not isnan(one.rotated))
            way = _way(*ways.most_common(1)[0][0])
            return f"{shares}, and better once its points are {way}: wrong LiDAR mounting?"
        scale = _median(self._scales.get(best, []))
        if abs(scale - 1) > CALIBRATION_CHECK.wrong_scale:
            shares += f", its disparities being {scale:.2f} times the LiDAR's"
        return f"{shares}: wrong baseline, focal length, rectification flag or LiDAR mounting?"


def _mostly_before(better: Iterable[float]) -> bool:
    """Whether data fit another frame so much better in most of the frames in which both fits are known."""
    measured = [by for by in better if not isnan(by)]
    return len(measured) >= CALIBRATION_CHECK.fewest_successive and _median(measured) >= CALIBRATION_CHECK.better_before


def lags(fault_features: Mapping[Pair, PairFaultFeatures]) -> dict[int, float]:
    """By how much each sensor's data fit the frame before better than their own: the least share of all its pairs.

    NaN where it was not measured.
    """
    gains_of: dict[int, list[float]] = {}
    for (i, k), seen in fault_features.items():
        agreement, rows = seen.agreement, seen.rows
        gains_of.setdefault(LIDAR, []).append(relative_excess(agreement.before_only, agreement.now_only))
        for camera, lagged in ((i, rows.lagged_i), (k, rows.lagged_k)):
            gains_of.setdefault(camera, []).append(lagged - max(rows.row_aligned, rows.offset_share))
    return {sensor: min((by for by in gains if not isnan(by)), default=nan) for sensor, gains in gains_of.items()}


def _row_misfit(pair: Pair, seen: list[PairFaultFeatures], rig: Rig) -> tuple[str, str] | None:
    aligned = [one.rows for one in seen]
    row_aligned, offset_px = better_quarter(a.row_aligned for a in aligned), _median([a.offset_px for a in aligned])
    if isnan(row_aligned) or row_aligned >= CALIBRATION_CHECK.least_aligned:
        return None
    names = f"the images of {rig.name(pair[0])} and {rig.name(pair[1])}"
    if abs(offset_px) >= CALIBRATION_CHECK.clear_offset_px:
        rows = f"{names} are off by {abs(offset_px):.1f} rows"
        return rows, "wrong rectification flag, a camera that turned, or another vehicle's rig?"
    return f"{names} show {row_aligned:.0%} of points on the same row", "wrong rectification flag, lens or rotation?"


def _scale(arrays: FrameArrays, pair: Pair) -> float | None:
    """Stereo's disparities over the LiDAR's, the median; None where too few points are comparable."""
    if pair in arrays.pairs:
        arrays, pair = arrays.pairs[pair].own, OF_TWO
    i, k = pair
    if k not in arrays.lidar:
        return None
    view, stereo = arrays.lidar[k], arrays.maps[pair]
    sure = arrays.frame_checks.consistencies[pair]
    row, column = view.row // stereo.step, view.column // stereo.step
    usable = (sure.ncc * sure.comparable)[view.row // HALF, view.column // HALF] > PATCH_CORRELATION.consistent
    d0, ds = view.disparity_px(i), stereo.disparity_px[row, column]
    usable &= (d0 > CALIBRATION_CHECK.smallest_px) & (ds > 0)
    return (
        float(np.median(ds[usable] / d0[usable]))
        if np.count_nonzero(usable) >= CALIBRATION_CHECK.fewest_points
        else None
    )


def _ground(view: LidarView) -> float:
    """The share of the directions with returns that have one steeply below, as the ground's are.

    NaN where nothing returns from twice as steeply: the LiDAR may not look down so far. An attack that takes a sector
    leaves no direction with returns there.
    """
    x, y, z = view.in_rig_axes_m
    direction, slope = np.floor(np.arctan2(x, z) / COUNT_GRID.lidar_cell), y / np.hypot(x, z)
    if not (slope > 2 * LOST_RETURNS.steeply).any():
        return nan
    return np.unique(direction[slope > LOST_RETURNS.steeply]).size / np.unique(direction).size


def _is_cropped(view: LidarView) -> bool:
    """Whether the cloud begins farther away than false ranges are looked for, or ends nearer than lost returns are."""
    nearest_m, farthest_m = view.reach_m
    return nearest_m > FALSE_RANGES.nearest_m or farthest_m < LOST_RETURNS.farthest_m


def _median(values: list[float]) -> float:
    """The median of the measured values; NaN where there is none."""
    measured = [value for value in values if not isnan(value)]
    return float(np.median(measured)) if measured else float("nan")


def _way(right_px: float, down_px: float) -> str:
    shifts = (right_px, ("right", "left")), (down_px, ("lower", "higher"))
    return " and ".join(f"{abs(shift):.0f} px {words[shift < 0]}" for shift, words in shifts if shift)
