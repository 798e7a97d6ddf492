"""Weights from untrusted files: read without running anything, checked name by name, hashed."""

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from auditor.errors import SettingError
from auditor.measurement.disparity.matchers.psmnet.network import MULTIPLE, PUBLISHED_WIDTH, PSMNet
from auditor.measurement.disparity.matchers.psmnet.safe_checkpoint import (
    METADATA,
    WeightsFile,
    no_safetensors,
    read_weights_file,
)
from auditor.model.text import first_few

DEFAULT_MAX_DISPARITY = 192
"""That of the published code (Chang and Chen, PSMNet, CVPR 2018)."""

_WIDTHS = range(1, 257)
_FIRST = "feature_extraction.firstconv.0.0.weight"
_COUNTER = "num_batches_tracked"  # no disparity depends on it, and checkpoints of 2018 lack it
_SHOWN = 6
_NAME_LENGTH = 100


@dataclass(frozen=True, eq=False)
class Weights:
    """The parameters of one network, complete and finite, in float32.

    `sha256` is of the names, shapes and values, so that it stays the same whatever file format holds them.
    `align_corners` and `max_disparity` are None where the file does not say them. A network with `step` 2 sees images
    at half resolution, one without `colour` sees grey ones; the published networks do neither. `max_disparity` is in
    full-resolution pixels. `layout` is the format of the file.
    """

    state: Mapping[str, Tensor]
    width: int
    sha256: str
    align_corners: bool | None
    max_disparity: int | None
    where: str
    step: int = 1
    colour: bool = True
    layout: str = ""


@dataclass(frozen=True)
class WeightsReport:
    """What a file of weights holds, fit or not: `problems` is empty where it can be used."""

    path: Path
    layout: str
    file_bytes: int
    file_sha256: str
    weights_sha256: str | None
    tensors: int
    parameters: int
    width: int
    align_corners: bool | None
    max_disparity: int | None
    step: int
    colour: bool
    left_aside: tuple[str, ...]
    missing: tuple[str, ...]
    unexpected: tuple[str, ...]
    problems: tuple[str, ...]


def load_weights(path: Path, *, file_sha256: str | None = None) -> Weights:
    """The weights in a .tar, .pth or .pt file of torch or a .safetensors file, with or without the prefix `module.`.

    Nothing in the file is run: torch reads with `weights_only=True`, and there is no other way. Optimiser state,
    losses and whatever else training left beside the parameters are ignored. Raises SettingError where the file
    cannot be read safely or has not the SHA-256 that it must have, and with the missing and unexpected names where it
    holds another network.
    """
    file = read_weights_file(path, file_sha256=file_sha256)
    problems = _problems(file)
    if problems:
        raise SettingError("; ".join(problems), where=path, remedy="use weights of the stacked-hourglass PSMNet")
    return _weights(path, file)


def inspect_weights(path: Path) -> WeightsReport:
    """What a file of weights holds, also where it does not fit. Raises SettingError where it cannot be read safely."""
    file = read_weights_file(path)
    problems = _problems(file)
    missing, unexpected = _names(file)
    return WeightsReport(
        path=path,
        layout=file.layout,
        file_bytes=len(file.content),
        file_sha256=hashlib.sha256(file.content).hexdigest(),
        weights_sha256=None if problems else _weights(path, file).sha256,
        tensors=len(file.tensors),
        parameters=sum(t.numel() for name, t in file.tensors.items() if not _is_buffer(name)),
        width=_width(file.tensors),
        align_corners=_align_corners(file.metadata),
        max_disparity=_max_disparity(file.metadata),
        step=_step(file.metadata),
        colour=_colour(file.metadata),
        left_aside=file.left_aside,
        missing=missing,
        unexpected=unexpected,
        problems=problems,
    )


def convert_weights(
    source: Path, target: Path, *, align_corners: bool | None = None, max_disparity: int | None = None
) -> Weights:
    """Write the weights of any readable file as safetensors, a format that cannot hold code, with what they need.

    The new file says `align_corners` and the largest disparity, so that they need not be given again. Returns the
    weights as written. Raises SettingError as `load_weights` and `settle` do, and where `target` exists.
    """
    weights = load_weights(source)
    align_corners, max_disparity = settle(weights, align_corners=align_corners, max_disparity=max_disparity)
    if target.suffix != ".safetensors":
        raise SettingError("converted weights are safetensors", where=target, remedy="name it OUT.safetensors")
    if target.exists():
        raise SettingError("a file of that name exists", where=target, remedy="name another one")
    try:
        from safetensors.torch import save  # noqa: PLC0415 - it belongs to the extra, and only two functions need it
    except ModuleNotFoundError as error:
        raise no_safetensors(target) from error
    metadata = {
        "format": "pt",
        METADATA: json.dumps(
            {
                "align_corners": align_corners,
                "max_disparity": max_disparity,
                "step": weights.step,
                "colour": weights.colour,
            },
            sort_keys=True,
        ),
    }
    beside = target.with_name(target.name + ".part")
    try:
        beside.write_bytes(save(dict(weights.state), metadata))
        os.replace(beside, target)  # noqa: PTH105 - the same in one step on every platform
    except OSError as error:
        raise SettingError(error.strerror or str(error), where=target, remedy="choose another place") from error
    return load_weights(target)


