"""What detectors in ONNX files have in common: a model, its description, and what becomes of its outputs."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.errors import SettingError
from auditor.lab.evaluation.object_baseline.detectors.described import (
    COLUMN,
    LARGEST_SIDE_PX,
    CameraInput,
    CameraOutput,
    CloudInput,
    CloudOutput,
    DetectorDescription,
)
from auditor.lab.evaluation.object_baseline.detectors.interface import Detection, ImageBox, SolidBox, SolidDetection
from auditor.lab.evaluation.object_baseline.detectors.overlap import overlaps, overlaps_on_ground, suppressed
from auditor.measurement.disparity.matchers.onnx_models import OnnxModel
from auditor.model.arrays import Floats, Image, Points
from auditor.model.optics.geometry import Matrix

Box = TypeVar("Box")


MOST_OBJECTS = 300
"""The most objects of one frame; those of the highest scores stay."""


@dataclass(frozen=True, eq=False)
class Detections:
    """(M, K) numbers of boxes as the network gives them, (M,) scores, surest first, and the M names."""

    boxes: Floats
    scores: Floats
    names: Sequence[str]


@dataclass(frozen=True, eq=False)
class Network:
    """A model and its description. Raises SettingError where they disagree."""

    path: Path
    model: OnnxModel
    description: DetectorDescription

    def __post_init__(self) -> None:
        self.model.check_names([self.description.input.name], self.description.output.named)

    @property
    def name(self) -> str:
        """The name of its file."""
        return self.path.name

    @property
    def settings(self) -> str:
        """Canonical JSON of the model's hash and its description."""
        return self.description.settings(self.model.sha256)

    @property
    def labels(self) -> frozenset[str]:
        """The kinds of object that it can name."""
        return frozenset(filter(None, self.description.names))

    @property
    def libraries(self) -> Mapping[str, str]:
        """Versions of the libraries that run it, by name."""
        return self.model.libraries

    def find(self, shown: NDArray[np.generic], columns: int) -> Detections:
        """The objects that the model finds. Raises SettingError where it fails or its output is not as described."""
        named = self.description.output.named
        values = self.model.run(named, {self.description.input.name: shown})
        return take_apart(dict(zip(named, values, strict=True)), self.description, columns, self.path)

    def surest(
        self, detections: Detections, boxes: Sequence[Box | None], agreement: Callable[[list[Box], list[Box]], Floats]
    ) -> list[tuple[Box, float, str]]:
        """Box, score and name of the objects that stay: one of those of a class that overlap, none without a box."""
        kept: list[tuple[Box, float, str]] = []
        for name in sorted(set(detections.names)):
            of_it = [
                (box, float(score))
                for box, score, other in zip(boxes, detections.scores, detections.names, strict=True)
                if other == name and box is not None
            ]
            here = [box for box, _ in of_it]
            scores = np.array([score for _, score in of_it])
            positions = suppressed(scores, agreement(here, here), self.description.overlap)
            kept += [(*of_it[position], name) for position in positions]
        return kept


def take_apart(
    outputs: Mapping[str, NDArray[np.generic]], description: DetectorDescription, columns: int, where: Path
) -> Detections:
    """The objects that have a name and a sufficient score, at most MOST_OBJECTS.

    Raises SettingError where the outputs are not as described.
    """
    given = description.output
    boxes = _part(outputs, given.boxes, where)
    if boxes.ndim < 2 or boxes.shape[-1] != columns or boxes.size != boxes.shape[-2] * columns:
        raise _mismatch(given.boxes, boxes, f"(M, {columns})", where)
    boxes = boxes.reshape(-1, columns)
    scores = _part(outputs, given.scores, where)
    if given.labels or scores.size == len(boxes):
        scores = _vector(given.scores, scores, len(boxes), where)
        labels = np.zeros(len(boxes))
        if given.labels:
            labels = _vector(given.labels, _part(outputs, given.labels, where), len(boxes), where) - description.first
    else:
        if scores.ndim < 2 or scores.size != len(boxes) * scores.shape[-1]:
            raise _mismatch(given.scores, scores, f"({len(boxes)}, C)", where)
        by_class = scores.reshape(len(boxes), -1)
        labels, scores = by_class.argmax(axis=1).astype(np.float64), by_class.max(axis=1, initial=-np.inf)
        labels -= description.first
    if given.objectness:
        scores = scores * _vector(given.objectness, _part(outputs, given.objectness, where), len(boxes), where)
    sensible = np.isfinite(boxes).all(axis=1) & (scores >= description.score) & np.isfinite(labels)
    sensible &= (labels >= 0) & (labels < len(description.names))
    positions = np.flatnonzero(sensible)
    names = {int(position): description.names[int(labels[position])] for position in positions}
    kept = [p for p in positions[np.argsort(-scores[positions], kind="stable")] if names[int(p)]][:MOST_OBJECTS]
    return Detections(boxes[kept], scores[kept], [names[int(p)] for p in kept])


