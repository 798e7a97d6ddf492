"""Stereo networks in ONNX files, run by onnxruntime."""

from pathlib import Path

import onnxruntime
from onnxruntime.capi import onnxruntime_pybind11_state as errors

from auditor.errors import SettingError
from auditor.evidence.matchers.described import (
    Input,
    Model,
    ModelMatcher,
    Tensor,
    read_description,
    read_model_file,
    sha256,
)

_UNREADABLE = (
    errors.Fail,
    errors.InvalidArgument,
    errors.InvalidGraph,
    errors.InvalidProtobuf,
    errors.NotImplemented,
    errors.RuntimeException,
)
_PROVIDERS = {"cpu": "CPUExecutionProvider", "cuda": "CUDAExecutionProvider"}
_ERRORS_ONLY = 3


def open_onnx(path: Path, *, device: str = "cpu", threads: int = 1) -> ModelMatcher:
    """The matcher `onnx:FILE`: the model in one ONNX file, described by the TOML file beside it.

    A file of ONNX holds no code but operators of onnxruntime; no library of custom ones is ever loaded. Raises
    SettingError where either file cannot be used, they disagree, or the device is not there.
    """
    description = read_description(path)
    content = read_model_file(path)  # once: what is hashed is what is run
    session = _session(path, content, device, threads)
    shapes = {entry.name: entry.shape for entry in session.get_inputs()}
    taken = description.input
    _check_names(path, "inputs", list(shapes), [taken.left, taken.right])
    _check_names(path, "outputs", [entry.name for entry in session.get_outputs()], [description.output.disparity])

    def run(left: Tensor, right: Tensor) -> Tensor:
        try:
            (found,) = session.run([description.output.disparity], {taken.left: left, taken.right: right})
        except _UNREADABLE as error:
            raise SettingError(
                f"the model fails on {left.shape} ({_line(error)})", where=path, remedy="correct its TOML file"
            ) from error
        disparity: Tensor = found
        return disparity

    return ModelMatcher(Model("onnx", str(path), sha256(content), description, run, _size(path, taken, shapes)))


def _session(path: Path, content: bytes, device: str, threads: int) -> onnxruntime.InferenceSession:
    provider = _PROVIDERS.get(device)
    if provider not in onnxruntime.get_available_providers():
        raise SettingError(f"onnxruntime has no device {device!r}", where="--device", remedy="use --device cpu")
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.log_severity_level = _ERRORS_ONLY
    try:
        return onnxruntime.InferenceSession(content, options, providers=[provider])
    except _UNREADABLE as error:
        raise SettingError(
            f"no ONNX model that can be run ({_line(error)})", where=path, remedy="export it as one file"
        ) from error


def _check_names(path: Path, what: str, there: list[str], named: list[str]) -> None:
    if set(named) - set(there) or (what == "inputs" and set(there) - set(named)):
        raise SettingError(
            f"the model's {what} are {', '.join(there)}, its description names {', '.join(named)}",
            where=path.with_suffix(".toml"),
            remedy="use the model's names",
        )


def _size(path: Path, taken: Input, shapes: dict[str, list[object]]) -> tuple[int, int] | None:
    """The one size (H, W) that the model takes, None where it takes any."""
    shape = shapes[taken.left]
    if len(shape) != 4:
        raise SettingError(f"the model takes {shape}, not images (1, C, H, W)", where=path)
    height, width = shape[2:]
    return (height, width) if isinstance(height, int) and isinstance(width, int) else None


def _line(error: Exception) -> str:
    return str(error).strip().splitlines()[0][:200]
