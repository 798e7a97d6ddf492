"""Detectors of the user's own: what their networks take and give is said in a TOML file beside the model.

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
    x_m = [0.0, 70.0]                   # what is looked at
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
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from auditor.errors import SettingError
from auditor.evidence.descriptions import are_numbers, fields_of, is_name, is_whole, read_toml, refuse

LARGEST_SIDE_PX = 4096
MOST_VALUES = 100_000_000
COLUMN = re.compile(r"(?P<name>.+?)(?:\[(?P<first>\d+)(?::(?P<end>\d+))?\])?")
SOLID = ("x", "y", "z", "length", "width", "height", "yaw")
_NEEDED = {"lidar": {"x", "y", "length", "width", "yaw"}, "camera": {"x", "z", "length", "width", "yaw"}}


@dataclass(frozen=True)
class CameraInput:
    """How an image is shown to the network."""

    name: str = "images"
    size: tuple[int, int] | None = None
    fit: str = "stretch"
    layout: str = "nchw"
    type: str = "float32"
    colour: str = "rgb"
    divisor: float = 255.0
    mean: tuple[float, ...] = (0.0,)
    deviation: tuple[float, ...] = (1.0,)


@dataclass(frozen=True)
class CloudInput:
    """How a point cloud is shown to the network."""

    name: str = "points"
    kind: str = "points"
    points: int = 16384
    columns: int = 4
    frame: str = "lidar"
    x_m: tuple[float, float] = (0.0, 70.0)
    y_m: tuple[float, float] = (-40.0, 40.0)
    z_m: tuple[float, float] = (-2.5, 1.0)
    cell_m: float = 0.1
    slices: int = 35
    empty: int = 1
    rows: str = "y"

    @property
    def cells(self) -> tuple[int, int]:
        """Cells of the grid along x and y."""
        along, across = (round((last - first) / self.cell_m) for first, last in (self.x_m, self.y_m))
        return along, across


@dataclass(frozen=True)
class Output:
    """Where the network's outputs hold what it found."""

    boxes: str = "boxes"
    scores: str = "scores"
    labels: str = "labels"
    objectness: str = ""

    @property
    def named(self) -> tuple[str, ...]:
        """The outputs that are needed, each once, without columns."""
        places = (self.boxes, self.scores, self.labels, self.objectness)
        return tuple(dict.fromkeys(part["name"] for place in places if place and (part := COLUMN.fullmatch(place))))


@dataclass(frozen=True)
class CameraOutput(Output):
    """The same, and what the columns of boxes in an image are."""

    format: str = "xyxy"
    units: str = "pixels"


@dataclass(frozen=True)
class CloudOutput(Output):
    """The same, and what the columns of boxes in space are."""

    columns: tuple[str, ...] = SOLID
    centred: bool = True
    ground_m: float = -1.73
    height_m: float = 1.6


@dataclass(frozen=True)
class Description:
    """The TOML file beside a detector's model."""

    sensor: str
    names: tuple[str, ...]
    first: int = 0
    score: float = 0.5
    overlap: float = 0.5
    input: CameraInput | CloudInput = field(default_factory=CameraInput)
    output: CameraOutput | CloudOutput = field(default_factory=CameraOutput)


def read_description(model: Path) -> Description:
    """The description beside a model. Raises SettingError where it makes no sense."""
    path, table = read_toml(model, remedy='write one with at least: sensor = "camera" and names = [...]')
    values = fields_of(path, Description, table)
    if values.get("sensor") not in ("camera", "cloud"):
        raise SettingError("sensor is missing or unknown", where=path, remedy="it is camera or cloud")
    kinds: tuple[type[Any], type[Any]] = (
        (CameraInput, CameraOutput) if values["sensor"] == "camera" else (CloudInput, CloudOutput)
    )
    parts = {
        name: kind(**fields_of(path, kind, table.get(name, {})))
        for name, kind in zip(("input", "output"), kinds, strict=True)
    }
    description = Description(**{"names": ()} | values | parts)
    refuse(path, _rules(description))
    refuse(path, _output_rules(description.output))
    return description


