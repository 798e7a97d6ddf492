"""Detectors of the user's own: a TOML file beside the model describes the network's inputs and outputs.

    # yolov3.toml, beside yolov3.onnx
    sensor = "camera"                   # camera or cloud
    names = ["Pedestrian", "", "Car"]   # its classes in order, "" where one is of no interest
    first = 0                           # the number of the first of them
    score = 0.5                         # objects less sure than this are left out
    overlap = 0.5                       # of two of one class that overlap more than this the surer one stays

    [input]                             # of a camera
    name = "images"
    size = [416, 416]                   # height and width that it takes; left out, the image's own
    fit = "stretch"                     # how images get that size: stretch or letterbox
    layout = "nchw"                     # nchw or nhwc
    type = "float32"                    # float32 or uint8
    colour = "rgb"                      # rgb, bgr or grey
    divisor = 255.0                     # values are divided by it, less the mean, then divided by the deviation
    mean = [0.0]
    deviation = [1.0]

    [output]                            # "out[4:8]" is the columns 4 to 7 of the output out, "out[4]" column 4
    boxes = "boxes"                     # (M, 4), any number of axes of length 1 before them
    scores = "scores"                   # (M,), or (M, C) by class
    labels = "labels"                   # (M,) numbers of classes; "" where scores are by class
    objectness = ""                     # (M,) factors of the scores, where there are any
    format = "xyxy"                     # xyxy, yxyx, xywh or cxcywh
    units = "pixels"                    # of the input; or shares of it

Only `sensor` and `names` must be there; these are the defaults of the others. Of a cloud:

    [input]
    name = "points"
    kind = "points"                     # points (1, N, C), or grid: (1, C, H, W) seen from above
    points = 16384                      # N
    columns = 4                         # C: x, y, z, then zeros
    frame = "lidar"                     # lidar (x forward, y left, z up) or camera (x right, y down, z forward)
    x_m = [0.0, 70.0]                   # the points that are used
    y_m = [-40.0, 40.0]
    z_m = [-2.5, 1.0]
    cell_m = 0.1                        # side of a cell of the grid
    slices = 35                         # of it by height, each 1 where it holds a point
    empty = 1                           # channels of zeros after them
    rows = "y"                          # what the grid's rows follow: x or y

    [output]                            # boxes, scores, labels, objectness as above
    columns = ["x", "y", "z", "length", "width", "height", "yaw"]   # of boxes, in the frame of the input
    centred = true                      # whether z (in the camera frame y) is that of the centre, or of the underside
    ground_m = -1.73                    # z (y) of the underside where columns do not hold it
    height_m = 1.6                      # the height where columns do not hold it

The yaw turns from x towards y in the LiDAR's frame, and is KITTI's rotation_y in the camera's.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from auditor.errors import SettingError
from auditor.measurement.disparity.matchers.model_description import (
    NAME,
    NAME_OR_NOTHING,
    NUMBER,
    POSITIVE,
    SHARE,
    ModelTable,
    Pixels,
    Rule,
    described,
    numbers,
    one_of,
    read_toml,
    whole,
)

LARGEST_SIDE_PX = 4096
MOST_VALUES = 100_000_000
COLUMN = re.compile(r"(?P<name>.+?)(?:\[(?P<first>\d+)(?::(?P<end>\d+))?\])?")
SOLID = ("x", "y", "z", "length", "width", "height", "yaw")
_NEEDED = {"lidar": {"x", "y", "length", "width", "yaw"}, "camera": {"x", "z", "length", "width", "yaw"}}
_SIDE = whole("a number of pixels", largest=LARGEST_SIDE_PX)

_SIZE = Rule(
    lambda size: size is None or (isinstance(size, tuple) and len(size) == 2 and all(map(_SIDE.holds, size))),
    f"height and width, at most {LARGEST_SIDE_PX} pixels each",
)

_TWO = numbers("two numbers, the smaller first", 2)
_ENDS = Rule(lambda ends: _TWO.holds(ends) and ends[0] < ends[1], _TWO.meant)


def _are_texts(values: object) -> bool:
    return isinstance(values, tuple) and all(isinstance(value, str) for value in values)


_CLASSES = Rule(lambda names: _are_texts(names) and any(names), "a list of names of classes")
_COLUMNS = Rule(
    lambda columns: _are_texts(columns) and set(columns) <= set(SOLID) and len(set(columns)) == len(columns),
    f"a list of {', '.join(SOLID)}, where the vertical axis and height may be left out",
)


@dataclass(frozen=True)
class CameraInput(Pixels):
    """How an image is shown to the network."""

    name: Annotated[str, NAME] = "images"
    size: Annotated[tuple[int, int] | None, _SIZE] = None
    fit: Annotated[str, one_of("stretch", "letterbox")] = "stretch"
    layout: Annotated[str, one_of("nchw", "nhwc")] = "nchw"
    type: Annotated[str, one_of("float32", "uint8")] = "float32"


@dataclass(frozen=True)
class CloudInput(ModelTable):
    """How a point cloud is shown to the network."""

    name: Annotated[str, NAME] = "points"
    kind: Annotated[str, one_of("points", "grid")] = "points"
    points: Annotated[int, whole("a number of points")] = 16384
    columns: Annotated[int, whole("a number from 3 to 16", 3, 16)] = 4
    frame: Annotated[str, one_of("lidar", "camera")] = "lidar"
    x_m: Annotated[tuple[float, float], _ENDS] = (0.0, 70.0)
    y_m: Annotated[tuple[float, float], _ENDS] = (-40.0, 40.0)
    z_m: Annotated[tuple[float, float], _ENDS] = (-2.5, 1.0)
    cell_m: Annotated[float, POSITIVE] = 0.1
    slices: Annotated[int, whole("a whole number")] = 35
    empty: Annotated[int, whole("a whole number", 0)] = 1
    rows: Annotated[str, one_of("x", "y")] = "y"

    @property
    def cells(self) -> tuple[int, int]:
        """Cells of the grid along x and y."""
        along, across = (round((last - first) / self.cell_m) for first, last in (self.x_m, self.y_m))
        return along, across

    def rules(self) -> Iterator[tuple[str, bool, str]]:
        """The input fits into memory, and a grid is seen from above."""
        along, across = self.cells
        values = along * across * (self.slices + self.empty) if self.kind == "grid" else self.points * self.columns
        yield (
            "cell_m" if self.kind == "grid" else "points",
            0 < values <= MOST_VALUES,
            f"such that there are at most {MOST_VALUES:,} values",
        )
        yield "frame", self.kind == "points" or self.frame == "lidar", "lidar where the input is a grid"


@dataclass(frozen=True)
class DetectorOutput(ModelTable):
    """The places in the network's outputs of its boxes, scores and labels."""

    boxes: Annotated[str, NAME] = "boxes"
    scores: Annotated[str, NAME] = "scores"
    labels: Annotated[str, NAME_OR_NOTHING] = "labels"
    objectness: Annotated[str, NAME_OR_NOTHING] = ""

    @property
    def named(self) -> tuple[str, ...]:
        """The outputs that are needed, each once, without columns."""
        places = (self.boxes, self.scores, self.labels, self.objectness)
        return tuple(dict.fromkeys(part["name"] for place in places if place and (part := COLUMN.fullmatch(place))))


