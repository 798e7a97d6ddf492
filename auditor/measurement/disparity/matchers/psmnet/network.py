"""The stacked-hourglass PSMNet of Chang and Chen (CVPR 2018), with the published names and shapes of its parameters.

With width 32 `state_dict` has the 514 entries of the published checkpoints. Width scales every layer; the largest
disparity changes no parameter, only the number of levels that are compared.
"""

import torch
from torch import Tensor, nn
from torch.nn import functional

PUBLISHED_WIDTH = 32
MULTIPLE = 16
"""Heights, widths and disparity ranges are multiples of it: quarter resolution, then halved twice."""

_POOLS = (64, 32, 16, 8)


def _conv(inputs: int, outputs: int, kernel: int, stride: int = 1, dilation: int = 1) -> nn.Sequential:
    padding = dilation if kernel == 3 else 0
    layer = nn.Conv2d(inputs, outputs, kernel, stride, padding, dilation, bias=False)
    return nn.Sequential(layer, nn.BatchNorm2d(outputs))


def _conv3d(inputs: int, outputs: int, stride: int = 1) -> nn.Sequential:
    return nn.Sequential(nn.Conv3d(inputs, outputs, 3, stride, 1, bias=False), nn.BatchNorm3d(outputs))


def _upconv3d(inputs: int, outputs: int) -> nn.Sequential:
    layer = nn.ConvTranspose3d(inputs, outputs, 3, stride=2, padding=1, output_padding=1, bias=False)
    return nn.Sequential(layer, nn.BatchNorm3d(outputs))


def _relu() -> nn.ReLU:
    return nn.ReLU(inplace=True)


class Residual(nn.Module):
    """Two convolutions beside a shortcut; no ReLU after the sum."""

    def __init__(self, inputs: int, outputs: int, stride: int, dilation: int) -> None:
        super().__init__()
        self.conv1 = nn.Sequential(_conv(inputs, outputs, 3, stride, dilation), _relu())
        self.conv2 = _conv(outputs, outputs, 3, 1, dilation)
        self.downsample = _conv(inputs, outputs, 1) if inputs != outputs or stride != 1 else None
        self.stride = stride

    def forward(self, x: Tensor) -> Tensor:
        """(B, outputs, H / stride, W / stride) from (B, inputs, H, W)."""
        # Strided by hand: oneDNN 3.12 writes past its memory in the backward pass of strided 1 x 1 convolutions of 8
        # channels laid out last.
        shortcut: Tensor = x if self.downsample is None else self.downsample(x[..., :: self.stride, :: self.stride])
        residual: Tensor = self.conv2(self.conv1(x))
        return residual + shortcut


def _residuals(inputs: int, outputs: int, count: int, stride: int = 1, dilation: int = 1) -> nn.Sequential:
    rest = (Residual(outputs, outputs, 1, dilation) for _ in range(count - 1))
    return nn.Sequential(Residual(inputs, outputs, stride, dilation), *rest)


class _Pool(nn.Module):
    """Means over squares of `size`, or over the whole image where it is smaller than that."""

    def __init__(self, size: int) -> None:
        super().__init__()
        self.size = size

    def forward(self, x: Tensor) -> Tensor:
        return functional.avg_pool2d(x, (min(self.size, x.shape[-2]), min(self.size, x.shape[-1])))


class Features(nn.Module):
    """(B, 3, H, W) normalised images -> (B, width, H / 4, W / 4): a residual network and a spatial pyramid."""

    def __init__(self, width: int, *, align_corners: bool) -> None:
        super().__init__()
        self.align_corners = align_corners
        self.firstconv = nn.Sequential(
            _conv(3, width, 3, stride=2), _relu(), _conv(width, width, 3), _relu(), _conv(width, width, 3), _relu()
        )
        self.layer1 = _residuals(width, width, 3)
        self.layer2 = _residuals(width, 2 * width, 16, stride=2)
        self.layer3 = _residuals(2 * width, 4 * width, 3)
        self.layer4 = _residuals(4 * width, 4 * width, 3, dilation=2)
        branches = [nn.Sequential(_Pool(size), _conv(4 * width, width, 1), _relu()) for size in _POOLS]
        self.branch1, self.branch2, self.branch3, self.branch4 = branches
        self.lastconv = nn.Sequential(
            _conv(10 * width, 4 * width, 3), _relu(), nn.Conv2d(4 * width, width, 1, bias=False)
        )

    def forward(self, images: Tensor) -> Tensor:
        """Features of each image, computed once however many others it is compared with."""
        raw = self.layer2(self.layer1(self.firstconv(images)))
        skip = self.layer4(self.layer3(raw))
        pyramid = [
            functional.interpolate(branch(skip), skip.shape[-2:], mode="bilinear", align_corners=self.align_corners)
            for branch in (self.branch4, self.branch3, self.branch2, self.branch1)
        ]
        features: Tensor = self.lastconv(torch.cat([raw, skip, *pyramid], dim=1))
        return features


