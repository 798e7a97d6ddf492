"""Stereo networks of the user's own: a TOML file beside the model describes what they take and give.

    # crestereo.toml, beside crestereo.onnx
    range_px = 192                      # largest disparity that it gives
    step = 1                            # width of one of its pixels, in pixels of the full image

    [input]
    left = "left"                       # names in the model
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

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, cast

import numpy as np
from numpy.typing import NDArray

from auditor.errors import SettingError
from auditor.measurement.disparity.matchers.model_description import (
    NAME,
    NUMBER,
    ModelTable,
    Pixels,
    Rule,
    described,
    one_of,
    read_toml,
    whole,
)
from auditor.measurement.disparity.matchers.onnx_models import OnnxModel

Image = NDArray[np.uint8]
Tensor = NDArray[np.float32]

_FACTOR = Rule(lambda value: NUMBER.holds(value) and value != 0, "a number other than 0")


@dataclass(frozen=True)
class Input(Pixels):
    """What the model takes: (1, 3, H, W) float32, (1, 1, H, W) where it wants grey images."""

    left: Annotated[str, NAME] = "left"
    right: Annotated[str, NAME] = "right"
    multiple: Annotated[int, whole("a multiple of step")] = 1
    pad: Annotated[str, one_of("bottom right", "top right")] = "bottom right"


@dataclass(frozen=True)
class NetworkOutput(ModelTable):
    """What the model gives: (H / step, W / step) disparities, any number of axes of length 1 before them."""

    disparity: Annotated[str, NAME] = "disparity"
    factor: Annotated[float, _FACTOR] = 1.0


@dataclass(frozen=True)
class NetworkDescription(ModelTable):
    """The TOML file beside a model."""

    range_px: Annotated[int, whole("the largest disparity of the model, in pixels")] = 0
    step: Annotated[int, whole("one of 1 and 2", largest=2)] = 1
    input: Input = field(default_factory=Input)
    output: NetworkOutput = field(default_factory=NetworkOutput)

    def rules(self) -> Iterator[tuple[str, bool, str]]:
        """A step of 2 takes whole pairs of pixels, and begins at the first."""
        yield "input.multiple", self.input.multiple % self.step == 0, "a multiple of step"
        yield "input.pad", self.step == 1 or self.input.pad == "bottom right", "bottom right where step is not 1"


@dataclass(frozen=True, eq=False)
class Model:
    """A loaded model: `run` maps two inputs to its output; `size` (H, W) is the only one it takes, None for any.

    `libraries` are the versions of what runs it, by name.
    """

    kind: str
    where: str
    sha256: str
    description: NetworkDescription
    run: Callable[[Tensor, Tensor], NDArray[np.floating]]
    size: tuple[int, int] | None = None
    libraries: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class ModelMatcher:
    """A matcher made of a model and its description."""

    model: Model

    @property
    def name(self) -> str:
        """`onnx`: which model it is stands in the settings."""
        return self.model.kind

    @property
    def settings(self) -> str:
        """Canonical JSON of the model's hash and its description."""
        return self.model.description.settings(self.model.sha256)

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
        given = self.model.run(*(_tensor(image, taken, padding) for image in (left, right)))
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


def read_description(model: Path) -> NetworkDescription:
    """The description beside a model: `model.toml` for `model.onnx`. Raises SettingError where it makes no sense."""
    path, table = read_toml(model, remedy="write one with at least: range_px = 192")
    return described(path, NetworkDescription, table, {"input": Input, "output": NetworkOutput})


def _tensor(image: Image, taken: Input, padding: tuple[tuple[int, int], tuple[int, int]]) -> Tensor:
    """(1, C, H, W) as the model takes it, zeros around it."""
    normal = taken.normalised(taken.channels(image)).transpose(2, 0, 1)[np.newaxis]
    return np.pad(np.ascontiguousarray(normal), ((0, 0), (0, 0), *padding))


def open_onnx(path: Path, *, device: str = "cpu", threads: int = 1) -> ModelMatcher:
    """The matcher `onnx:FILE`: the model in one ONNX file, described by the TOML file beside it.

    Raises SettingError where either file cannot be used, they disagree, or the device is not there.
    """
    description = read_description(path)
    model = OnnxModel(path, device=device, threads=threads)
    taken, given = description.input, description.output
    model.check_names([taken.left, taken.right], [given.disparity])

    def run(left: Tensor, right: Tensor) -> Tensor:
        (disparity,) = model.run([given.disparity], {taken.left: left, taken.right: right})
        return cast(Tensor, disparity)

    size = _size(path, taken, model)
    return ModelMatcher(Model("onnx", str(path), model.sha256, description, run, size, model.libraries))


def _size(path: Path, taken: Input, model: OnnxModel) -> tuple[int, int] | None:
    """The one size (H, W) that the model takes, None where it takes any."""
    shape = model.inputs[taken.left]
    if len(shape) != 4:
        raise SettingError(f"the model takes {shape}, not images (1, C, H, W)", where=path)
    height, width = shape[2:]
    return (height, width) if isinstance(height, int) and isinstance(width, int) else None
