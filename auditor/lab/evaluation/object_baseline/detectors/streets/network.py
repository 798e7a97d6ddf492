"""The network of both detectors: a map of how sure it is of an object's middle, and the numbers of its box."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path

import numpy as np
import torch
from safetensors.torch import load, save
from torch import Tensor, nn
from torch.nn import functional

from auditor.errors import SettingError
from auditor.lab.evaluation.object_baseline.detectors.interface import CAR
from auditor.model.arrays import Floats, Floats32
from auditor.model.canonical import canonical_json

STRIDE = 4
"""Pixels (or cells) of the input to one of the map, each way."""

MULTIPLE = 32
"""Height and width of the input are multiples of this."""

_WIDTH = 12
MOST_OBJECTS = 100
LEAST_SCORE = 0.1
"""Objects less sure than this are left out."""

MOST_OVERLAP = 0.3
"""Of two objects that overlap more than this the surer one stays."""

_LEVELS = (2, 4, 4, 4)
_RARE = -4.0
"""The logit of an object's middle at the beginning of a training: there is hardly ever one."""


def _conv(inputs: int, outputs: int, stride: int = 1) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, 3, stride, 1, bias=False), nn.BatchNorm2d(outputs), nn.ReLU(inplace=True)
    )


class CentreNet(nn.Module):
    """Halves the input five times and comes back to a quarter of it; (N, C, H, W) to (N, 1 + numbers, H / 4, W / 4).

    The first channel is the logit of an object's middle (Zhou et al., Objects as Points, 2019).
    """

    def __init__(self, channels: int, numbers: int) -> None:
        super().__init__()
        sizes = [_WIDTH, *(_WIDTH * times for times in _LEVELS)]
        self.first = nn.Sequential(_conv(channels, _WIDTH, 2), _conv(_WIDTH, _WIDTH))
        self.down = nn.ModuleList(
            nn.Sequential(_conv(fine, coarse, 2), _conv(coarse, coarse), _conv(coarse, coarse))
            for fine, coarse in pairwise(sizes)
        )
        self.up = nn.ModuleList(_conv(coarse + fine, fine) for fine, coarse in pairwise(sizes[1:]))
        self.heads = nn.Sequential(_conv(sizes[1], sizes[1]), nn.Conv2d(sizes[1], 1 + numbers, 1))
        last = self.heads[-1]
        assert isinstance(last, nn.Conv2d)
        assert last.bias is not None
        nn.init.constant_(last.bias[:1], _RARE)

    def forward(self, shown: Tensor) -> Tensor:
        """The map of some inputs."""
        levels = [self.first(shown)]
        for down in self.down:
            levels.append(down(levels[-1]))
        coarse = levels.pop()
        for up in reversed(self.up):
            fine = levels.pop()
            coarse = up(torch.cat([functional.interpolate(coarse, scale_factor=2.0), fine], dim=1))
        answer: Tensor = self.heads(coarse)
        return answer


@dataclass(frozen=True, eq=False)
class TrainedNetwork:
    """A network and the hash of the file that its weights are from."""

    network: CentreNet
    sha256: str

    def peaks(self, shown: Floats32) -> tuple[Floats, Floats]:
        """Of a (C, H, W) input the (M, 3) score, row and column of objects' middles, and the (M, numbers) there."""
        with torch.inference_mode():
            answer = self.network(torch.from_numpy(shown)[None])[0]
            heat = answer[0].sigmoid()
            highest = functional.max_pool2d(heat[None, None], 3, 1, 1)[0, 0]
            row, column = torch.nonzero((heat == highest) & (heat >= LEAST_SCORE), as_tuple=True)
            order = torch.argsort(heat[row, column], descending=True, stable=True)[:MOST_OBJECTS]
            row, column = row[order], column[order]
            places = torch.stack([heat[row, column], row.float(), column.float()], dim=1)
            numbers = answer[1:, row, column].T
        return places.numpy().astype(np.float64), numpy_of(numbers)


@dataclass(frozen=True, eq=False)
class StreetDetector:
    """What both detectors are: a trained network that finds cars."""

    trained: TrainedNetwork
    name: str = "streets"
    labels: frozenset[str] = frozenset({CAR})

    @property
    def settings(self) -> str:
        """Canonical JSON of all that can change a box."""
        given = {"sha256": self.trained.sha256, "least_score": LEAST_SCORE, "most_overlap": MOST_OVERLAP}
        return canonical_json(given)

    @property
    def libraries(self) -> Mapping[str, str]:
        """Versions of the libraries that run it, by name."""
        return {"torch": version("torch")}


def numpy_of(numbers: Tensor) -> Floats:
    """Their values in float64."""
    return numbers.numpy().astype(np.float64)


def packed(network: CentreNet) -> bytes:
    """The weights in fp16, as a file of safetensors."""
    return save({name: values.half().contiguous() for name, values in network.state_dict().items()})


def unpacked(network: CentreNet, file: Path, sha256: str | None = None) -> TrainedNetwork:
    """A network with the weights of a file. Raises SettingError where it cannot be read, or was changed."""
    try:
        content = file.read_bytes()
    except OSError as error:
        raise SettingError(error.strerror or str(error), where=file, remedy="install auditor again") from error
    digest = hashlib.sha256(content).hexdigest()
    if sha256 is not None and digest != sha256:
        raise SettingError("these are not the weights that come with auditor", where=file, remedy="install it again")
    torch.set_num_threads(1)  # as everything else that an evaluation's processes run: they share the cores
    state = network.state_dict()
    network.load_state_dict({name: values.to(state[name].dtype) for name, values in load(content).items()})
    return TrainedNetwork(network.eval(), digest)
