"""Calibrations that are texts of YAML: files beside a recording, and MCAP attachments and metadata within it.

Formats: Kalibr's camchain.yaml (its wiki, "yaml formats"); the camera_info.yaml of ROS's camera_calibration_parsers,
which Autoware's drivers read; Autoware's sensors_calibration.yaml and sensor_kit_calibration.yaml (its documentation,
"Creating individual parameters"), which say by parent and child frame x, y, z (m), roll, pitch and yaw (rad).
"""

from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from typing import NamedTuple

import numpy as np
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from auditor.errors import DecodingError
from auditor.model.optics.geometry import Matrix, invert, motion
from auditor.model.optics.sensors import DOUBLE_SPHERE, OMNIDIRECTIONAL, PINHOLE, POLYNOMIAL
from auditor.recordings.decoding.interface import CameraInfo, Header, Transform
from auditor.recordings.decoding.robot_descriptions import rotation_of

MAX_CALIBRATION_BYTES = 2**20
_MOST_DOCUMENTS = 200
_PLACE = ("x", "y", "z", "roll", "pitch", "yaw")
_MODELS = {"pinhole": ("", 0), "ds": (DOUBLE_SPHERE, 2), "omni": (OMNIDIRECTIONAL, 1)}
"""By Kalibr's name of a camera model the lens that it is, and its own intrinsics before the focal lengths."""

_BODY_R_OPTICAL = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
_CAMERA_LINK, _OPTICAL = "camera_link", "camera_optical_link"
"""Autoware's description of a vehicle places the frame of the pictures at that of the camera, z ahead."""


class CameraCalibration(NamedTuple):
    """A camera's calibration, and the topic of its pictures or, of a camera_info.yaml, the camera's name."""

    camera: str
    info: CameraInfo


class Calibrations(NamedTuple):
    """What a text calibrates; the frames of Kalibr's cameras are called cam0, cam1, ..."""

    cameras: tuple[CameraCalibration, ...] = ()
    transforms: tuple[Transform, ...] = ()


def calibrations_of(text: str) -> Calibrations:
    """What a text says, of one YAML document or several. Raises DecodingError where it is none, or says nothing."""
    if len(text) > MAX_CALIBRATION_BYTES:
        raise DecodingError(f"it has more than {MAX_CALIBRATION_BYTES} characters")
    try:
        # OpenCV's own first line is no directive of YAML.
        documents = list(islice(YAML(typ="safe", pure=True).load_all(text.removeprefix("%YAML:1.0")), _MOST_DOCUMENTS))
    except (YAMLError, RecursionError, ValueError, TypeError, KeyError, AttributeError) as error:
        raise DecodingError(f"it is not YAML ({type(error).__name__})") from error
    calibrations = [_calibrations_in(document) for document in documents if isinstance(document, Mapping)]
    cameras = tuple(camera for one in calibrations for camera in one.cameras)
    transforms = tuple(transform for one in calibrations for transform in one.transforms)
    if not cameras and not transforms:
        raise DecodingError("it describes no cam0, no camera and no place of a sensor")
    return Calibrations(cameras, transforms)


def _calibrations_in(document: Mapping[object, object]) -> Calibrations:
    try:
        if "cam0" in document:
            return _chain(document)
        if "camera_matrix" in document:
            return Calibrations((_camera_info(document),))
    except (KeyError, TypeError, ValueError) as error:
        problem = f"lacks {error}" if isinstance(error, KeyError) else f"is ill-formed ({error})"
        raise DecodingError(f"its calibration {problem}") from error
    return Calibrations(transforms=tuple(_places(document)))


def _chain(chain: Mapping[object, object]) -> Calibrations:
    cameras: list[CameraCalibration] = []
    transforms: list[Transform] = []
    before: Mapping[str, object] = {}
    if not isinstance(chain["cam0"], Mapping):
        raise DecodingError("cam0 is ill-formed")
    while isinstance(described := chain.get(name := f"cam{len(cameras)}"), Mapping):
        try:
            if cameras:
                place = invert(_from_one_before(described, before))
                transforms.append(Transform(f"cam{len(cameras) - 1}", name, place))
            cameras.append(_kalibrs(described, name))
            before = described
        except KeyError as error:
            raise DecodingError(f"{name} lacks {error}") from error
        except (TypeError, ValueError) as error:
            raise DecodingError(f"{name} is ill-formed ({error})") from error
    return Calibrations(tuple(cameras), tuple(transforms))