def settle(weights: Weights, *, align_corners: bool | None, max_disparity: int | None) -> tuple[bool, int]:
    """The upsampling convention and the largest disparity in pixels, from the user's options and the file's metadata.

    With the wrong convention nothing fails and every disparity is a little off, so there is no default. Raises
    SettingError where neither has the convention, where file and user differ, or where the range is no multiple of 16
    of the network's pixels.
    """
    if align_corners is None and weights.align_corners is None:
        raise SettingError(
            "the file does not say which upsampling its network was trained with",
            where=weights.where,
            remedy="give --align-corners (checkpoints of 2018: KITTI 2012, KITTI 2015, first Scene Flow) or "
            "--no-align-corners (Scene Flow of 2021)",
        )
    if None not in (align_corners, weights.align_corners) and align_corners != weights.align_corners:
        raise SettingError(
            f"the file says align_corners={weights.align_corners}, the command {align_corners}",
            where=weights.where,
            remedy="leave the option out, or convert the original file again",
        )
    range_px = max_disparity or weights.max_disparity or DEFAULT_MAX_DISPARITY
    multiple = MULTIPLE * weights.step
    if range_px < multiple or range_px % multiple:
        raise SettingError(
            f"{range_px} px is not a disparity range of PSMNet",
            where="--max-disparity",
            remedy=f"use a multiple of {multiple}",
        )
    return bool(weights.align_corners if align_corners is None else align_corners), range_px


def content_sha256(state: Mapping[str, Tensor]) -> str:
    """The SHA-256 of all names, shapes and float32 values that a disparity depends on, in the order of the names."""
    digest = hashlib.sha256()
    for name in sorted(state):
        if not name.endswith(_COUNTER):
            digest.update(f"{name} {tuple(state[name].shape)}\n".encode())
            digest.update(state[name].contiguous().numpy().astype("<f4").tobytes())
    return digest.hexdigest()


def _weights(path: Path, file: WeightsFile) -> Weights:
    width = _width(file.tensors)
    state = {
        name: file.tensors[name].float().contiguous() if name in file.tensors else torch.zeros((), dtype=torch.int64)
        for name in _shapes(width)
    }
    align_corners, max_disparity = _align_corners(file.metadata), _max_disparity(file.metadata)
    metadata = file.metadata
    return Weights(
        state,
        width,
        content_sha256(state),
        align_corners,
        max_disparity,
        str(path),
        _step(metadata),
        _colour(metadata),
        file.layout,
    )


def _problems(file: WeightsFile) -> tuple[str, ...]:
    missing, unexpected = _names(file)
    problems = []
    if missing:
        problems.append(f"{len(missing)} missing: {_some(missing)}")
    if unexpected:
        problems.append(f"{len(unexpected)} unexpected: {_some(unexpected)}")
    shapes = _shapes(_width(file.tensors))
    names = [name for name in file.tensors if name in shapes]
    stored = {name: tuple(file.tensors[name].shape) for name in names}
    wrong = [f"{name} {stored[name]} for {shapes[name]}" for name in names if stored[name] != shapes[name]]
    if wrong:
        problems.append(f"{len(wrong)} of another shape: {_some(wrong)}")
    elif odd := [name for name in names if not _plain(file.tensors[name])]:
        problems.append(f"{len(odd)} are no plain finite numbers: {_some(odd)}")
    return tuple(problems)


def _plain(tensor: Tensor) -> bool:
    plain = tensor.layout == torch.strided and not tensor.is_quantized and tensor.device.type == "cpu"
    return plain and not tensor.is_complex() and bool(torch.isfinite(tensor.float()).all())


def _names(file: WeightsFile) -> tuple[tuple[str, ...], tuple[str, ...]]:
    shapes = _shapes(_width(file.tensors))
    missing = tuple(name for name in shapes if name not in file.tensors and not name.endswith(_COUNTER))
    return missing, tuple(name for name in file.tensors if name not in shapes)


def _width(tensors: Mapping[str, Tensor]) -> int:
    first = tensors.get(_FIRST)
    return first.shape[0] if first is not None and first.dim() > 0 and first.shape[0] in _WIDTHS else PUBLISHED_WIDTH


def _shapes(width: int) -> dict[str, tuple[int, ...]]:
    with torch.device("meta"):
        network = PSMNet(max_disparity=DEFAULT_MAX_DISPARITY, align_corners=True, width=width)
    return {name: tuple(tensor.shape) for name, tensor in network.state_dict().items()}


def _is_buffer(name: str) -> bool:
    return name.endswith((_COUNTER, "running_mean", "running_var"))


def _align_corners(metadata: Mapping[str, Any]) -> bool | None:
    value = metadata.get("align_corners")
    return value if isinstance(value, bool) else None


def _max_disparity(metadata: Mapping[str, Any]) -> int | None:
    value = metadata.get("max_disparity")
    return value if isinstance(value, int) and not isinstance(value, bool) else None


def _step(metadata: Mapping[str, Any]) -> int:
    return 2 if metadata.get("step") == 2 else 1


def _colour(metadata: Mapping[str, Any]) -> bool:
    return metadata.get("colour") is not False


def _some(names: tuple[str, ...] | list[str]) -> str:
    # A name is the file's own text: one line of it, and not a long one.
    shown = [name[:_NAME_LENGTH] if name.isprintable() else ascii(name[:_NAME_LENGTH]) for name in names]
    return first_few(shown, _SHOWN)


SHIPPED = Path(__file__).with_name("streets_half_resolution_fp16.safetensors")
SHIPPED_SHA256 = "db9bf300fcad8032343af280728e539e221a462974593a5aee2f27f8024d7fd5"


def shipped_weights() -> Weights:
    """The weights for grey images at half resolution; raises SettingError where the file is missing or was changed."""
    return load_weights(SHIPPED, file_sha256=SHIPPED_SHA256)
