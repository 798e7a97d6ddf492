"""rig.toml: a rig that people can read and correct, with every number exact."""

import json
import tomllib
from collections.abc import Iterator
from pathlib import Path

from auditor.errors import RigError
from auditor.geometry import Matrix
from auditor.lenses import NO_LENS
from auditor.rig import Camera, Lidar, Rig

_HEAD = """\
# The sensors of a vehicle: S_0 is the LiDAR, S_1..S_n are the cameras from right to left.
# projection: 3 x 4, P = K [R | t], points of the rig frame in metres to pixels, lens distortion apart.
# rectified: whether the images are so, all cameras looking along the rig's z axis without distortion; if not,
# distortion_model (plumb_bob, rational_polynomial, equidistant) and distortion (its coefficients) say what bends them.
# rig_SE3_lidar: 4 x 4, points of the LiDAR frame to the rig frame, in metres.
# offset_ns, of any sensor: how far its stamps lie behind the leftmost camera's; without it the recording shows it.
"""

_REMEDY = "`auditor inspect RECORDING --write-rig` writes one to compare it with"


def read_rig(path: Path) -> Rig:
    """Read a rig file. Raises RigError where it is missing, or holds no rig."""
    try:
        description = tomllib.loads(path.read_text("utf-8"))
    except OSError as error:
        what = f"the rig file cannot be read ({error.strerror})"
        raise RigError(what, where=path, remedy=f"check the path; {_REMEDY}") from error
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise RigError(f"the rig file is no TOML ({error})", where=path, remedy=_REMEDY) from error
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
