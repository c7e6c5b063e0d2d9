"""The network: a small convolutional encoder and decoder with one heatmap per class at a quarter of the resolution.

After Zhou et al., "Objects as Points" (2019). Dense 3x3 convolutions only: on one CPU thread they are faster than
depthwise ones of the same size.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

MULTIPLE = 16
"""Image sides must be multiples of this."""
REGRESSION = ("dx", "dy", "left", "top", "right", "bottom")
"""Channels after the heatmaps: the centre's offset from the cell's middle [cells], and the log of the distances from
the centre to the sides of the box [log px]."""


def _block(inputs: int, outputs: int, stride: int = 1, dilation: int = 1) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, 3, stride, padding=dilation, dilation=dilation, bias=False),
        nn.BatchNorm2d(outputs),
        nn.ReLU(inplace=True),
    )


class PartNet(nn.Module):
    """Images to heatmaps and regression maps.

    Input (n, 3, height, width), normalised RGB, sides multiples of `MULTIPLE`. Output (n, classes + 6,
    height / 4, width / 4): logits of the classes, then `REGRESSION`.
    """

    def __init__(self, classes: int) -> None:
        """Build the network with random weights."""
        super().__init__()
        self.stem = _block(3, 16, 2)
        self.down4 = nn.Sequential(_block(16, 24, 2), _block(24, 24))
        self.down8 = nn.Sequential(_block(24, 64, 2), _block(64, 64))
        self.down16 = _block(64, 96, 2)
        self.context = nn.ModuleList(_block(96, 96, dilation=d) for d in (1, 2, 4))
        self.side8 = nn.Conv2d(96, 64, 1)
        self.merge8 = _block(64, 64)
        self.side4 = nn.Conv2d(64, 24, 1)
        self.merge4 = _block(24, 24)
        self.heat = nn.Conv2d(24, classes, 1)
        self.regression = nn.Conv2d(24, len(REGRESSION), 1)
        self.up = nn.Upsample(scale_factor=2, mode="nearest")
        nn.init.constant_(self.heat.bias, -4.6)  # a prior of 1 % per cell, as in focal loss training
        nn.init.normal_(self.heat.weight, std=0.01)

    def forward(self, image: Tensor) -> Tensor:
        """Return heatmap logits and regression, see the class."""
        f4 = self.down4(self.stem(image))
        f8 = self.down8(f4)
        f16 = self.down16(f8)
        for block in self.context:
            f16 = f16 + block(f16)
        u8 = self.merge8(f8 + self.up(self.side8(f16)))
        u4 = self.merge4(f4 + self.up(self.side4(u8)))
        with torch.autocast(image.device.type, enabled=False):  # sub-pixel offsets need the full mantissa
            u4 = u4.float()
            return torch.cat([self.heat(u4), self.regression(u4)], dim=1)
