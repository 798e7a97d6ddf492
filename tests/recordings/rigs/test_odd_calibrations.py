"""A camera whose calibration is odd is left out with the reason, and the others are audited."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from auditor.errors import DecodingError
from auditor.model.optics.geometry import motion
from auditor.recordings import check_rig, search_rigs
from auditor.recordings.decoding import CameraInfo, Transform
from auditor.recordings.decoding.geometry import checked_transforms, transform_of
from auditor.recordings.decoding.interface import ImageRegion
from auditor.recordings.synchronisation.survey import Survey
from tests.benchmarks.fuzzing_rigs import run as fuzz
from tests.recordings.rigs.test_discovery import P, at, info, look

BENT = (-0.05, 0.01, 0.0, 0.0)
LARGE = motion(np.eye(3), np.array([1e6, 0, 0]))
NAN = float("nan")


def vehicle(odd: Callable[[CameraInfo], CameraInfo], place: float | np.ndarray = 0.2, *, bent: bool) -> Survey:
    """Three sound cameras and the camera `odd`, on one line; unrectified where `bent`."""
    names = {"a": 0.0, "b": 0.4, "c": 0.7, "odd": place}
    infos = {name: info(name, P(0), distortion=BENT if bent else ()) for name in names}
    infos["odd"] = odd(infos["odd"])
    places = {name: at(x) if isinstance(x, float) else x for name, x in names.items()}
    return look(infos, {**places, "top": at(0)}, images="image_raw" if bent else "image_rect")


def with_(**fields: object) -> Callable[[CameraInfo], CameraInfo]:
    return lambda one: replace(one, **fields)


def changed(name: str, place: tuple[int, int], value: float) -> Callable[[CameraInfo], CameraInfo]:
    def change(one: CameraInfo) -> CameraInfo:
        matrix = np.array(getattr(one, name))
        matrix[place] = value
        return replace(one, **{name: matrix})

    return change


def both(place: tuple[int, int], value: float) -> Callable[[CameraInfo], CameraInfo]:
    return lambda one: changed("projection", place, value)(changed("intrinsics", place, value)(one))


SINGULAR = np.array([[700.0, 0, 0], [700, 0, 0], [0, 0, 1]])

ODD = {
    "singular": (with_(intrinsics=SINGULAR, projection=np.hstack([SINGULAR, np.zeros((3, 1))])), "uncalibrated"),
    "singular K beside a focal length": (both((2, 2), 0.0), "cannot be inverted"),
    "NaN": (both((0, 0), NAN), "absurd or not finite"),
    "inf": (both((1, 2), float("inf")), "absurd or not finite"),
    "1e300": (both((0, 0), 1e300), "absurd or not finite"),
    "negative focal length": (both((0, 0), -700.0), "uncalibrated"),
    "next to no focal length": (both((0, 0), 1e-12), "cannot be inverted"),
    "scaled": (both((2, 2), 700.0), "cannot be inverted"),
}


@pytest.mark.parametrize("bent", [True, False])
@pytest.mark.parametrize(("odd", "reason"), ODD.values(), ids=ODD)
@pytest.mark.filterwarnings("error")
def test_an_odd_camera_is_left_out_with_its_reason(
    odd: Callable[[CameraInfo], CameraInfo],
    reason: str,
    bent: bool,
) -> None:
    assert_left_out(vehicle(odd, bent=bent), reason)


@pytest.mark.parametrize(
    ("odd", "reason"),
    [
        (with_(rotation=np.full((3, 3), 0.5)), "not a rotation"),
        (with_(rotation=np.diag([1.0, 1, 0])), "not a rotation"),
        (with_(distortion=(NAN, 0.0, 0.0, 0.0)), "do not fit the model"),
        (with_(distortion=(1e300, 0.0, 0.0, 0.0)), "distortion is absurd"),
        (with_(distortion=(0.1, 0.0, 1e9, 0.0)), "distortion is absurd"),
        (with_(distortion=(0.1,) * 100), "100 coefficients do not fit"),
        (with_(distortion_model="of_my_own"), "'of_my_own' is not known"),
        (with_(binning=(3, 3)), "binned by 3 x 3"),
        (with_(width_px=1280, region=ImageRegion(10, 10, 99, 99)), "99 x 99 px of 1280 x 480"),
    ],
)
@pytest.mark.filterwarnings("error")
def test_an_odd_lens_is_left_out_with_its_reason(odd: Callable[[CameraInfo], CameraInfo], reason: str) -> None:
    surveyed = vehicle(odd, bent=True)
    # Where the camera info has the size of the pictures, its region and binning are applied already.
    pictures = tuple(
        replace(image, size_px=(200, 100)) if "odd" in image.topic.name and "x" in reason else image
        for image in surveyed.images
    )
    assert_left_out(replace(surveyed, images=pictures), reason)


@pytest.mark.parametrize("size_px", [(0, 480), (2**31, 2**31), (640, 65_536), (0, 0)])
@pytest.mark.filterwarnings("error")
def test_pictures_of_absurd_sizes_are_left_out_with_their_reason(size_px: tuple[int, int]) -> None:
    surveyed = vehicle(with_(), bent=False)
    pictures = tuple(
        replace(image, size_px=size_px) if "odd" in image.topic.name else image for image in surveyed.images
    )
    assert_left_out(replace(surveyed, images=pictures), f"its pictures have {size_px[0]} x {size_px[1]} px")


@pytest.mark.parametrize("bent", [True, False])
@pytest.mark.parametrize(
    ("place", "reason"), [(0.4, "lies where b lies"), (LARGE, "lies 1000000 m from"), (-LARGE, "lies")]
)
@pytest.mark.filterwarnings("error")
def test_a_camera_at_the_place_of_another_or_on_no_vehicle_is_left_out(
    place: float | np.ndarray,
    reason: str,
    bent: bool,
) -> None:
    if isinstance(place, np.ndarray):
        place = motion(np.eye(3), place[:3, 3])
    surveyed = vehicle(with_(), place, bent=bent)
    found = search_rigs(surveyed)
    assert found.rigs[0].n == 3
    assert any(reason in one for one in found.reasons), found.reasons


def assert_left_out(surveyed: Survey, reason: str) -> None:
    found = search_rigs(surveyed)
    assert {camera.name for camera in found.rigs[0].cameras} == {"a", "b", "c"}
    check_rig(found.rigs[0], surveyed)
    assert [one for one in found.reasons if reason in one and "odd" in one], found.reasons


def test_one_odd_transform_leaves_the_others_of_its_message() -> None:
    good = transform_of("/base", "cam", (0, 0, 0, 1), (1, 2, 3))
    odd = [
        transform_of("base", "none", (0, 0, 0, 0), (0, 0, 0)),
        transform_of("base", "nan", (0, 0, 0, 1), (NAN, 0, 0)),
        transform_of("base", "large", (0, 0, 0, 1e300), (0, 0, 0)),
    ]
    assert good.parent == "base"
    assert not good.problem
    assert [bool(one.problem) for one in odd] == [True] * 3
    assert checked_transforms([*odd, good], "/tf") == (*odd, good)
    with pytest.raises(DecodingError, match="base to none: a quaternion of length zero is no rotation"):
        checked_transforms(odd, "/tf")


def test_a_transform_that_is_no_motion_is_named_and_not_used() -> None:
    assert isinstance(transform_of("a", "b", (0, 0, 0, 0), (0, 0, 0)), Transform)


@pytest.mark.filterwarnings("error")
def test_whole_vehicles_of_odd_numbers_raise_nothing_of_others(capfd: pytest.CaptureFixture[str]) -> None:
    assert fuzz(first=0, count=100, limit_s=60), capfd.readouterr().out