def _rules(of_it: Description) -> Iterator[tuple[str, bool, str]]:
    names = of_it.names
    texts = isinstance(names, tuple) and all(isinstance(name, str) for name in names)
    yield "names", texts and any(names), "a list of names of classes"
    yield "first", isinstance(of_it.first, int) and of_it.first >= 0, "the number of the first class"
    yield "score", _share(of_it.score), "a number from 0 to 1"
    yield "overlap", _share(of_it.overlap), "a number from 0 to 1"
    if isinstance(of_it.input, CameraInput):
        yield from _camera_rules(of_it.input)
    elif isinstance(of_it.output, CloudOutput):
        yield from _cloud_rules(of_it.input)
        yield from _column_rules(of_it.output, _NEEDED[of_it.input.frame])


def _camera_rules(taken: CameraInput) -> Iterator[tuple[str, bool, str]]:
    channels = (1,) if taken.colour == "grey" else (1, 3)
    size = taken.size is None or (
        isinstance(taken.size, tuple)
        and len(taken.size) == 2
        and all(is_whole(side) and side <= LARGEST_SIDE_PX for side in taken.size)
    )
    yield "input.name", is_name(taken.name), "a name"
    yield "input.size", size, f"height and width, at most {LARGEST_SIDE_PX} pixels each"
    yield "input.fit", taken.fit in ("stretch", "letterbox"), "stretch or letterbox"
    yield "input.layout", taken.layout in ("nchw", "nhwc"), "nchw or nhwc"
    yield "input.type", taken.type in ("float32", "uint8"), "float32 or uint8"
    yield "input.colour", taken.colour in ("rgb", "bgr", "grey"), "rgb, bgr or grey"
    yield "input.divisor", are_numbers((taken.divisor,), (1,), positive=True), "a positive number"
    yield "input.mean", are_numbers(taken.mean, channels), "a list of one number, or of one a channel"
    yield "input.deviation", are_numbers(taken.deviation, channels, positive=True), "a list like mean, of positive ones"


def _cloud_rules(taken: CloudInput) -> Iterator[tuple[str, bool, str]]:
    yield "input.name", is_name(taken.name), "a name"
    yield "input.kind", taken.kind in ("points", "grid"), "points or grid"
    yield "input.points", is_whole(taken.points), "a number of points"
    yield "input.columns", is_whole(taken.columns) and 3 <= taken.columns <= 16, "a number from 3 to 16"
    yield "input.frame", taken.frame in ("lidar", "camera"), "lidar or camera"
    for name in ("x_m", "y_m", "z_m"):
        ends = getattr(taken, name)
        yield f"input.{name}", are_numbers(ends, (2,)) and ends[0] < ends[1], "two numbers, the smaller first"
    yield "input.cell_m", are_numbers((taken.cell_m,), (1,), positive=True), "a positive number"
    yield "input.slices", is_whole(taken.slices), "a whole number"
    yield "input.empty", taken.empty == 0 or is_whole(taken.empty), "a whole number"
    yield "input.rows", taken.rows in ("x", "y"), "x or y"
    along, across = taken.cells
    values = along * across * (taken.slices + taken.empty) if taken.kind == "grid" else taken.points * taken.columns
    yield "input", 0 < values <= MOST_VALUES, f"at most {MOST_VALUES:,} values"
    yield "input.frame", taken.kind == "points" or taken.frame == "lidar", "lidar where the input is a grid"


def _output_rules(given: CameraOutput | CloudOutput) -> Iterator[tuple[str, bool, str]]:
    for name in ("boxes", "scores"):
        yield f"output.{name}", is_name(getattr(given, name)), "a name"
    for name in ("labels", "objectness"):
        yield f"output.{name}", isinstance(getattr(given, name), str), "a name, or nothing"
    if isinstance(given, CameraOutput):
        yield "output.format", given.format in ("xyxy", "yxyx", "xywh", "cxcywh"), "xyxy, yxyx, xywh or cxcywh"
        yield "output.units", given.units in ("pixels", "shares"), "pixels or shares"


def _column_rules(given: CloudOutput, needed: set[str]) -> Iterator[tuple[str, bool, str]]:
    texts = isinstance(given.columns, tuple) and all(isinstance(name, str) for name in given.columns)
    columns = set(given.columns) if texts else set()
    known = columns >= needed and columns <= set(SOLID) and len(columns) == len(given.columns)
    yield "output.columns", known, f"a list of {', '.join(SOLID)}, where the vertical axis and height may be left out"
    yield "output.centred", isinstance(given.centred, bool), "true or false"
    yield "output.ground_m", are_numbers((given.ground_m,), (1,)), "a number"
    yield "output.height_m", are_numbers((given.height_m,), (1,), positive=True), "a positive number"


def _share(value: object) -> bool:
    return isinstance(value, int | float) and 0 <= value <= 1
