"""Stereo networks of the user's own: what they take and give is said in a TOML file beside the model.

    # crestereo.toml, beside crestereo.onnx
    range_px = 192                      # largest disparity that it gives
    step = 1                            # width of one of its pixels, in pixels of the full image

    [input]
    left = "left"                       # names in the model; TorchScript takes (left, right) in this order
    right = "right"
    colour = "rgb"                      # rgb, bgr or grey
    divisor = 255.0                     # values are divided by it, less the mean, then divided by the deviation
    mean = [0.485, 0.456, 0.406]
    deviation = [0.229, 0.224, 0.225]
    multiple = 32                       # heights and widths that it takes are multiples of it
    pad = "bottom right"                # where zeros are added for that: bottom right or top right

    [output]
    disparity = "disparity"             # name in the model
    factor = 1.0                        # pixels a unit, -1.0 where it gives them negative

Only `range_px` must be there; these are the defaults of the others, save for the mean (0) and the deviation (1).
"""

import dataclasses
import json
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from auditor.errors import SettingError
from auditor.evidence.descriptions import are_numbers, fields_of, is_name, is_whole, read_toml, refuse

_COLOURS = ("rgb", "bgr", "grey")
_CORNERS = ("bottom right", "top right")
_STEPS = (1, 2)

Image = NDArray[np.uint8]
Tensor = NDArray[np.float32]


@dataclass(frozen=True)
class Input:
    """What the model takes: (1, 3, H, W) float32, (1, 1, H, W) where it wants grey images."""

    left: str = "left"
    right: str = "right"
    colour: str = "rgb"
    divisor: float = 255.0
    mean: tuple[float, ...] = (0.0,)
    deviation: tuple[float, ...] = (1.0,)
    multiple: int = 1
    pad: str = "bottom right"


@dataclass(frozen=True)
class Output:
    """What the model gives: (H / step, W / step) disparities, any number of axes of length 1 before them."""

    disparity: str = "disparity"
    factor: float = 1.0


@dataclass(frozen=True)
class Description:
    """The TOML file beside a model."""

    range_px: int
    step: int = 1
    input: Input = field(default_factory=Input)
    output: Output = field(default_factory=Output)


