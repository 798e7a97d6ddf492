"""Models in ONNX files, run by onnxruntime. A file is not trusted: it holds no code but onnxruntime's own operators, no
library of custom ones is ever loaded, and what it fails at is an error of the user's.
"""

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import onnxruntime
from numpy.typing import NDArray
from onnxruntime.capi import onnxruntime_pybind11_state as errors

from auditor.errors import SettingError
from auditor.measurement.disparity.matchers.model_description import read_model_file, sha256
from auditor.safety.budget import MODEL, at_most

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


class OnnxModel:
    """A model that was read once: what is hashed is what is run.

    `inputs` are the names and shapes that it takes, where a length may be a name or None; `libraries` the version of
    what runs it. Raises SettingError where the file cannot be read or run, or the device is not there.
    """

    libraries: Mapping[str, str] = {"onnxruntime": onnxruntime.__version__}

    def __init__(self, path: Path, *, device: str = "cpu", threads: int = 1) -> None:
        self._path = path
        content = read_model_file(path)
        self.sha256 = sha256(content)
        self._session = _session(path, content, device, threads)
        self.inputs: dict[str, list[object]] = {entry.name: entry.shape for entry in self._session.get_inputs()}

    def check_names(self, inputs: Sequence[str], outputs: Sequence[str]) -> None:
        """Raises SettingError unless these are all inputs of the model and some of its outputs."""
        for side, there, named in (
            ("inputs", list(self.inputs), inputs),
            ("outputs", [entry.name for entry in self._session.get_outputs()], outputs),
        ):
            if set(named) - set(there) or (side == "inputs" and set(there) - set(named)):
                raise SettingError(
                    f"the model's {side} are {', '.join(there)}, its description names {', '.join(named)}",
                    where=self._path.with_suffix(".toml"),
                    remedy="use the model's names",
                )

    def run(self, outputs: Sequence[str], inputs: Mapping[str, NDArray[np.generic]]) -> list[NDArray[np.generic]]:
        """The named outputs. Raises SettingError where the model fails."""
        try:
            arrays: list[NDArray[np.generic]] = self._session.run(list(outputs), dict(inputs))
        except _UNREADABLE as error:
            shapes = ", ".join(str(values.shape) for values in inputs.values())
            raise SettingError(
                f"the model fails on {shapes} ({_line(error)})", where=self._path, remedy="correct its TOML file"
            ) from error
        return arrays


def _session(path: Path, content: bytes, device: str, threads: int) -> onnxruntime.InferenceSession:
    provider = _PROVIDERS.get(device)
    if provider not in onnxruntime.get_available_providers():
        raise SettingError(f"onnxruntime has no device {device!r}", where="--device", remedy="use --device cpu")
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.log_severity_level = _ERRORS_ONLY
    # A GPU's driver reserves more than it takes; on the CPU sparse tensors unpack here, and constants are computed.
    bounded = at_most(MODEL.bound(len(content))) if device == "cpu" else nullcontext()
    try:
        with bounded:
            return onnxruntime.InferenceSession(content, options, providers=[provider])
    except (MemoryError, *_UNREADABLE) as error:
        raise SettingError(
            f"no ONNX model that can be run ({_line(error)})", where=path, remedy="export it as one file"
        ) from error


def _line(error: Exception) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[0][:200]
