"""The network ready to match: normalisation folded into its convolutions, laid out for the device."""

import copy
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional
from torch.nn.utils.fusion import fuse_conv_bn_eval

from auditor.measurement.disparity.half_resolution import grey, halve
from auditor.measurement.disparity.matchers.psmnet.network import MULTIPLE, PSMNet
from auditor.measurement.disparity.matchers.psmnet.weights import Weights

PRECISIONS = ("fp32", "tf32", "fp16", "bf16")
"""fp32 is exact; tf32 rounds the factors of products to 10 bits; fp16 and bf16 also store what lies between layers."""

_MEAN, _DEVIATION = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)
"""ImageNet's, as shares of 255, RGB: so the published code prepares pictures."""

_HALF = {"fp16": torch.float16, "bf16": torch.bfloat16}
_FORMATS = {4: torch.channels_last, 5: torch.channels_last_3d}

Image = NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class InferenceEngine:
    """A PSMNet in evaluation on one device. Images, features and disparities are batches on that device."""

    network: PSMNet
    device: torch.device
    precision: str = "fp32"

    def load(self, images: list[Image]) -> Tensor:
        """(B, 3, H', W') from B images (H, W, 3) BGR or (H, W) grey of one size.

        RGB / 255, less the mean, by the deviation of ImageNet, then zeros at the top and the right up to multiples of
        16: as the published test script does.
        """
        pixels = torch.from_numpy(np.stack([_rgb(image) for image in images])).to(self.device)
        tensor = pixels.permute(0, 3, 1, 2).float() / 255
        mean = torch.tensor(_MEAN, device=self.device).view(1, 3, 1, 1)
        deviation = torch.tensor(_DEVIATION, device=self.device).view(1, 3, 1, 1)
        top, right = (-length % MULTIPLE for length in tensor.shape[-2:])
        padded = functional.pad((tensor - mean) / deviation, (0, right, top, 0))
        return padded.contiguous(memory_format=torch.channels_last)

    @torch.inference_mode()
    def features(self, images: list[Image]) -> Tensor:
        """(B, C, H' / 4, W' / 4) of B images of one size."""
        with self._arithmetic():
            features: Tensor = self.network.feature_extraction(self.load(images))
            return features

    @torch.inference_mode()
    def disparities(self, left: Tensor, right: Tensor, size: tuple[int, int]) -> NDArray[np.float32]:
        """(B, H, W) disparities in pixels from features of B left and right images of `size` (H, W)."""
        height, width = size
        padded = (height + -height % MULTIPLE, width + -width % MULTIPLE)
        with self._arithmetic():
            volume = self.network.volume(left, right, torch.channels_last_3d)
            # The first two outputs are for training: neither is brought to full resolution.
            cost = self.network.costs(volume)[2]
        del volume
        # One by one: at full resolution a pair's levels take more memory than all that came before.
        disparity = torch.cat([self.network.disparity(one, padded) for one in cost[:, None]])
        return disparity[:, padded[0] - height :, :width].cpu().numpy()

    def _arithmetic(self) -> AbstractContextManager[object]:
        if self.device.type != "cuda":
            return nullcontext()
        exact = "tf32" if self.precision == "tf32" else "ieee"
        torch.backends.cudnn.conv.fp32_precision = exact  # type: ignore[attr-defined]  # made when torch is imported
        half = _HALF.get(self.precision)
        return torch.autocast("cuda", dtype=half) if half else nullcontext()


def make_engine(
    weights: Weights,
    *,
    align_corners: bool,
    max_disparity: int,
    device: torch.device,
    precision: str = "fp32",
    compiled: bool = False,
) -> InferenceEngine:
    """A network with these weights on a device, its batch normalisation folded into the convolutions before it.

    Folding changes a disparity by less than 1e-4 px; on a CPU the layout with channels last saves a third of the time.
    Compiled, its two halves are fused for the device when they are first used, which takes about a minute.
    """
    with torch.device("meta"):
        network = PSMNet(max_disparity=max_disparity, align_corners=align_corners, width=weights.width)
    network.load_state_dict(weights.state, assign=True)
    network = fold(network.eval()).to(device)
    for parameter in network.parameters():
        if parameter.dim() in _FORMATS:
            parameter.data = parameter.data.contiguous(memory_format=_FORMATS[parameter.dim()])
    if compiled:
        network.feature_extraction.compile()
        network.costs = torch.compile(network.costs)  # type: ignore[method-assign]
    return InferenceEngine(network.requires_grad_(requires_grad=False), device, precision)


def fold(network: PSMNet) -> PSMNet:
    """A copy in which each convolution carries the batch normalisation that followed it."""
    folded = copy.deepcopy(network)
    for block in [module for module in folded.modules() if isinstance(module, nn.Sequential)]:
        for place, layer in enumerate(block):
            if isinstance(layer, nn.BatchNorm2d | nn.BatchNorm3d):
                before = block[place - 1]
                assert isinstance(before, nn.Conv2d | nn.Conv3d | nn.ConvTranspose3d)
                transposed = isinstance(before, nn.ConvTranspose3d)
                block[place - 1] = fuse_conv_bn_eval(before, layer, transpose=transposed)
                block[place] = nn.Identity()
    return folded


def seen(image: Image, *, step: int, colour: bool) -> Image:
    """A full-resolution image, (H, W) or (H, W, 3) BGR, as a network is shown it: grey, halved, or as it is."""
    image = image if colour else grey(image)
    return halve(image) if step == 2 else image


def _rgb(image: Image) -> Image:
    if image.ndim == 2:
        image = image[..., np.newaxis].repeat(3, axis=2)
    return np.ascontiguousarray(image[..., ::-1])