def _kalibrs(described: Mapping[str, object], name: str) -> CameraCalibration:
    kind = str(described["camera_model"])
    if kind not in _MODELS:
        raise DecodingError(f"{name}: the camera model {kind!r} is not known; use {', '.join(_MODELS)}")
    model, own = _MODELS[kind]
    *before, fu, fv, pu, pv = numbers(described["intrinsics"], own + 4)
    width_px, height_px = (int(size) for size in numbers(described["resolution"], 2))
    if min(fu, fv, width_px, height_px) <= 0:
        raise ValueError("a size or focal length is not positive")
    distortion = str(described["distortion_model"])
    bent = () if distortion == PINHOLE else numbers(described["distortion_coeffs"], 4)
    if (model == DOUBLE_SPHERE and any(bent)) or (model == OMNIDIRECTIONAL and distortion not in {PINHOLE, "radtan"}):
        raise DecodingError(f"{name}: the distortion model {distortion!r} of the camera model {kind!r} is not known")
    if model == OMNIDIRECTIONAL:
        bent = bent or (0.0,) * 4
    D = tuple(before) if model == DOUBLE_SPHERE else (*before, *bent)
    K = np.array([[fu, 0, pu], [0, fv, pv], [0, 0, 1]])
    topic = str(described["rostopic"])
    P = np.hstack([K, np.zeros((3, 1))])
    info = CameraInfo(Header(0, name), width_px, height_px, D, K, np.eye(3), P, model or distortion)
    return CameraCalibration(topic, info)


def _camera_info(described: Mapping[object, object]) -> CameraCalibration:
    K = np.reshape(_data(described, "camera_matrix", 9), (3, 3))
    D = described["distortion_coefficients"]
    coefficients = numbers(D["data"], None) if isinstance(D, Mapping) else ()
    R = np.reshape(_data(described, "rectification_matrix", 9), (3, 3)) if "rectification_matrix" in described else None
    P = np.reshape(_data(described, "projection_matrix", 12), (3, 4)) if "projection_matrix" in described else None
    size = (described["image_width"], described["image_height"])
    width_px, height_px = (int(one) for one in numbers(list(size), 2))
    info = CameraInfo(
        Header(0, ""),
        width_px,
        height_px,
        coefficients,
        K,
        np.eye(3) if R is None else R,
        np.hstack([K, np.zeros((3, 1))]) if P is None else P,
        str(described.get("distortion_model", POLYNOMIAL)),
    )
    return CameraCalibration(str(described["camera_name"]), info)


def _data(described: Mapping[object, object], name: str, count: int) -> tuple[float, ...]:
    matrix = described[name]
    return numbers(matrix["data"] if isinstance(matrix, Mapping) else matrix, count)


def _places(document: Mapping[object, object]) -> Iterator[Transform]:
    for parent, children in document.items():
        for child, place in children.items() if isinstance(children, Mapping) else ():
            if not isinstance(place, Mapping) or not set(_PLACE) <= set(place):
                continue
            try:
                *at, roll, pitch, yaw = numbers([place[name] for name in _PLACE], len(_PLACE))
            except ValueError as error:
                raise DecodingError(f"the place of {str(child)[:40]!r} is ill-formed ({error})") from error
            yield Transform(str(parent), str(child), motion(rotation_of(roll, pitch, yaw), np.array(at)))
            if str(child).endswith(_CAMERA_LINK):
                optical = str(child).removesuffix(_CAMERA_LINK) + _OPTICAL
                yield Transform(str(child), optical, motion(_BODY_R_OPTICAL, np.zeros(3)))


def _from_one_before(described: Mapping[str, object], before: Mapping[str, object]) -> Matrix:
    """The motion from a chain's camera before to this one, (4, 4); files for use with an IMU may say both by that."""
    for name, is_to_camera in (("T_cam_imu", True), ("T_imu_cam", False)):
        if "T_cn_cnm1" not in described and name in described and name in before:
            own, other = _motion(described, name), _motion(before, name)
            return own @ invert(other) if is_to_camera else invert(own) @ other
    return _motion(described, "T_cn_cnm1")


def _motion(described: Mapping[str, object], name: str) -> Matrix:
    rows = described[name]
    if not isinstance(rows, list) or len(rows) != 4:
        raise ValueError(f"{name} must be 4 x 4")
    matrix = np.array([numbers(row, 4) for row in rows])
    if not np.allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), atol=1e-3):
        raise ValueError(f"the rotation of {name} is ill-formed")
    return matrix


def numbers(values: object, count: int | None) -> tuple[float, ...]:
    """A flat list of exactly `count` finite numbers (None: of any count): lists of YAML may contain themselves."""
    if not isinstance(values, Sequence) or isinstance(values, str) or (count is not None and len(values) != count):
        raise ValueError(f"{count} numbers are needed")
    if not all(isinstance(value, int | float) for value in values) or not np.isfinite(values).all():
        raise ValueError("a number is not finite")
    return tuple(float(value) for value in values)