@dataclass(frozen=True, eq=False)
class Model:
    """A loaded model: `run` maps two inputs to its output; `size` (H, W) is the only one it takes, None for any.

    `libraries` are the versions of what runs it, by name.
    """

    kind: str
    where: str
    sha256: str
    description: Description
    run: Callable[[Tensor, Tensor], NDArray[np.floating]]
    size: tuple[int, int] | None = None
    libraries: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class ModelMatcher:
    """A matcher made of a model and its description."""

    model: Model

    @property
    def name(self) -> str:
        """`onnx` or `torchscript`: which model it is stands in the settings."""
        return self.model.kind

    @property
    def settings(self) -> str:
        """Canonical JSON of the model's hash and its description."""
        values = dataclasses.asdict(self.model.description) | {"model_sha256": self.model.sha256}
        return json.dumps(values, sort_keys=True, separators=(",", ":"))

    @property
    def libraries(self) -> Mapping[str, str]:
        """Version of what runs the model, by name."""
        return self.model.libraries

    @property
    def range_px(self) -> int:
        """The largest disparity, as described."""
        return self.model.description.range_px

    @property
    def step(self) -> int:
        """Full-resolution pixels a pixel of the output, as described."""
        return self.model.description.step

    @property
    def colour(self) -> bool:
        """Whether the model wants colours, as described."""
        return self.model.description.input.colour != "grey"

    def match(self, left: Image, right: Image) -> Tensor:
        """Disparities (ceil(H / step), ceil(W / step)) in full-resolution pixels, NaN where the model gave no number.

        Raises SettingError where the images do not fit into the model or what it gives is not as described.
        """
        size = left.shape[:2]
        padding = self._padding(size)
        taken = self.model.description.input
        given = self.model.run(*(_padded(_normalised(image, taken), padding) for image in (left, right)))
        grid = tuple((length + sum(added)) // self.step for length, added in zip(size, padding, strict=True))
        if given.size != math.prod(grid) or given.shape[-2:] != grid:
            raise SettingError(
                f"the model gives {given.shape} where its description means {grid}",
                where=self.model.where,
                remedy="correct step, multiple or the output's name in the TOML file beside it",
            )
        top = padding[0][0]  # 0 where step is not 1
        rows, columns = (-(-length // self.step) for length in size)
        disparity = given.reshape(grid)[top : top + rows, :columns] * np.float32(self.model.description.output.factor)
        return np.where(np.isfinite(disparity), disparity, np.nan).astype(np.float32)

    def _padding(self, size: tuple[int, ...]) -> tuple[tuple[int, int], tuple[int, int]]:
        taken = self.model.description.input
        wanted = self.model.size or tuple(length + -length % taken.multiple for length in size)
        rows, columns = (whole - length for whole, length in zip(wanted, size, strict=True))
        if rows < 0 or columns < 0:
            raise SettingError(
                f"the model takes {wanted[0]} x {wanted[1]} pixels, the images have {size[0]} x {size[1]}",
                where=self.model.where,
                remedy="export it for larger images",
            )
        return ((rows, 0) if taken.pad == "top right" else (0, rows)), (0, columns)


def read_description(model: Path) -> Description:
    """The description beside a model: `model.toml` for `model.onnx`. Raises SettingError where it makes no sense."""
    path, table = read_toml(model, remedy="write one with at least: range_px = 192")
    values = fields_of(path, Description, table)
    if "range_px" not in values:
        raise SettingError("range_px, the largest disparity of the model, is missing", where=path)
    values |= {
        "input": Input(**fields_of(path, Input, table.get("input", {}))),
        "output": Output(**fields_of(path, Output, table.get("output", {}))),
    }
    description = Description(**values)
    refuse(path, _rules(description))
    return description


def _rules(description: Description) -> Iterator[tuple[str, bool, str]]:
    taken, given = description.input, description.output
    step = description.step if is_whole(description.step) else 0
    channels = (1,) if taken.colour == "grey" else (1, 3)
    corners = _CORNERS if step == 1 else _CORNERS[:1]
    yield "range_px", is_whole(description.range_px), "a whole number of pixels"
    yield "step", step in _STEPS, f"one of {_STEPS}"
    yield "input.left", is_name(taken.left), "a name"
    yield "input.right", is_name(taken.right), "a name"
    yield "input.colour", taken.colour in _COLOURS, f"one of {', '.join(_COLOURS)}"
    yield "input.divisor", are_numbers((taken.divisor,), (1,), positive=True), "a positive number"
    yield "input.mean", are_numbers(taken.mean, channels), "a list of one number, or of one a channel"
    yield (
        "input.deviation",
        are_numbers(taken.deviation, channels, positive=True),
        "a list like mean, of positive numbers",
    )
    yield "input.multiple", is_whole(taken.multiple) and taken.multiple % max(step, 1) == 0, "a multiple of step"
    yield "input.pad", taken.pad in corners, " or ".join(corners)
    yield "output.disparity", is_name(given.disparity), "a name"
    yield "output.factor", are_numbers((given.factor,), (1,)) and given.factor != 0, "a number other than 0"


def _normalised(image: Image, taken: Input) -> Tensor:
    """(1, C, H, W) from (H, W) grey or (H, W, 3) BGR."""
    pixels = np.atleast_3d(image)
    if taken.colour != "grey":
        pixels = np.broadcast_to(pixels, (*image.shape[:2], 3))
        pixels = pixels[..., ::-1] if taken.colour == "rgb" else pixels
    divisor, mean, deviation = (np.asarray(v, np.float32) for v in (taken.divisor, taken.mean, taken.deviation))
    normal = (pixels.astype(np.float32) / divisor - mean) / deviation
    return np.ascontiguousarray(normal.transpose(2, 0, 1)[np.newaxis])


def _padded(tensor: Tensor, padding: tuple[tuple[int, int], tuple[int, int]]) -> Tensor:
    return np.pad(tensor, ((0, 0), (0, 0), *padding))