@dataclass(frozen=True)
class CameraOutput(DetectorOutput):
    """The same, and the columns of boxes in an image."""

    format: Annotated[str, one_of("xyxy", "yxyx", "xywh", "cxcywh")] = "xyxy"
    units: Annotated[str, one_of("pixels", "shares")] = "pixels"


@dataclass(frozen=True)
class CloudOutput(DetectorOutput):
    """The same, and the columns of boxes in space."""

    columns: Annotated[tuple[str, ...], _COLUMNS] = SOLID
    centred: Annotated[bool, Rule(lambda value: isinstance(value, bool), "true or false")] = True
    ground_m: Annotated[float, NUMBER] = -1.73
    height_m: Annotated[float, POSITIVE] = 1.6


_TABLES: Mapping[str, Mapping[str, type[ModelTable]]] = {
    "camera": {"input": CameraInput, "output": CameraOutput},
    "cloud": {"input": CloudInput, "output": CloudOutput},
}


@dataclass(frozen=True)
class DetectorDescription(ModelTable):
    """The TOML file beside a detector's model."""

    sensor: str
    names: Annotated[tuple[str, ...], _CLASSES] = ()
    first: Annotated[int, whole("the number of the first class", 0)] = 0
    score: Annotated[float, SHARE] = 0.5
    overlap: Annotated[float, SHARE] = 0.5
    input: CameraInput | CloudInput = field(default_factory=CameraInput)
    output: CameraOutput | CloudOutput = field(default_factory=CameraOutput)

    def rules(self) -> Iterator[tuple[str, bool, str]]:
        """A box in space needs the columns that lie on the ground in its frame."""
        if isinstance(self.input, CloudInput) and isinstance(self.output, CloudOutput):
            needed = _NEEDED[self.input.frame]
            yield "output.columns", needed <= set(self.output.columns), f"a list that has {', '.join(sorted(needed))}"


def read_description(model: Path) -> DetectorDescription:
    """The description beside a model. Raises SettingError where it is missing or ill-formed."""
    path, table = read_toml(model, remedy='write one with at least: sensor = "camera" and names = [...]')
    sensor = table.get("sensor")
    if sensor not in ("camera", "cloud"):
        raise SettingError("sensor is missing or unknown", where=path, remedy="it is camera or cloud")
    return described(path, DetectorDescription, table, _TABLES[sensor])
