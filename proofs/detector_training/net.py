"""The net: fully convolutional, about 0.35 million weights, one cell for 4 × 4 pixels.

What it takes is the picture, (n, 3, h, w) of 0 to 255, h and w multiples of 32; each colour is
brought to mean 0 and deviation 1 over the picture first, which takes exposure and tint out. What it
gives is one array (n, rows, columns, classes, 5): the probability that the middle of a thing of the
class lies in the cell, and its left, upper, right and lower edge [pixels].
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

CELL = 4


def block(inside: int, outside: int, step: int = 1) -> nn.Sequential:
    """Convolution, normalisation, rectifier."""
    return nn.Sequential(
        nn.Conv2d(inside, outside, 3, step, 1, bias=False), nn.BatchNorm2d(outside), nn.ReLU()
    )


class Net(nn.Module):
    """Down to 1/32 of the size, and up again to 1/4."""

    def __init__(self, classes: int) -> None:
        super().__init__()
        self.classes = classes
        self.down = nn.ModuleList([
            nn.Sequential(block(3, 16, 2), block(16, 32, 2), block(32, 32)),
            nn.Sequential(block(32, 48, 2), block(48, 48)),
            nn.Sequential(block(48, 64, 2), block(64, 64)),
            nn.Sequential(block(64, 64, 2), block(64, 64)),
        ])  # fmt: skip
        self.side = nn.ModuleList([nn.Conv2d(n, 64, 1) for n in (32, 48, 64, 64)])
        self.up = nn.ModuleList([block(64, 64) for _ in range(3)])
        self.head = nn.Sequential(block(64, 64), nn.Conv2d(64, 5 * classes, 1))
        bias = self.head[1].bias
        assert bias is not None
        with torch.no_grad():
            bias[:classes] = -3.0

    def raw(self, picture: Tensor) -> tuple[Tensor, Tensor]:
        """Logits (n, classes, rows, columns), distances to the edges (n, classes, 4, rows,
        columns) [pixels]."""
        x = picture - picture.mean((2, 3), keepdim=True)
        x = x / ((x * x).mean((2, 3), keepdim=True).sqrt() + 1.0)
        kept = []
        for stage in self.down:
            x = stage(x)
            kept.append(x)
        x = self.side[3](kept[3])
        for k in (2, 1, 0):
            x = self.up[k](functional.interpolate(x, scale_factor=2.0) + self.side[k](kept[k]))
        out = self.head(x)
        n, _, rows, columns = out.shape
        edges = 8.0 * out[:, self.classes :].clamp(-4.0, 4.0).exp()
        return out[:, : self.classes], edges.reshape(n, self.classes, 4, rows, columns)

    def forward(self, picture: Tensor) -> Tensor:
        """What is shipped; see the module."""
        logits, edges = self.raw(picture)
        rows, columns = logits.shape[2:]
        x = CELL * (torch.arange(columns) + 0.5)[None, None, None, :]
        y = CELL * (torch.arange(rows) + 0.5)[None, None, :, None]
        left, upper, right, lower = edges.unbind(2)
        parts = (logits.sigmoid(), x - left, y - upper, x + right, y + lower)
        return torch.stack(parts, dim=-1).permute(0, 2, 3, 1, 4)


def loss(logits: Tensor, edges: Tensor, heat: Tensor, box: Tensor) -> Tensor:
    """Focal loss of the heat (Zhou et al., Objects as Points, 2019) and 1 − GIoU of the boxes
    (Rezatofighi et al., CVPR 2019); what is not asked is NaN."""
    asked = ~heat.isnan()
    heat = heat.nan_to_num()
    middle = (heat > 0.999).float()
    p = logits.sigmoid().clamp(1e-4, 1 - 1e-4)
    hit = middle * (1 - p) ** 2 * p.log()
    miss = (1 - middle) * (1 - heat) ** 4 * p**2 * (1 - p).log() * asked
    focal = -(hit.sum() + miss.sum()) / middle.sum().clamp(min=1.0)
    known = ~box[:, :, 0].isnan()
    mine, true = edges.movedim(2, -1)[known], box.movedim(2, -1)[known]
    if not len(true):
        return focal
    small, large = torch.minimum(mine, true), torch.maximum(mine, true)
    both = (small[:, 0] + small[:, 2]) * (small[:, 1] + small[:, 3])
    hull = (large[:, 0] + large[:, 2]) * (large[:, 1] + large[:, 3])
    area = sum((one[:, 0] + one[:, 2]) * (one[:, 1] + one[:, 3]) for one in (mine, true)) - both
    return focal + 3.0 * (1 - both / area + (hull - area) / hull).mean()
