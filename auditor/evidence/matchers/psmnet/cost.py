"""What PSMNet will cost, told before the first frame is matched."""

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter

import numpy as np
import torch

from auditor.evidence.matchers.psmnet.matcher import PsmnetMatcher

_PROBE_PX = (128, 256)
_ROUNDS = 2


@dataclass(frozen=True)
class Cost:
    """Seconds that the features of one image and the comparison of one pair take on this machine."""

    seconds_per_image: float
    seconds_per_pair: float
    device: str
    threads: int

    def frame_s(self, images: int, pairs: int) -> float:
        """Seconds for a frame of so many images, each looked at once, compared in so many pairs."""
        return images * self.seconds_per_image + pairs * self.seconds_per_pair


def frame_cost(matcher: PsmnetMatcher, size: tuple[int, int]) -> Cost:
    """The cost for images of `size` (H, W), from a small image measured on the spot and scaled by the pixels.

    Both parts of the network take time in proportion to the pixels; measuring takes about a second on a CPU.
    """
    scale = size[0] * size[1] / matcher.step**2 / (_PROBE_PX[0] * _PROBE_PX[1])
    image = np.zeros((*_PROBE_PX, 3), dtype=np.uint8)
    engine = matcher.engine
    features = engine.features([image])
    return Cost(
        scale * _seconds(lambda: engine.features([image]).cpu()),  # .cpu() waits for a GPU to have finished
        scale * _seconds(lambda: engine.disparities(features, features, _PROBE_PX)),
        str(engine.device),
        torch.get_num_threads(),
    )


def _seconds(work: Callable[[], object]) -> float:
    """The best of a few rounds: the first one also pays for setting up."""
    rounds = []
    for _ in range(_ROUNDS):
        started = perf_counter()
        work()
        rounds.append(perf_counter() - started)
    return min(rounds)
