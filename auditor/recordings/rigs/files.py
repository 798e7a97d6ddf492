"""Files that describe a rig: rig.toml, exact and to be corrected by hand, and Kalibr's camchain.yaml.

Format of the latter: Kalibr's wiki, "yaml formats": cam0, cam1, ... with camera_model, intrinsics (fu fv pu pv),
distortion_model, distortion_coeffs, resolution, rostopic and, from cam1 on, T_cn_cnm1 (4 x 4, points of the camera
before into this one).
"""

import json
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from auditor.errors import RigError
from auditor.model.optics.geometry import Matrix
from auditor.model.optics.lenses import DOUBLE_SPHERE, NO_LENS, OMNIDIRECTIONAL, PINHOLE, POLYNOMIAL, Lens, of_camera
from auditor.model.rig import Camera, Lidar, Rig
from auditor.recordings.rigs.cameras import sensor_name

_HEAD = """\
# The sensors of a vehicle: S_0 is the LiDAR, S_1..S_n are the cameras from right to left.
# projection: 3 x 4, P = K [R | t], points of the rig frame in metres to pixels, lens distortion apart.
# rectified: whether the images are so, all cameras looking along the rig's z axis without distortion; if not,
# distortion_model (plumb_bob, rational_polynomial, equidistant, double_sphere, omnidirectional, f_theta) and distortion
# (its coefficients) describe the lens; K is that of a pinhole that shows the middle of the picture alike.
# rig_SE3_lidar: 4 x 4, points of the LiDAR frame to the rig frame, in metres.
# offset_ns, of any sensor: how far its stamps lie behind the leftmost camera's; without it the recording gives it.
# lidar.sweep, where each cloud is a part of one: angles around the LiDAR's z axis, where sweeps begin, from part to
# part, and of the part that has the sweep's time; whether it turns from x to y (1) or back (-1); parts a sweep.
# depth_bits, of a camera that writes more than 8 bits a value: how many; without it its first pictures show it.
"""

_REMEDY = "`auditor inspect RECORDING --write-rig` writes one to compare it with"
_MAX_BYTES = 2**20
_CAMCHAIN_REMEDY = "compare it with one that Kalibr wrote"
_CAMERA_MODELS = {"pinhole": ("", 0), "ds": (DOUBLE_SPHERE, 2), "omni": (OMNIDIRECTIONAL, 1)}
"""By Kalibr's name of a camera model the lens that it is, and its own intrinsics before the focal lengths."""


def read_rig(path: Path) -> Rig:
    """Read a rig file. Raises RigError where it is missing, or does not describe a rig."""
    try:
        description = tomllib.loads(path.read_text("utf-8"))
    except OSError as error:
        what = f"the rig file cannot be read ({error.strerror})"
        raise RigError(what, where=path, remedy=f"check the path; {_REMEDY}") from error
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise RigError(f"the rig file is not TOML ({error})", where=path, remedy=_REMEDY) from error
    try:
        return Rig.from_dict(description)
    except RigError as error:
        raise RigError(error.what, where=path, remedy=error.remedy or _REMEDY) from error


def write_rig(rig: Rig, path: Path) -> None:
    """Write a rig file that `read_rig` reads back, number by number. Raises RigError where it cannot be written."""
    beside = path.with_name(f".{path.name}.part")
    try:
        beside.write_text("\n".join(_lines(rig)) + "\n", "utf-8")
        beside.replace(path)
    except OSError as error:
        beside.unlink(missing_ok=True)
        raise RigError(f"the rig file cannot be written ({error.strerror})", where=path) from error


def _lines(rig: Rig) -> Iterator[str]:
    yield _HEAD
    if rig.lidar:
        yield "[lidar]"
        yield f"name = {_text(rig.lidar.name)}"
        yield f"topic = {_text(rig.lidar.topic)}"
        yield from _offset(rig.lidar)
        yield f"rig_SE3_lidar = {_matrix(rig.lidar.rig_SE3_lidar)}"
        if sweep := rig.lidar.sweep:
            yield "[lidar.sweep]"
            yield f"seam_step_time_rad = [{sweep.seam_rad!r}, {sweep.step_rad!r}, {sweep.time_rad!r}]"
            yield f"direction = {sweep.direction}"
            yield f"parts = {sweep.parts}"
    for camera in rig.cameras:
        yield f"\n[[cameras]]  # S_{camera.number}, x = {camera.centre_m[0]:+.4f} m"
        yield f"number = {camera.number}"
        yield f"name = {_text(camera.name)}"
        yield f"topic = {_text(camera.topic)}"
        yield f"width_px = {camera.width_px}"
        yield f"height_px = {camera.height_px}"
        yield f"rectified = {str(camera.rectified).lower()}"
        if camera.lens != NO_LENS:
            yield f"distortion_model = {_text(camera.lens.model)}"
            yield f"distortion = [{', '.join(repr(value) for value in camera.lens.coefficients)}]"
        yield from _offset(camera)
        if camera.depth_bits is not None:
            yield f"depth_bits = {camera.depth_bits}"
        yield f"projection = {_matrix(camera.projection)}"


