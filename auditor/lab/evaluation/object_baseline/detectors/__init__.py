"""Detectors of objects: they give boxes in images and point clouds."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from auditor.errors import SettingError, needing
from auditor.lab.evaluation.object_baseline.detectors.geometric import GEOMETRIC, SETTINGS
from auditor.lab.evaluation.object_baseline.detectors.interface import (
    CAR,
    CameraDetector,
    CloudDetector,
    Detection,
    ImageBox,
    SolidBox,
    SolidDetection,
)
from auditor.model.canonical import canonical_json

STREETS = "streets"
"""The two networks that come with auditor."""

_AGREEMENT = 2
"""Raised whenever the same boxes of networks would be compared in another way."""


@dataclass(frozen=True, eq=False)
class Detectors:
    """The detectors for images and for point clouds; without one, clusters of points stand for objects."""

    camera: CameraDetector | None = None
    cloud: CloudDetector | None = None

    @property
    def name(self) -> str:
        """Their names, the camera's first."""
        parts = [one.name for one in (self.camera, self.cloud) if one]
        return " + ".join(dict.fromkeys(parts if len(parts) == 2 else [*parts, GEOMETRIC]))

    @property
    def libraries(self) -> Mapping[str, str]:
        """Versions of the libraries that run networks, by name."""
        return {name: version for one in (self.camera, self.cloud) if one for name, version in one.libraries.items()}

    @property
    def settings(self) -> str:
        """Canonical JSON of all that can change a box."""
        networks = {"camera": self.camera, "cloud": self.cloud}
        values = {name: json.loads(one.settings) for name, one in networks.items() if one}
        values |= {"agreement": _AGREEMENT} if values else {}
        return canonical_json(values | {GEOMETRIC: SETTINGS})


def find_detectors(names: Sequence[str]) -> Detectors:
    """The detectors `geometric`, `streets` or `onnx:FILE`, at most one for cameras and one for clouds.

    Raises SettingError for other names, for two of a kind, for a missing package, and for a bad model.
    """
    given = [_named(name) for name in names if name != GEOMETRIC]
    cameras, clouds = (
        [one for one in of if one is not None] for of in (zip(*given, strict=True) if given else ((), ()))
    )
    for sensor, of_it in (("camera", cameras), ("cloud", clouds)):
        if len(of_it) > 1:
            raise SettingError(f"two detectors are given for a {sensor}", where="--detector", remedy="give one of each")
    return Detectors(*(of_it[0] if of_it else None for of_it in (cameras, clouds)))


def _named(name: str) -> tuple[CameraDetector | None, CloudDetector | None]:
    kind, _, file = name.partition(":")
    if name == STREETS:
        return _streets()
    if kind == "onnx" and file:
        return _opened(Path(file))
    raise SettingError(
        f"there is no detector {name!r}", where="--detector", remedy="use geometric, streets or onnx:FILE"
    )


def _streets() -> tuple[CameraDetector, CloudDetector]:
    with needing("this detector needs", "psmnet", "--detector"):
        from auditor.lab.evaluation.object_baseline.detectors.streets import clouds, images  # noqa: PLC0415 - an extra
    return images.shipped_images(), clouds.shipped_clouds()


def _opened(path: Path) -> tuple[CameraDetector | None, CloudDetector | None]:
    with needing("a detector needs", "onnx", "--detector"):
        from auditor.lab.evaluation.object_baseline.detectors.described import read_description  # noqa: PLC0415
        from auditor.lab.evaluation.object_baseline.detectors.networks import (  # noqa: PLC0415 - an extra
            OnnxCameraDetector,
            OnnxCloudDetector,
        )
        from auditor.measurement.disparity.matchers.onnx_models import OnnxModel  # noqa: PLC0415
    description = read_description(path)
    model = OnnxModel(path)
    if description.sensor == "camera":
        return OnnxCameraDetector(path, model, description), None
    return None, OnnxCloudDetector(path, model, description)


__all__ = [
    "CAR",
    "CameraDetector",
    "CloudDetector",
    "Detection",
    "Detectors",
    "ImageBox",
    "SolidBox",
    "SolidDetection",
    "find_detectors",
]
