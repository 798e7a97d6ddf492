"""Networks and weights for the PSMNet tests: the rule of the golden weights, and one small enough to be quick."""

import math
import zlib

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auditor.measurement.disparity.matchers.psmnet.network import PSMNet

torch.set_num_threads(1)  # tests run side by side, and threads that wait for one another on a busy machine cost seconds

SMALL = {"max_disparity": 32, "width": 4}


def ruled_state(width: int = 32) -> dict[str, Tensor]:
    """Weights drawn by a rule from their own names, so that any implementation can make the same."""
    network = PSMNet(max_disparity=192, align_corners=True, width=width)
    return {name: _ruled(name, tensor) for name, tensor in network.state_dict().items()}


def _ruled(name: str, tensor: Tensor) -> Tensor:
    shape = tuple(tensor.shape)
    rng = np.random.default_rng(zlib.crc32(name.encode()))
    if name.endswith("num_batches_tracked"):
        return tensor
    if name.endswith("running_var") or (name.endswith("weight") and len(shape) == 1):
        values = rng.uniform(0.5, 1.5, shape)
    elif name.endswith(("running_mean", "bias")):
        values = rng.normal(0, 0.1, shape)
    else:
        values = rng.normal(0, math.sqrt(0.7 / math.prod(shape[1:])), shape)
    return torch.from_numpy(values.astype(np.float32))


def noise(height: int, width: int, seed: int = 0) -> NDArray[np.uint8]:
    """A colour image (H, W, 3) of noise."""
    return np.random.default_rng(seed).integers(0, 256, (height, width, 3)).astype(np.uint8)
