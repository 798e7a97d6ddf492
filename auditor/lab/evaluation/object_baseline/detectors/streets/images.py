"""The detector of cars in images that was trained on synthetic streets."""

from pathlib import Path

import cv2
import numpy as np

from auditor.lab.evaluation.object_baseline.detectors.interface import CAR, Detection, ImageBox
from auditor.lab.evaluation.object_baseline.detectors.overlap import overlaps, suppressed
from auditor.lab.evaluation.object_baseline.detectors.streets.network import (
    MOST_OVERLAP,
    MULTIPLE,
    STRIDE,
    CentreNet,
    StreetDetector,
    unpacked,
)
from auditor.measurement.disparity.half_resolution import grey
from auditor.model.arrays import Floats, Floats32, Image

STEP = 2
"""It sees every second pixel each way."""

SHIPPED = Path(__file__).with_name("images_fp16.safetensors")
SHIPPED_SHA256 = "cc83ddd7ebf8a09282df6dcc25daa40ad5609d93e8f9109caab4bd6a13098b06"

NUMBERS = 4
_USUAL = 8.0
"""A usual side of a box, in cells of the map."""


class StreetImages(StreetDetector):
    """A trained network as a detector for images."""

    def detect(self, pixels: Image) -> tuple[Detection, ...]:
        """The cars in an (H, W) grey or (H, W, 3) BGR image."""
        places, numbers = self.trained.peaks(shown(half(pixels)))
        height, width = pixels.shape[:2]
        boxes = [
            ImageBox(*np.clip(box * STEP, 0, [width, height] * 2).tolist()) for box in decoded(places[:, 1:], numbers)
        ]
        kept = suppressed(places[:, 0], overlaps(boxes, boxes), MOST_OVERLAP)
        return tuple(Detection(boxes[at], float(places[at, 0]), CAR) for at in kept if boxes[at].area > 0)


def shipped_images() -> StreetImages:
    """The detector that comes with auditor. Raises SettingError where its weights are missing or were changed."""
    return StreetImages(unpacked(new_network(), SHIPPED, SHIPPED_SHA256))


def new_network() -> CentreNet:
    """A network that is not trained."""
    return CentreNet(1, NUMBERS)


def half(pixels: Image) -> Image:
    """The picture that the network sees, in grey."""
    height, width = pixels.shape[:2]
    size = width // STEP, height // STEP
    return np.asarray(cv2.resize(grey(pixels), size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def resized(image: Image, scale: float) -> Image:
    """The picture with so many times its rows and columns."""
    return np.asarray(cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_LINEAR), dtype=np.uint8)


def shown(image: Image) -> Floats32:
    """(1, H, W) of the network's input: the picture, filled up below and to the right with its own edge."""
    height, width = image.shape
    padding = (0, -height % MULTIPLE), (0, -width % MULTIPLE)
    whole = np.pad(image.astype(np.float32), padding, mode="edge")
    return np.asarray((whole / 255 - 0.5)[None] * 4, dtype=np.float32)


def decoded(cells: Floats, numbers: Floats) -> Floats:
    """(M, 4) boxes in the network's pixels; `cells` are (M, 2) rows and columns of the map."""
    middle = (cells[:, ::-1] + 0.5 + numbers[:, :2]) * STRIDE
    size = np.exp(np.clip(numbers[:, 2:], -4, 4)) * (_USUAL * STRIDE)
    return np.concatenate([middle - size / 2, middle + size / 2], axis=1)


def encoded(cells: Floats, boxes: Floats) -> Floats:
    """The (M, NUMBERS) that `decoded` makes (M, 4) boxes of."""
    middle, size = (boxes[:, :2] + boxes[:, 2:]) / 2, boxes[:, 2:] - boxes[:, :2]
    aside = middle / STRIDE - cells[:, ::-1] - 0.5
    return np.concatenate([aside, np.log(size / (_USUAL * STRIDE))], axis=1)
