"""Camera infos as their pictures need them: regions and binnings applied, and those that are no camera's refused.

Camera infos and tf say some things twice. Where the two disagree each is a candidate, and only the recorded images and
points can tell which one is right. Two camera infos are the same calibration where they differ by no more than a tenth
of a pixel, or the noise of numbers that were computed anew: drivers that calibrate all the time never say one twice.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.typing import ArrayLike

from auditor.errors import RigError
from auditor.model.optics.geometry import Matrix
from auditor.model.parameters import PAIR_DEPTH
from auditor.recordings.decoding import CameraInfo
from auditor.recordings.decoding.geometry import ABSURD
from auditor.recordings.decoding.interface import ImageRegion, SizePx
from auditor.recordings.parameters import SAME_CALIBRATION


class Positions(StrEnum):
    """Where the positions of a group of cameras come from.

    P: the fourth columns of P wherever one has an offset, else tf. TF: tf alone. NEGATED: P with the sign of those
    columns changed.
    """

    P = "P"
    TF = "tf"
    NEGATED = "-P"


class Scale(StrEnum):
    """Of which pixels K and P are.

    DECLARED: of the size that the camera info declares; region and binning, or the ratio of the two sizes, lead to the
    pictures. RECORDED: of the pictures as they were recorded, whatever the camera info declares.
    """

    DECLARED = "declared"
    RECORDED = "recorded"


class Axes(StrEnum):
    """How the frames of cameras lie in tf.

    OPTICAL: x right, y down, z ahead, as ROS has it for frames of pictures. BODY: x ahead, y left, z up, as it has it
    for everything else.
    """

    OPTICAL = "optical"
    BODY = "body"


class ZeroLens(StrEnum):
    """What a lens by the angle (`equidistant`) is whose coefficients are all 0.

    NAMED: such a lens, as simulators have it. NONE: no lens, as drivers mean that name it and know no coefficients.
    LEFT_OUT: not known; the camera is left out.
    """

    NAMED = "named"
    NONE = "none"
    LEFT_OUT = "left out"


@dataclass(frozen=True)
class Conventions:
    """How camera infos and tf are read. The first values are those of the standard (sensor_msgs/CameraInfo)."""

    positions: Positions = Positions.P
    scale: Scale = Scale.DECLARED
    axes: Axes = Axes.OPTICAL
    zero_lens: ZeroLens = ZeroLens.NAMED

    def __str__(self) -> str:
        """What differs from the standard, in words; empty where nothing does."""
        positions = {
            Positions.P: "",
            Positions.TF: "the camera positions of tf were taken",
            Positions.NEGATED: "the camera positions of P were negated",
        }
        scales = {Scale.DECLARED: "", Scale.RECORDED: "K and P were taken as those of the recorded pictures"}
        axes = {Axes.OPTICAL: "", Axes.BODY: "x of their frames was taken to look ahead"}
        return " and ".join(filter(None, (positions[self.positions], scales[self.scale], axes[self.axes])))


STANDARD = Conventions()


_WIDEST_PX = 65_535  # of a picture's sides; this and what follows keep numbers of no camera from overflowing
_LARGEST_DISTORTION = 1e6  # of any coefficient of a lens model
_WORST_CONDITION = 1e10  # condition number of K
_TOLERANCE = 1e-2  # by which R R^T and K's last number may differ from 1
_NOISE = 1e-6  # share of the largest number, that rounding makes

_WHOLE = ImageRegion()


def of_pictures(info: CameraInfo, size_px: SizePx, scale: Scale = Scale.DECLARED) -> CameraInfo:
    """The camera info with K and P of the pictures as they were recorded, which have `size_px`.

    K and P are of the whole sensor (sensor_msgs/CameraInfo); they are moved by the region's corner and divided by the
    binning, as ROS's image_geometry does. Pictures that were made smaller or larger without a word about it scale them
    by the ratio of the sizes. Where the camera info has the size of the pictures in spite of region and binning, its
    driver wrote K and P for them already; where RECORDED it did so in any case. Raises RigError where region and
    binning do not fit the pictures.
    """
    picture_of_sensor = _picture_of_sensor(info, size_px)
    if picture_of_sensor is None or scale is Scale.RECORDED:
        return info
    return replace(
        info,
        intrinsics=picture_of_sensor @ info.intrinsics,
        projection=picture_of_sensor @ info.projection,
        width_px=size_px[0],
        height_px=size_px[1],
    )


def contradicts_size(info: CameraInfo, size_px: SizePx) -> bool:
    """Whether a camera info declares another size than its pictures have, so that K and P may be of either.

    Width and height that changed places are told by the pictures, and leave no choice.
    """
    declared = info.width_px, info.height_px
    return all(declared) and size_px not in (declared, declared[::-1])


def scaled_by(info: CameraInfo, size_px: SizePx) -> float | None:
    """By which one ratio pictures are smaller or larger than declared; None where region or binning explain it."""
    if _region_of(info) != _WHOLE or max(info.binning) > 1 or not contradicts_size(info, size_px):
        return None
    across, down = size_px[0] / info.width_px, size_px[1] / info.height_px
    # Half a pixel is lost or won where a size is rounded.
    alike = abs(across * info.height_px - size_px[1]) <= max(1.0, across)
    return (across + down) / 2 if alike else None


def _picture_of_sensor(info: CameraInfo, size_px: SizePx) -> Matrix | None:
    """(3, 3) from the pixels that a camera info declares to those of the pictures; None where both are the same."""
    ratio = scaled_by(info, size_px)
    if ratio is not None:
        return np.diag([size_px[0] / info.width_px, size_px[1] / info.height_px, 1.0])
    across, down = (max(by, 1) for by in info.binning)
    region = _region_of(info)
    if (region == _WHOLE and across == down == 1) or size_px == (info.width_px, info.height_px):
        return None
    width, height = (info.width_px, info.height_px) if region == _WHOLE else (region.width_px, region.height_px)
    if not (_is_binned(size_px[0], width, across) and _is_binned(size_px[1], height, down)):
        raise RigError(
            f"its pictures have {size_px[0]} x {size_px[1]} px, and its camera info speaks of {width} x {height} px of "
            f"{info.width_px} x {info.height_px}, binned by {across} x {down}"
        )
    return np.array([[1 / across, 0, -region.left_px / across], [0, 1 / down, -region.top_px / down], [0, 0, 1]])


def _region_of(info: CameraInfo) -> ImageRegion:
    return info.region if info.region.width_px and info.region.height_px else _WHOLE


def _is_binned(binned_px: int, whole_px: int, by: int) -> bool:
    """Whether so many pixels are left of a row or column; a rest may have been dropped, or kept as one more."""
    return abs(binned_px * by - whole_px) < by


def check_size(size_px: SizePx) -> None:
    """Raises RigError where pictures of a size cannot be compared."""
    if not all(0 < side <= _WIDEST_PX for side in size_px):
        raise RigError(f"its pictures have {size_px[0]} x {size_px[1]} px")


def check_camera(matrices: Iterable[Matrix], rotation: Matrix, distortion: Iterable[float]) -> None:
    """Raises RigError where a (3, 3) matrix is not that of a lens, or a rotation or distortion is absurd.

    Such numbers would overflow, or cannot be inverted, further on.
    """
    for K in matrices:
        if not np.all(np.abs(K) < ABSURD):
            raise RigError("its camera info holds numbers that are absurd or not finite")
        if not (K[0, 0] > 0 and K[1, 1] > 0):
            raise RigError("it is uncalibrated (its camera info has no focal length)")
        if abs(K[2, 2] - 1) > _TOLERANCE or not np.linalg.cond(K) < _WORST_CONDITION:
            raise RigError("the K or P of its camera info is not that of a camera: it cannot be inverted")
    if not np.all(np.abs(rotation @ rotation.T - np.eye(3)) < _TOLERANCE):
        raise RigError("the R of its camera info is not a rotation")
    if not all(abs(one) < _LARGEST_DISTORTION for one in distortion):
        raise RigError("its distortion is absurd or not finite")


def same_numbers(a: ArrayLike, b: ArrayLike, by: float = 0.0) -> bool:
    """True where no number differs by more than `by`, or than the noise, which is relative to the largest of them."""
    numbers, other = np.asarray(a, np.float64), np.asarray(b, np.float64)
    if numbers.shape != other.shape or not numbers.size:
        return numbers.shape == other.shape
    largest = max(float(np.abs(numbers).max()), float(np.abs(other).max()))
    return bool(np.all(np.abs(numbers - other) <= max(_NOISE * largest, by)))


def same_place(a: Matrix, b: Matrix) -> bool:
    """True for two places (4, 4) that no picture tells apart."""
    rotations = same_numbers(a[:3, :3], b[:3, :3], SAME_CALIBRATION.tangent)
    return rotations and same_numbers(a[:3, 3], b[:3, 3], SAME_CALIBRATION.place_m)


def same_projection(a: Matrix, b: Matrix) -> bool:
    """True for two P (3, 4), or two K (3, 3), that no picture tells apart; P's fourth column is seen at a distance."""
    of_place = SAME_CALIBRATION.pixel_px * PAIR_DEPTH.distance_m
    same = same_numbers(a[:, :3], b[:, :3], SAME_CALIBRATION.pixel_px)
    return same and same_numbers(a[:, 3:], b[:, 3:], of_place)


def same_lens(a: Sequence[float], b: Sequence[float]) -> bool:
    """True for the coefficients of two lenses of one model that no picture tells apart."""
    return same_numbers(a, b, SAME_CALIBRATION.tangent)


def same_camera_info(a: CameraInfo, b: CameraInfo) -> bool:
    """True for two messages of one calibration; their stamps do not count."""
    plain = [
        (one.header.frame_id, one.width_px, one.height_px, one.distortion_model, one.region, one.binning)
        for one in (a, b)
    ]
    return (
        plain[0] == plain[1]
        and same_lens(a.distortion, b.distortion)
        and same_projection(a.intrinsics, b.intrinsics)
        and same_projection(a.projection, b.projection)
        and same_numbers(a.rotation, b.rotation, SAME_CALIBRATION.tangent)
    )
