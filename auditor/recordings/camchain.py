"""Kalibr's camchain.yaml: cameras with their lenses, each placed against the one before it.

Format: Kalibr's wiki, "yaml formats": cam0, cam1, ... with camera_model, intrinsics (fu fv pu pv), distortion_model,
distortion_coeffs, resolution, rostopic and, from cam1 on, T_cn_cnm1 (4 x 4, points of the camera before to this one).
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from auditor.errors import RigError
from auditor.geometry import Matrix
from auditor.lenses import PINHOLE, Lens
from auditor.recordings.views import sensor_name
from auditor.rig import Camera

_MAX_BYTES = 2**20
_REMEDY = "compare it with one that Kalibr wrote"


def read_camchain(path: Path) -> list[Camera]:
    """Its cameras in the frame of cam0, without numbers. Raises RigError where it is no camchain."""
    try:
        if path.stat().st_size > _MAX_BYTES:
            raise RigError(f"it has more than {_MAX_BYTES} bytes", where=path, remedy=_REMEDY)
        chain = YAML(typ="safe", pure=True).load(path.read_text("utf-8"))
    except OSError as error:
        raise RigError(f"the camera chain cannot be read ({error.strerror})", where=path) from error
    except (YAMLError, UnicodeDecodeError, RecursionError) as error:
        raise RigError(f"it is no YAML ({type(error).__name__})", where=path, remedy=_REMEDY) from error
    if not isinstance(chain, Mapping) or "cam0" not in chain:
        raise RigError("it describes no cam0", where=path, remedy=_REMEDY)
    cameras: list[Camera] = []
    cam_SE3_cam0 = np.eye(4)
    while (name := f"cam{len(cameras)}") in chain:
        try:
            if cameras:
                cam_SE3_cam0 = _motion(chain[name]["T_cn_cnm1"]) @ cam_SE3_cam0
            cameras.append(_camera(chain[name], cam_SE3_cam0))
        except (KeyError, TypeError, ValueError) as error:
            what = f"lacks {error}" if isinstance(error, KeyError) else f"is ill-formed ({error})"
            raise RigError(f"{name} {what}", where=path, remedy=_REMEDY) from error
        except RigError as error:
            raise RigError(f"{name}: {error.what}", where=path, remedy=error.remedy) from error
    return cameras


def _camera(described: Mapping[str, object], cam_SE3_cam0: Matrix) -> Camera:
    if described["camera_model"] != "pinhole":
        raise RigError(f"the camera model {described['camera_model']!r} is not known", remedy="use pinhole")
    fu, fv, pu, pv = _numbers(described["intrinsics"], 4)
    width_px, height_px = (int(size) for size in _numbers(described["resolution"], 2))
    if min(fu, fv, width_px, height_px) <= 0:
        raise ValueError("a size or focal length is not positive")
    coefficients = described["distortion_coeffs"]
    model = str(described["distortion_model"])
    lens = Lens(model, () if model == PINHOLE else _numbers(coefficients, 4))
    topic = str(described["rostopic"])
    K = np.array([[fu, 0, pu], [0, fv, pv], [0, 0, 1]])
    return Camera(0, sensor_name(topic), topic, width_px, height_px, K @ cam_SE3_cam0[:3], rectified=False, lens=lens)


def _motion(rows: object) -> Matrix:
    if not isinstance(rows, list) or len(rows) != 4:
        raise ValueError("T_cn_cnm1 must be 4 x 4")
    matrix = np.array([_numbers(row, 4) for row in rows])
    if not np.allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), atol=1e-3):
        raise ValueError("the rotation of T_cn_cnm1 is none")
    return matrix


def _numbers(values: object, count: int) -> tuple[float, ...]:
    """So many finite numbers and nothing else: lists may hold themselves again and again."""
    if not isinstance(values, list) or len(values) != count or not all(isinstance(v, int | float) for v in values):
        raise ValueError(f"{count} numbers are needed")
    if not np.isfinite(values).all():
        raise ValueError("a number is not finite")
    return tuple(float(value) for value in values)