class _Hourglass(nn.Module):
    """Down to a quarter and up again, with shortcuts from its own way down and from the hourglass before it."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.conv1 = nn.Sequential(_conv3d(width, 2 * width, 2), _relu())
        self.conv2 = _conv3d(2 * width, 2 * width)
        self.conv3 = nn.Sequential(_conv3d(2 * width, 2 * width, 2), _relu())
        self.conv4 = nn.Sequential(_conv3d(2 * width, 2 * width), _relu())
        self.conv5 = _upconv3d(2 * width, 2 * width)
        self.conv6 = _upconv3d(2 * width, width)

    def forward(self, x: Tensor, down: Tensor | None, up: Tensor | None) -> tuple[Tensor, Tensor, Tensor]:
        """The output, then the halved volumes on its way down and up; `down` the first hourglass's, `up` the last's."""
        own = self.conv2(self.conv1(x))
        own = functional.relu(own if up is None else own + up)
        risen = functional.relu(self.conv5(self.conv4(self.conv3(own))) + (own if down is None else down))
        return self.conv6(risen), own, risen


def _classifier(width: int) -> nn.Sequential:
    return nn.Sequential(_conv3d(width, width), _relu(), nn.Conv3d(width, 1, 3, padding=1, bias=False))


class PSMNet(nn.Module):
    """Stereo matching by a cost volume of concatenated features, three stacked hourglasses and a soft argmin.

    `align_corners` is the convention of all upsampling that the weights were trained with: True for checkpoints of
    2018, False for the one of 2021. `max_disparity` is a multiple of 16 pixels.
    """

    def __init__(self, *, max_disparity: int, align_corners: bool, width: int = PUBLISHED_WIDTH) -> None:
        super().__init__()
        self.max_disparity = max_disparity
        self.align_corners = align_corners
        self.feature_extraction = Features(width, align_corners=align_corners)
        self.dres0 = nn.Sequential(_conv3d(2 * width, width), _relu(), _conv3d(width, width), _relu())
        self.dres1 = nn.Sequential(_conv3d(width, width), _relu(), _conv3d(width, width))
        self.dres2, self.dres3, self.dres4 = _Hourglass(width), _Hourglass(width), _Hourglass(width)
        self.classif1, self.classif2, self.classif3 = _classifier(width), _classifier(width), _classifier(width)

    def forward(self, left: Tensor, right: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Disparities (B, H, W) in pixels after each hourglass, the last the best; images (B, 3, H, W) normalised."""
        size = (left.shape[-2], left.shape[-1])
        features = self.feature_extraction(left), self.feature_extraction(right)
        first, second, third = self.costs(self.volume(*features))
        return self.disparity(first, size), self.disparity(second, size), self.disparity(third, size)

    def volume(
        self, left: Tensor, right: Tensor, memory_format: torch.memory_format = torch.contiguous_format
    ) -> Tensor:
        """(B, 2 C, max_disparity / 4, h, w) from features (B, C, h, w): each level the right ones moved one further.

        Columns whose match would lie outside the right image are zero.
        """
        batch, channels, height, width = left.shape
        levels = self.max_disparity // 4
        shape = (batch, 2 * channels, levels, height, width)
        cost = torch.empty(shape, dtype=left.dtype, device=left.device, memory_format=memory_format).zero_()
        for level in range(min(levels, width)):
            cost[:, :channels, level, :, level:] = left[..., level:]
            cost[:, channels:, level, :, level:] = right[..., : width - level]
        return cost

    def costs(self, volume: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """(B, 1, max_disparity / 4, h, w) after each hourglass: the higher, the likelier. The volume is consumed."""
        start = self.dres0(volume)
        del volume
        start = self.dres1(start) + start
        out, down, up = self.dres2(start, None, None)
        out = out + start
        first = self.classif1(out)
        out, _, up = self.dres3(out, down, up)
        out = out + start
        second = self.classif2(out) + first
        out, _, _ = self.dres4(out, down, up)
        third = self.classif3(out + start) + second
        return first, second, third

    def disparity(self, cost: Tensor, size: tuple[int, int]) -> Tensor:
        """The soft argmin (B, H, W) in pixels of a cost volume brought to full resolution, never in half precision."""
        full = (self.max_disparity, *size)
        with torch.autocast(cost.device.type, enabled=False):
            upsampled = functional.interpolate(cost.float(), full, mode="trilinear", align_corners=self.align_corners)
            share = functional.softmax(upsampled[:, 0], dim=1)
            levels = torch.arange(self.max_disparity, dtype=share.dtype, device=share.device)
            return torch.einsum("bdhw,d->bhw", share, levels)