def _part(outputs: Mapping[str, NDArray[np.generic]], place: str, where: Path) -> Floats:
    """An output, or columns of its last axis."""
    part = COLUMN.fullmatch(place)
    assert part is not None
    try:
        values = np.asarray(outputs[part["name"]], dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise SettingError(f"the output {part['name']} holds no numbers", where=where) from error
    if part["first"] is None:
        return values
    first = int(part["first"])
    end = int(part["end"] or first + 1)
    if values.ndim < 2 or not first < end <= values.shape[-1]:
        raise _mismatch(place, values, f"{end} columns at least", where)
    return values[..., first:end]


def _vector(place: str, values: Floats, length: int, where: Path) -> Floats:
    if values.size != length:
        raise _mismatch(place, values, f"({length},)", where)
    return values.reshape(length)


def _mismatch(place: str, values: Floats, meant: str, where: Path) -> SettingError:
    return SettingError(
        f"the model gives {place} as {values.shape} where its description means {meant}",
        where=where,
        remedy="correct the outputs in the TOML file beside it",
    )


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
        detections = self.find(shown, 4)
        boxes = [box if box.area > 0 else None for box in self._boxes(detections, fit, pixels.shape[:2])]
        return tuple(Detection(*one) for one in self.surest(detections, boxes, overlaps))

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

    def _boxes(self, detections: Detections, fit: _Fit, size: tuple[int, ...]) -> list[ImageBox]:
        """Boxes in pixels of the image, cut off at its edges."""
        columns = dict(zip(_COLUMNS[self.given.format], detections.boxes.T, strict=True))
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


@dataclass(frozen=True, eq=False)
class OnnxCloudDetector(Network):
    """A cloud detector made of a model and its description."""

    @property
    def taken(self) -> CloudInput:
        """Its input."""
        assert isinstance(self.description.input, CloudInput)
        return self.description.input

    @property
    def given(self) -> CloudOutput:
        """Its output."""
        assert isinstance(self.description.output, CloudOutput)
        return self.description.output

    def detect(self, xyz_m: Points, rig_SE3_lidar: Matrix) -> tuple[SolidDetection, ...]:
        """The objects among (N, 3) points in the LiDAR frame, as boxes in the rig frame.

        Raises SettingError where the model fails, or its output is not as described.
        """
        points = xyz_m
        if self.taken.frame == "camera":
            points = (xyz_m @ rig_SE3_lidar[:3, :3].T + rig_SE3_lidar[:3, 3]).astype(np.float32)
        shown = _as_points(points, self.taken) if self.taken.kind == "points" else _as_grid(points, self.taken)
        detections = self.find(shown, len(self.given.columns))
        rows = [dict(zip(self.given.columns, map(float, row), strict=True)) for row in detections.boxes]
        boxes = [self._box(row, rig_SE3_lidar) for row in rows]
        return tuple(SolidDetection(*one) for one in self.surest(detections, boxes, overlaps_on_ground))

    def _box(self, row: dict[str, float], rig_SE3_lidar: Matrix) -> SolidBox | None:
        """The network's numbers as a box in the rig frame; None where it has no size."""
        given = self.given
        height, length, width, yaw = row.get("height", given.height_m), row["length"], row["width"], row["yaw"]
        if min(height, length, width) <= 0:
            return None
        half = height / 2 if given.centred else 0.0
        if self.taken.frame == "camera":
            y = row["y"] + half if "y" in row else given.ground_m
            return SolidBox(row["x"], y, row["z"], length, width, height, yaw)
        under = row["z"] - half if "z" in row else given.ground_m
        rotation, translation = rig_SE3_lidar[:3, :3], rig_SE3_lidar[:3, 3]
        x, y, z = map(float, rotation @ [row["x"], row["y"], under] + translation)
        heading = rotation @ [np.cos(yaw), np.sin(yaw), 0.0]
        return SolidBox(x, y, z, length, width, height, float(np.arctan2(-heading[2], heading[0])))


def _inside(points: Points, taken: CloudInput) -> Points:
    """The points within the described limits."""
    ends = np.array([taken.x_m, taken.y_m, taken.z_m], dtype=np.float32)
    inside: Points = points[((points >= ends[:, 0]) & (points < ends[:, 1])).all(axis=1)]
    return inside


def _as_points(points: Points, taken: CloudInput) -> Points:
    """(1, N, C): evenly spaced points where there are more, repeated points where there are fewer."""
    inside = _inside(points, taken)
    shown = np.zeros((taken.points, taken.columns), dtype=np.float32)
    if len(inside):
        most = max(len(inside), taken.points)
        chosen = np.arange(taken.points) * most // taken.points % len(inside)
        shown[:, :3] = inside[chosen]
    return shown[np.newaxis]


def _as_grid(points: Points, taken: CloudInput) -> Points:
    """(1, slices + empty, H, W): 1 where a cell holds a point."""
    inside = _inside(points, taken)
    along, across = taken.cells
    grid = np.zeros((taken.slices + taken.empty, along, across), dtype=np.float32)
    x, y = ((inside[:, axis] - first) / taken.cell_m for axis, first in ((0, taken.x_m[0]), (1, taken.y_m[0])))
    z = (inside[:, 2] - taken.z_m[0]) / (taken.z_m[1] - taken.z_m[0]) * taken.slices
    lengths = (taken.slices, along, across)
    grid[tuple(np.clip(of.astype(np.intp), 0, most - 1) for of, most in zip((z, x, y), lengths, strict=True))] = 1
    return np.ascontiguousarray((grid if taken.rows == "x" else grid.transpose(0, 2, 1))[np.newaxis])
