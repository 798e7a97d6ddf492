"""Stereo networks in ONNX files."""

from pathlib import Path
from typing import cast

from auditor.errors import SettingError
from auditor.measurement.disparity.matchers.onnx_models import OnnxModel
from auditor.measurement.disparity.matchers.own_networks import Input, Model, ModelMatcher, Tensor, read_description


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
