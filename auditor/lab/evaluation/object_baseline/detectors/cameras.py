"""Detectors of objects in images: networks in ONNX files."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.errors import SettingError
from auditor.lab.evaluation.object_baseline.detectors.described import LARGEST_SIDE_PX, CameraInput, CameraOutput
from auditor.lab.evaluation.object_baseline.detectors.interface import Detection, ImageBox
from auditor.lab.evaluation.object_baseline.detectors.networks import Found, Network
from auditor.lab.evaluation.object_baseline.detectors.overlap import overlaps
from auditor.model.arrays import Image

_COLUMNS = {
    "xyxy": ("left", "top", "right", "bottom"),
    "yxyx": ("top", "left", "bottom", "right"),
    "xywh": ("left", "top", "w", "h"),
    "cxcywh": ("cx", "cy", "w", "h"),
}

_LETTERBOX_GREY = 114


@dataclass(frozen=True)
class _Fit:
    """How an image was resized: pixels of the input for a pixel of the image, by axis, and the border at its start."""

    scale: tuple[float, float]
    border: tuple[int, int]


@dataclass(frozen=True, eq=False)
class OnnxCameraDetector(Network):
    """A camera detector made of a model and its description."""

    def __post_init__(self) -> None:
        super().__post_init__()
        shape = self.model.inputs[self.taken.name]
        sides = shape[2:] if self.taken.layout == "nchw" else shape[1:3]
        fixed = tuple(side for side in sides if isinstance(side, int))
        if len(shape) != 4 or (len(fixed) == 2 and fixed != self.taken.size):
            raise SettingError(
                f"the model takes {shape}, its description means images of {self.taken.size or 'any size'}",
                where=self.path.with_suffix(".toml"),
                remedy=f"write size = {list(fixed)} under [input]" if len(fixed) == 2 else "export it for images",
            )

    @property
    def taken(self) -> CameraInput:
        """Its input."""
        assert isinstance(self.description.input, CameraInput)
        return self.description.input

    @property
    def given(self) -> CameraOutput:
        """Its output."""
        assert isinstance(self.description.output, CameraOutput)
        return self.description.output

    def detect(self, pixels: Image) -> tuple[Detection, ...]:
        """The objects in an (H, W) grey or (H, W, 3) BGR image.

        Raises SettingError where the model fails, or its output is not as described.
        """
        shown, fit = self._shown(pixels)
        found = self.find(shown, 4)
        boxes = [box if box.area > 0 else None for box in self._boxes(found, fit, pixels.shape[:2])]
        return tuple(Detection(*one) for one in self.surest(found, boxes, overlaps))

    def _shown(self, pixels: Image) -> tuple[NDArray[np.generic], _Fit]:
        height, width = pixels.shape[:2]
        channels = np.ascontiguousarray(self.taken.channels(pixels))
        image, fit = _fitted(channels, self.taken.size or (height, width), self.taken.fit)
        shown: NDArray[np.generic] = image
        if self.taken.type == "float32":
            shown = self.taken.normalised(image)
        if self.taken.layout == "nchw":
            shown = shown.transpose(2, 0, 1)
        return np.ascontiguousarray(shown[np.newaxis]), fit

    def _boxes(self, found: Found, fit: _Fit, size: tuple[int, ...]) -> list[ImageBox]:
        """Boxes in pixels of the image, cut off at its edges."""
        columns = dict(zip(_COLUMNS[self.given.format], found.boxes.T, strict=True))
        if "cx" in columns:
            columns["left"], columns["top"] = columns["cx"] - columns["w"] / 2, columns["cy"] - columns["h"] / 2
        if "w" in columns:
            columns["right"], columns["bottom"] = columns["left"] + columns["w"], columns["top"] + columns["h"]
        height, width = size
        shown = self.taken.size or (height, width)
        across, down = (shown[1], shown[0]) if self.given.units == "shares" else (1, 1)
        ends = {}
        for name, unit, axis, length in (
            ("left", across, 1, width),
            ("top", down, 0, height),
            ("right", across, 1, width),
            ("bottom", down, 0, height),
        ):
            ends[name] = np.clip((columns[name] * unit - fit.border[axis]) / fit.scale[axis], 0, length)
        return [ImageBox(*map(float, row)) for row in zip(*ends.values(), strict=True)]


def _fitted(image: Image, size: tuple[int, int], how: str) -> tuple[Image, _Fit]:
    height, width = image.shape[:2]
    if max(height, width) > LARGEST_SIDE_PX * 4:
        raise SettingError(f"an image of {height} x {width} pixels is too large", where="--detector")
    scale = size[0] / height, size[1] / width
    if scale == (1.0, 1.0):
        return image, _Fit(scale, (0, 0))
    if how == "stretch":
        return _resized(image, size), _Fit(scale, (0, 0))
    least = min(scale)
    inner = max(round(height * least), 1), max(round(width * least), 1)
    top, left = (size[0] - inner[0]) // 2, (size[1] - inner[1]) // 2
    canvas = np.full((*size, image.shape[2]), _LETTERBOX_GREY, dtype=np.uint8)
    canvas[top : top + inner[0], left : left + inner[1]] = _resized(image, inner)
    return canvas, _Fit((inner[0] / height, inner[1] / width), (top, left))


def _resized(image: Image, size: tuple[int, int]) -> Image:
    resized = cv2.resize(image, size[::-1], interpolation=cv2.INTER_LINEAR)
    return np.asarray(resized, dtype=np.uint8).reshape(*size, image.shape[2])
