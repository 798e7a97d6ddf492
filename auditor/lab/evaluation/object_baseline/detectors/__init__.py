"""Detectors of objects: they give boxes in images and point clouds."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from auditor.errors import SettingError
from auditor.lab.evaluation.object_baseline.detectors.geometric import GEOMETRIC, SETTINGS
from auditor.lab.evaluation.object_baseline.detectors.interface import (
    Detection,
    ImageBox,
    SolidBox,
    SolidDetection,
)

if TYPE_CHECKING:
    from auditor.lab.evaluation.object_baseline.detectors.clouds import OnnxCloudDetector
    from auditor.lab.evaluation.object_baseline.detectors.networks import OnnxCameraDetector


@dataclass(frozen=True, eq=False)
class Detectors:
    """The detectors for images and for point clouds; without one, clusters of points stand for objects."""

    camera: "OnnxCameraDetector | None" = None
    cloud: "OnnxCloudDetector | None" = None

    @property
    def name(self) -> str:
        """Their names, the camera's first."""
        parts = [one.name for one in (self.camera, self.cloud) if one]
        return " + ".join(parts if len(parts) == 2 else [*parts, GEOMETRIC])

    @property
    def libraries(self) -> Mapping[str, str]:
        """Versions of the libraries that run networks, by name."""
        return {name: version for one in (self.camera, self.cloud) if one for name, version in one.libraries.items()}

    @property
    def settings(self) -> str:
        """Canonical JSON of all that can change a box."""
        networks = {"camera": self.camera, "cloud": self.cloud}
        values = {name: json.loads(one.settings) for name, one in networks.items() if one}
        return json.dumps(values | {GEOMETRIC: SETTINGS}, sort_keys=True, separators=(",", ":"))


def find_detectors(names: Sequence[str]) -> Detectors:
    """The detectors `geometric` or `onnx:FILE`, at most one for cameras and one for clouds.

    Raises SettingError for other names, for two of a kind, for a missing package, and for a bad model.
    """
    opened: dict[str, OnnxCameraDetector | OnnxCloudDetector] = {}
    for name in names:
        if name == GEOMETRIC:
            continue
        kind, _, file = name.partition(":")
        if kind != "onnx" or not file:
            raise SettingError(
                f"there is no detector {name!r}", where="--detector", remedy="use geometric or onnx:FILE"
            )
        sensor, detector = _opened(Path(file))
        if sensor in opened:
            raise SettingError(f"two detectors are given for a {sensor}", where="--detector", remedy="give one of each")
        opened[sensor] = detector
    return Detectors(**opened)  # type: ignore[arg-type]  # each has the type of its sensor


def _opened(path: Path) -> tuple[str, "OnnxCameraDetector | OnnxCloudDetector"]:
    try:
        from auditor.lab.evaluation.object_baseline.detectors.clouds import OnnxCloudDetector  # noqa: PLC0415
        from auditor.lab.evaluation.object_baseline.detectors.described import read_description  # noqa: PLC0415
        from auditor.lab.evaluation.object_baseline.detectors.networks import OnnxCameraDetector  # noqa: PLC0415 - an extra
        from auditor.measurement.disparity.matchers.onnx_models import OnnxModel  # noqa: PLC0415
    except ModuleNotFoundError as error:
        raise SettingError(
            f"a detector needs the package {error.name}", where="--detector", remedy="pip install 'auditor[onnx]'"
        ) from error
    description = read_description(path)
    model = OnnxModel(path)
    if description.sensor == "camera":
        return "camera", OnnxCameraDetector(path, model, description)
    return "cloud", OnnxCloudDetector(path, model, description)


__all__ = [
    "Detection",
    "Detectors",
    "ImageBox",
    "SolidBox",
    "SolidDetection",
    "find_detectors",
]
