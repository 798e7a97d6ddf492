"""Stereo networks in TorchScript files, run by torch.

A TorchScript file is a program: unlike weights and unlike ONNX it must come from a trusted source.
"""

import io
import warnings
from pathlib import Path

import torch

from auditor.errors import SettingError
from auditor.measurement.disparity.matchers.model_description import read_model_file, sha256
from auditor.measurement.disparity.matchers.own_networks import Model, ModelMatcher, Tensor, read_description


def open_torchscript(path: Path, *, device: str = "cpu", threads: int = 1) -> ModelMatcher:
    """The matcher `torchscript:FILE`: a program (left, right) -> disparity, described by the TOML file beside it.

    Raises SettingError where either file cannot be used or the device is not there.
    """
    description = read_description(path)
    content = read_model_file(path)
    if device != "cpu" and not (device == "cuda" and torch.cuda.is_available()):
        raise SettingError(f"there is no device {device!r}", where="--device", remedy="use --device cpu")
    torch.set_num_threads(threads)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # it is how such files are run as long as they exist
            program = torch.jit.load(io.BytesIO(content), map_location=device).eval()  # type: ignore[no-untyped-call]
    except (RuntimeError, ValueError) as error:
        raise SettingError("no TorchScript program", where=path, remedy="save one with torch.jit.save") from error

    def run(left: Tensor, right: Tensor) -> Tensor:
        try:
            with torch.inference_mode():
                found = program(*(torch.from_numpy(image).to(device) for image in (left, right)))
        except RuntimeError as error:
            line = str(error).strip().splitlines()[-1][:200]
            raise SettingError(f"the program fails on {left.shape} ({line})", where=path) from error
        if not isinstance(found, torch.Tensor):
            raise SettingError(f"the program gives a {type(found).__name__}, not one disparity map", where=path)
        disparity: Tensor = found.float().cpu().numpy()
        return disparity

    return ModelMatcher(
        Model("torchscript", str(path), sha256(content), description, run, libraries={"torch": torch.__version__})
    )
