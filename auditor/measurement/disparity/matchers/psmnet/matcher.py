"""PSMNet as a stereo matcher: dense, without a single pixel left out."""

from collections.abc import Callable, Sequence
from importlib.metadata import version
from typing import TypeVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auditor.errors import SettingError
from auditor.measurement.disparity.matchers.interface import MatcherOptions
from auditor.measurement.disparity.matchers.psmnet.inference import PRECISIONS, make_engine, seen
from auditor.measurement.disparity.matchers.psmnet.weights import Weights, load_weights, settle, shipped_weights
from auditor.model.canonical import canonical_json

_LARGEST_BATCH = 16

Image = NDArray[np.uint8]
Disparity = NDArray[np.float32]
Result = TypeVar("Result")


class PsmnetMatcher:
    """Matches images (H, W, 3) BGR or (H, W) grey; every pixel gets a disparity.

    `step` and `colour` are those that the weights were trained for: full resolution and colour in published ones.

    Two networks with the same weights, convention, range and precision have the same `settings`, on any device. On a
    GPU pairs go through in batches of at most `batch`, which is halved for good whenever the memory does not suffice;
    on the CPU one by one.
    """

    name = "psmnet"

    def __init__(
        self,
        weights: Weights,
        *,
        align_corners: bool | None = None,
        max_disparity: int | None = None,
        device: str = "cpu",
        precision: str = "fp32",
        batch: int = _LARGEST_BATCH,
        compiled: bool = False,
    ) -> None:
        """Raises SettingError for a missing convention, a device that does not exist, an unknown precision."""
        self.align_corners, self.range_px = settle(weights, align_corners=align_corners, max_disparity=max_disparity)
        self.step, self.colour = weights.step, weights.colour
        self._weights = weights
        self.precision = precision
        place = _device(device, precision)
        self.batch = batch if place.type == "cuda" else 1
        self.engine = make_engine(
            weights,
            align_corners=self.align_corners,
            max_disparity=self.range_px // self.step,
            device=place,
            precision=precision,
            compiled=compiled,
        )

    @property
    def pairs_at_once(self) -> int:
        """How many pairs go through together: as many as the memory has allowed so far, 1 on the CPU."""
        return self.batch

    @property
    def libraries(self) -> dict[str, str]:
        """The version of torch, and of safetensors where that read the weights."""
        reader = {"safetensors": version("safetensors")} if self._weights.layout == "safetensors" else {}
        return {"torch": torch.__version__, **reader}

    @property
    def width(self) -> int:
        """Channels of the network's features; 32 in the published one."""
        return self._weights.width

    @property
    def settings(self) -> str:
        """Canonical JSON of everything that changes a disparity by more than rounding."""
        values = {
            "align_corners": self.align_corners,
            "colour": self.colour,
            "precision": self.precision,
            "range_px": self.range_px,
            "step": self.step,
            "weights_sha256": self._weights.sha256,
        }
        return canonical_json(values)

    def match(self, left: Image, right: Image) -> Disparity:
        """Disparities (ceil(H / step), ceil(W / step)) in full-resolution pixels, none of them NaN."""
        return self.match_pairs([left, right], [(0, 1)])[0]

    def match_pairs(self, images: Sequence[Image], pairs: Sequence[tuple[int, int]]) -> list[Disparity]:
        """What `match` gives for each pair (left, right) of positions in `images`, of one frame or of several.

        Each image's features are computed once, however many pairs it is in. Raises SettingError where a pair's images
        differ in size or a single pair does not fit into the device's memory.
        """
        used = sorted({position for pair in pairs for position in pair})
        images = [
            seen(image, step=self.step, colour=self.colour) if position in used else image
            for position, image in enumerate(images)
        ]
        features = self._features(images, used)
        maps: dict[int, Disparity] = {}
        for size in dict.fromkeys(images[left].shape[:2] for left, _ in pairs):
            places = [place for place, (left, _) in enumerate(pairs) if images[left].shape[:2] == size]
            if odd := [pairs[place] for place in places if images[pairs[place][1]].shape[:2] != size]:
                shapes = " and ".join(str(images[position].shape[:2]) for position in odd[0])
                raise SettingError(f"a pair of images of different sizes, {shapes}", remedy="use sgbm for this rig")

            def compare(some: Sequence[int], size: tuple[int, ...] = size) -> Disparity:
                left, right = (torch.stack([features[pairs[place][side]] for place in some]) for side in (0, 1))
                return self.engine.disparities(left, right, (size[0], size[1]))

            for some, result in self._batches(places, compare):
                maps.update(zip(some, result, strict=True))
        return [maps[place] * np.float32(self.step) for place in range(len(pairs))]

    def exact(self) -> "PsmnetMatcher":
        """The same network in fp32, to check a lower precision against."""
        return PsmnetMatcher(
            self._weights,
            align_corners=self.align_corners,
            max_disparity=self.range_px,
            device=str(self.engine.device),
            batch=self.batch,
        )

    def _features(self, images: Sequence[Image], used: Sequence[int]) -> dict[int, Tensor]:
        features: dict[int, Tensor] = {}
        for size in dict.fromkeys(images[position].shape[:2] for position in used):
            same_size = [position for position in used if images[position].shape[:2] == size]
            for some, result in self._batches(same_size, lambda some: self.engine.features([images[p] for p in some])):
                features.update(zip(some, result, strict=True))
        return features

    def _batches(
        self, items: Sequence[int], work: Callable[[Sequence[int]], Result]
    ) -> list[tuple[Sequence[int], Result]]:
        """The results of `work` on as many items at a time as the memory allows."""
        done: list[tuple[Sequence[int], Result]] = []
        start = 0
        while start < len(items):
            some = items[start : start + self.batch]
            try:
                result = work(some)
            except torch.OutOfMemoryError as error:
                if len(some) == 1:
                    raise SettingError(
                        "one pair of images does not fit into the device's memory",
                        where="--device",
                        remedy="use a smaller --max-disparity, --precision fp16 or --device cpu",
                    ) from error
                self.batch = len(some) // 2
            else:
                done.append((some, result))
                start += len(some)
                continue
            torch.cuda.empty_cache()  # here, where the failed batch's tensors are gone with their exception
        return done