def _offset(sensor: Camera | Lidar) -> Iterator[str]:
    if sensor.offset_ns is not None:
        yield f"offset_ns = {sensor.offset_ns}"


def _text(text: str) -> str:
    # TOML's strings are JSON's, but for the one control character that JSON leaves as it is.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _matrix(matrix: Matrix) -> str:
    rows = ("    [" + ", ".join(repr(float(value)) for value in row) + "]," for row in matrix)
    return "[\n" + "\n".join(rows) + "\n]"


def read_camchain(path: Path) -> list[Camera]:
    """The cameras of a camchain.yaml in the frame of cam0, not numbered. Raises RigError where it is not a camchain."""
    try:
        if path.stat().st_size > _MAX_BYTES:
            raise RigError(f"it has more than {_MAX_BYTES} bytes", where=path, remedy=_CAMCHAIN_REMEDY)
        chain = YAML(typ="safe", pure=True).load(path.read_text("utf-8"))
    except OSError as error:
        raise RigError(f"the camera chain cannot be read ({error.strerror})", where=path) from error
    except (YAMLError, UnicodeDecodeError, RecursionError) as error:
        raise RigError(f"it is not YAML ({type(error).__name__})", where=path, remedy=_CAMCHAIN_REMEDY) from error
    if not isinstance(chain, Mapping) or "cam0" not in chain:
        raise RigError("it describes no cam0", where=path, remedy=_CAMCHAIN_REMEDY)
    cameras: list[Camera] = []
    cam_SE3_cam0 = np.eye(4)
    while (name := f"cam{len(cameras)}") in chain:
        try:
            if cameras:
                cam_SE3_cam0 = _motion(chain[name]["T_cn_cnm1"]) @ cam_SE3_cam0
            cameras.append(_camera(chain[name], cam_SE3_cam0))
        except (KeyError, TypeError, ValueError) as error:
            what = f"lacks {error}" if isinstance(error, KeyError) else f"is ill-formed ({error})"
            raise RigError(f"{name} {what}", where=path, remedy=_CAMCHAIN_REMEDY) from error
        except RigError as error:
            raise RigError(f"{name}: {error.what}", where=path, remedy=error.remedy) from error
    return cameras


def _camera(described: Mapping[str, object], cam_SE3_cam0: Matrix) -> Camera:
    camera_model = str(described["camera_model"])
    if camera_model not in _CAMERA_MODELS:
        raise RigError(f"the camera model {camera_model!r} is not known", remedy=f"use {', '.join(_CAMERA_MODELS)}")
    model, own = _CAMERA_MODELS[camera_model]
    *before, fu, fv, pu, pv = _numbers(described["intrinsics"], own + 4)
    width_px, height_px = (int(size) for size in _numbers(described["resolution"], 2))
    if min(fu, fv, width_px, height_px) <= 0:
        raise ValueError("a size or focal length is not positive")
    distortion = str(described["distortion_model"])
    coefficients = () if distortion == PINHOLE else _numbers(described["distortion_coeffs"], 4)
    if model == DOUBLE_SPHERE and any(coefficients):
        raise RigError(f"the distortion model {distortion!r} of a double sphere is not known")
    if model == OMNIDIRECTIONAL and Lens(distortion, coefficients).model not in {PINHOLE, POLYNOMIAL}:
        raise RigError(f"the distortion model {distortion!r} of an omnidirectional camera is not known")
    topic = str(described["rostopic"])
    given = tuple(before) if model == DOUBLE_SPHERE else (*before, *(coefficients or (0.0,) * (4 if before else 0)))
    lens, K = of_camera(model or distortion, given, np.array([[fu, 0, pu], [0, fv, pv], [0, 0, 1.0]]))
    return Camera(0, sensor_name(topic), topic, width_px, height_px, K @ cam_SE3_cam0[:3], rectified=False, lens=lens)


def _motion(rows: object) -> Matrix:
    if not isinstance(rows, list) or len(rows) != 4:
        raise ValueError("T_cn_cnm1 must be 4 x 4")
    matrix = np.array([_numbers(row, 4) for row in rows])
    if not np.allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), atol=1e-3):
        raise ValueError("the rotation of T_cn_cnm1 is ill-formed")
    return matrix


def _numbers(values: object, count: int) -> tuple[float, ...]:
    """A flat list of exactly `count` finite numbers: lists of YAML may contain themselves."""
    if not isinstance(values, list) or len(values) != count or not all(isinstance(v, int | float) for v in values):
        raise ValueError(f"{count} numbers are needed")
    if not np.isfinite(values).all():
        raise ValueError("a number is not finite")
    return tuple(float(value) for value in values)
