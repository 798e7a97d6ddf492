"""Untrusted files of weights, read without running anything that they hold.

`torch.load` alone would read a checkpoint. Without `weights_only` it runs what a pickle asks for, and with it refuses a
file whose training left numpy scalars or its arguments beside the weights. So it is called with `weights_only` and with
stand-ins that forget what they are given, and each refusal is one line.
"""

import hashlib
import io
import json
import pickle
import struct
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

from auditor.errors import SettingError
from auditor.safety.budget import CHECKPOINT, MAX_MODEL_BYTES
from auditor.safety.zips import UnsafeZipError, check_file

METADATA = "psmnet"
"""Entry of a file of our own that says how its network was trained."""

_PREFIX = "module."
_ZIP_MAGIC = b"PK"
_TRUSTED_WAY = (
    "where you trust it, save its state_dict alone with torch.save in the program that made it, "
    "or use a safetensors file"
)

# What a file of any content can make the two parsers raise.
_UNREADABLE = (
    pickle.UnpicklingError,
    struct.error,
    ArithmeticError,
    AssertionError,
    AttributeError,
    EOFError,
    LookupError,
    MemoryError,
    OSError,
    RuntimeError,
    TypeError,
    ValueError,
)


@dataclass(frozen=True, eq=False)
class WeightsFile:
    """What was found: tensors by name without the prefix, the file's own metadata, and what was not read."""

    layout: str
    content: bytes
    tensors: Mapping[str, Tensor]
    metadata: Mapping[str, object]
    left_aside: tuple[str, ...]


class _LeftAside:
    """Stands in for the numpy scalars and settings of a training run: whatever they are made of is dropped."""

    def __init__(self, *parts: object) -> None:
        """Take and forget the arguments that would have made the object."""

    def __setstate__(self, state: object) -> None:
        """Forget the state."""


_STAND_INS = [
    (_LeftAside, name)
    for name in (
        "numpy.core.multiarray.scalar",
        "numpy._core.multiarray.scalar",
        "numpy.core.multiarray._reconstruct",
        "numpy._core.multiarray._reconstruct",
        "numpy.dtype",
        "numpy.ndarray",
        "argparse.Namespace",
    )
]


def read_weights_file(path: Path, *, file_sha256: str | None = None) -> WeightsFile:
    """Read a safetensors file or one of torch, distinguished by their content, prefix `module.` or not.

    torch reads with `weights_only=True` and inert stand-ins for what training runs leave beside the parameters. Raises
    SettingError where the file is none of these or asks for anything else, and before anything in it is read where its
    SHA-256 is not `file_sha256`.
    """
    try:
        if path.stat().st_size > MAX_MODEL_BYTES:
            raise SettingError(f"over {MAX_MODEL_BYTES >> 30} GiB: these are no weights of PSMNet", where=path)
        content = path.read_bytes()  # once: what is hashed is what is loaded
    except OSError as error:
        raise SettingError(error.strerror or str(error), where=path, remedy="name a file of weights") from error
    if file_sha256 is not None and hashlib.sha256(content).hexdigest() != file_sha256:
        raise SettingError(
            "damaged or changed: these are not the weights that come with auditor",
            where=path,
            remedy="install auditor again, or name others with --weights",
        )
    if content[8:9] == b"{":
        return _read_safetensors(path, content)
    return _read_torch(path, content)


def _read_safetensors(path: Path, content: bytes) -> WeightsFile:
    try:
        from safetensors import SafetensorError  # noqa: PLC0415 - it belongs to the extra
        from safetensors.torch import load  # noqa: PLC0415
    except ModuleNotFoundError as error:
        raise no_safetensors(path) from error
    try:
        tensors = load(content)
        header = json.loads(content[8 : 8 + int.from_bytes(content[:8], "little")])
        metadata = json.loads(header.get("__metadata__", {}).get(METADATA, "{}"))
    except (SafetensorError, *_UNREADABLE) as error:
        raise SettingError(f"no readable safetensors file ({_line(error)})", where=path) from error
    return WeightsFile("safetensors", content, _unprefixed(tensors), metadata if isinstance(metadata, dict) else {}, ())


def load_safely(path: Path, content: bytes) -> object:
    """What torch saved in these bytes of `path`.

    Raises SettingError where loading would run anything of it, or where it would unpack to too much.
    """
    try:
        if content[:2] == _ZIP_MAGIC:
            check_file(io.BytesIO(content), CHECKPOINT)  # torch allocates what the directory declares, and no more
        with warnings.catch_warnings(), torch.serialization.safe_globals(list(_STAND_INS)):
            warnings.simplefilter("ignore")  # of old pickle protocols and storages: what matters is checked below
            return torch.load(io.BytesIO(content), map_location="cpu", weights_only=True)
    except UnsafeZipError as error:
        raise SettingError(f"no weights that can be read safely: {error}", where=path, remedy=_TRUSTED_WAY) from error
    except _UNREADABLE as error:
        raise SettingError(_refusal(error), where=path, remedy=_TRUSTED_WAY) from error


def _read_torch(path: Path, content: bytes) -> WeightsFile:
    loaded = load_safely(path, content)
    if not isinstance(loaded, dict):
        raise SettingError(f"holds a {type(loaded).__name__} where a state dict is expected", where=path)
    state = loaded.get("state_dict", loaded)
    if not isinstance(state, dict):
        raise SettingError(f"its state_dict is a {type(state).__name__}", where=path)
    tensors = {str(name): value for name, value in state.items() if isinstance(value, Tensor)}
    aside = [str(name) for name in (*loaded, *state) if name != "state_dict" and str(name) not in tensors]
    metadata = loaded.get(METADATA)
    layout = "torch zip" if content[:2] == _ZIP_MAGIC else "torch legacy"
    return WeightsFile(
        layout,
        content,
        _unprefixed(tensors),
        metadata if isinstance(metadata, dict) else {},
        tuple(dict.fromkeys(aside)),
    )


def _refusal(error: BaseException) -> str:
    text = str(error)
    for mark in ("Unsupported global: GLOBAL ", "Trying to load unsupported GLOBAL "):
        if mark in text:
            name = text.split(mark, 1)[1].split(" ", 1)[0]
            return f"refused, nothing of it was run: its pickle asks for {name!r}, which weights do not need"
    if "TorchScript" in text:
        return "a TorchScript program, not weights: export the network to ONNX, and name it as onnx:FILE"
    return f"no weights that can be read safely ({_line(error)})"


def _line(error: BaseException) -> str:
    """The last sentence of torch's many, where it says the reason."""
    text = str(error).strip()
    if "WeightsUnpickler error:" in text:
        text = text.split("WeightsUnpickler error:", 1)[1].strip()
    return (text.splitlines() or [type(error).__name__])[0][:200]


def _unprefixed(tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    if tensors and all(name.startswith(_PREFIX) for name in tensors):
        return {name.removeprefix(_PREFIX): tensor for name, tensor in tensors.items()}
    return dict(tensors)


def no_safetensors(path: Path) -> SettingError:
    """The error to raise where the package is needed and not there."""
    return SettingError("the package safetensors is not installed", where=path, remedy="pip install 'auditor[psmnet]'")