def open_psmnet(options: MatcherOptions) -> PsmnetMatcher:
    """The matcher with the weights in a file, or those that come with auditor.

    Raises SettingError as `load_weights`, `shipped_weights` and PsmnetMatcher do.
    """
    torch.set_num_threads(options.threads)
    return PsmnetMatcher(
        shipped_weights() if options.weights is None else load_weights(options.weights),
        align_corners=options.align_corners,
        max_disparity=options.max_disparity,
        device=options.device,
        precision=options.precision,
        compiled=options.compiled,
    )


def _device(name: str, precision: str) -> torch.device:
    try:
        device = torch.device(name)
    except RuntimeError as error:
        raise SettingError(
            f"no device is called {name!r}", where="--device", remedy="use cpu, cuda or cuda:1"
        ) from error
    if device.type not in ("cpu", "cuda"):
        raise SettingError(f"PSMNet does not run on {device.type}", where="--device", remedy="use cpu or cuda")
    if device.type == "cuda" and (device.index or 0) >= torch.cuda.device_count():
        raise SettingError(f"there is no GPU {name}", where="--device", remedy="use --device cpu")
    if precision not in PRECISIONS:
        precisions = ", ".join(PRECISIONS)
        raise SettingError(
            f"no precision is called {precision!r}", where="--precision", remedy=f"use one of: {precisions}"
        )
    if device.type == "cpu" and precision != "fp32":
        raise SettingError(f"{precision} is for a GPU", where="--precision", remedy="leave it out with --device cpu")
    return device
