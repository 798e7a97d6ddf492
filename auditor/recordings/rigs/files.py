"""Files that describe a rig: rig.toml, exact and to be corrected by hand, and calibrations in YAML."""

import json
import tomllib
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from auditor.errors import DecodingError, RigError
from auditor.model.optics.geometry import Matrix, invert
from auditor.model.optics.sensors import NO_LENS, of_camera
from auditor.model.rig import Camera, Lidar, Rig
from auditor.recordings.decoding.calibration_texts import MAX_CALIBRATION_BYTES, Calibrations, calibrations_of
from auditor.recordings.rigs.cameras import sensor_name

_HEAD = """\
# The sensors of a vehicle: S_0 is the LiDAR, S_1..S_n are the cameras from right to left.
# projection: 3 x 4, P = K [R | t], points of the rig frame in metres to pixels, lens distortion apart.
# rectified: whether the images are so, all cameras looking along the rig's z axis without distortion; if not,
# distortion_model (plumb_bob, rational_polynomial, equidistant, double_sphere, omnidirectional, f_theta) and distortion
# (its coefficients) describe the lens; K is that of a pinhole that shows the middle of the picture alike.
# rig_SE3_lidar: 4 x 4, points of the LiDAR frame to the rig frame, in metres.
# offset_ns, of any sensor: how far its stamps lie behind the leftmost camera's; without it the recording gives it.
# others: further LiDARs S_1.. that overlap S_0, of a vehicle without cameras, in the same rig frame.
# lidar.sweep, where each cloud is a part of one: angles around the LiDAR's z axis, where sweeps begin, from part to
# part, and of the part that has the sweep's time; whether it turns from x to y (1) or back (-1); parts a sweep.
# unit_m, of a LiDAR whose points are in no metres (centimetres: 0.01): how many metres the unit of its x, y and z is.
# depth_bits, of a camera that writes more than 8 bits a value: how many; without it its first pictures show it.
"""

_REMEDY = "`auditor inspect RECORDING --write-rig` writes one to compare it with"
_YAML_REMEDY = "give a rig.toml, Kalibr's camchain.yaml, a camera_info.yaml or Autoware's sensors_calibration.yaml"


def read_rig(path: Path) -> Rig:
    """Read a rig file. Raises RigError where it is missing, or does not describe a rig."""
    try:
        description = tomllib.loads(path.read_text("utf-8"))
    except OSError as error:
        problem = f"the rig file cannot be read ({error.strerror})"
        raise RigError(problem, where=path, remedy=f"check the path; {_REMEDY}") from error
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
        yield from _of_lidar(rig.lidar, "lidar")
    for number, lidar in enumerate(rig.others, start=1):
        yield f"\n[[others]]  # S_{number}"
        yield from _of_lidar(lidar, "others")
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


def _of_lidar(lidar: Lidar, table: str) -> Iterator[str]:
    yield f"name = {_text(lidar.name)}"
    yield f"topic = {_text(lidar.topic)}"
    yield from _offset(lidar)
    if lidar.unit_m is not None:
        yield f"unit_m = {lidar.unit_m!r}"
    yield f"rig_SE3_lidar = {_matrix(lidar.rig_SE3_lidar)}"
    if sweep := lidar.sweep:
        yield f"[{table}.sweep]"
        yield f"seam_step_time_rad = [{sweep.seam_rad!r}, {sweep.step_rad!r}, {sweep.time_rad!r}]"
        yield f"direction = {sweep.direction}"
        yield f"parts = {sweep.parts}"


def _offset(sensor: Camera | Lidar) -> Iterator[str]:
    if sensor.offset_ns is not None:
        yield f"offset_ns = {sensor.offset_ns}"


def _text(text: str) -> str:
    # TOML's strings are JSON's, but for the one control character that JSON leaves as it is.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _matrix(matrix: Matrix) -> str:
    rows = ("    [" + ", ".join(repr(float(value)) for value in row) + "]," for row in matrix)
    return "[\n" + "\n".join(rows) + "\n]"


def read_calibrations(path: Path) -> Calibrations:
    """The calibrations of a file of YAML. Raises RigError where it has none."""
    try:
        if path.stat().st_size > MAX_CALIBRATION_BYTES:
            raise RigError(f"it has more than {MAX_CALIBRATION_BYTES} bytes", where=path, remedy=_YAML_REMEDY)
        return calibrations_of(path.read_text("utf-8"))
    except OSError as error:
        raise RigError(f"the calibration cannot be read ({error.strerror})", where=path) from error
    except UnicodeDecodeError as error:
        raise RigError(f"it is not YAML ({type(error).__name__})", where=path, remedy=_YAML_REMEDY) from error
    except DecodingError as error:
        raise RigError(error.what, where=path, remedy=_YAML_REMEDY) from error


def chained_cameras(calibrations: Calibrations, path: Path) -> list[Camera]:
    """The cameras of Kalibr's camchain in the frame of cam0, not numbered. Raises RigError."""
    cameras: list[Camera] = []
    cam_SE3_cam0 = np.eye(4)
    for number, (topic, info) in enumerate(calibrations.cameras):
        if number:
            cam_SE3_cam0 = invert(calibrations.transforms[number - 1].parent_SE3_child) @ cam_SE3_cam0
        try:
            lens, K = of_camera(info.distortion_model, info.distortion, info.intrinsics)
        except RigError as error:
            raise RigError(f"cam{number}: {error.what}", where=path, remedy=error.remedy) from error
        size, name = (info.width_px, info.height_px), sensor_name(topic)
        cameras.append(Camera(0, name, topic, *size, K @ cam_SE3_cam0[:3], rectified=False, lens=lens))
    return cameras
