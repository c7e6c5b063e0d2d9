"""What the network should say of labelled crops: heatmaps, where they count, offsets and boxes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from golem.capabilities.perception.peaks import STRIDE
from golem.training.detector.augment import CROP
from golem.types import Array

LARGE = 15
"""Shorter side from which a part counts as large [cells]."""
NEIGHBOURS = 2.4
"""Weight of the cells around a centre in all, where the centre's cell has 1."""


def targets(labels: Sequence[Array], classes: int, device: str) -> tuple[Tensor, Tensor, Tensor]:
    """Return the targets of n crops.

    Args:
        labels: of each crop (parts, 8), columns as in `labels.COLUMNS`.
        classes: how many heatmaps there are.
        device: where the targets should be.

    Returns:
        heat: (n, classes, h, w) 1 at a part's cell, falling around it.
        weight: (n, classes, h, w) 0 where a part neither counts as there nor as absent.
        regression: (n, 7, h, w) `part_net.REGRESSION`, and how much a cell's counts.
    """
    n, most = len(labels), max([len(some) for some in labels] + [1])
    table = np.zeros((n, most, 8), np.float32)
    there = np.zeros((n, most), bool)
    for k, some in enumerate(labels):
        # The largest first: of two centres in a cell the smaller part's is kept.
        order = np.argsort(-(some[:, 5:7] - some[:, 3:5]).prod(axis=1))
        table[k, : len(some)], there[k, : len(some)] = some[order], True
    rows = torch.from_numpy(table).to(device)
    real = torch.from_numpy(there).to(device)
    w, h = CROP[0] // STRIDE, CROP[1] // STRIDE
    column = torch.arange(w, device=device).float()
    line = torch.arange(h, device=device).float()
    kind, x, y, x0, y0, x1, y1, ignore = rows.unbind(dim=2)
    counted, ignored = real & (ignore == 0), real & (ignore != 0)

    middle = (STRIDE - 1) / 2
    gx, gy = (x - middle) / STRIDE, (y - middle) / STRIDE
    side = torch.minimum(x1 - x0, y1 - y0) / STRIDE
    # Where the middle of a large part is cannot be told to the cell: a broad peak, and offsets from all over it.
    large = side >= LARGE
    sigma = torch.where(large, (0.18 * side).clamp(2.0, 8.0), (0.13 * side).clamp(0.7, 2.0))
    reach = torch.where(large, torch.floor(0.8 * sigma), 1.0)
    j, i = (torch.round(g).clamp(0, last) for g, last in ((gx, w - 1), (gy, h - 1)))

    def along(cells: Tensor, at: Tensor) -> Tensor:
        return cells - at[:, :, None]

    blob = torch.exp(-(along(line, gy) ** 2) / (2 * sigma[:, :, None] ** 2))[:, :, :, None]
    blob = blob * torch.exp(-(along(column, gx) ** 2) / (2 * sigma[:, :, None] ** 2))[:, :, None, :]
    far = torch.maximum(along(line, i).abs()[:, :, :, None], along(column, j).abs()[:, :, None, :])
    blob = torch.where(far == 0, 1.0, blob)
    hidden = [
        (cells >= torch.floor(low / STRIDE)[:, :, None] - 1)
        & (cells < torch.ceil(high / STRIDE)[:, :, None] + 2)
        for cells, low, high in ((line, y0, y1), (column, x0, x1))
    ]
    covered = hidden[0][:, :, :, None] & hidden[1][:, :, None, :]

    heat = torch.zeros((n, classes, h, w), device=device)
    weight = torch.ones_like(heat)
    for c in range(classes):
        mine = (counted & (kind == c))[:, :, None, None]
        heat[:, c] = (blob * mine).amax(dim=1)
        weight[:, c] -= (covered & (ignored & (kind == c))[:, :, None, None]).float().amax(dim=1)

    share = NEIGHBOURS / ((2 * reach + 1) ** 2 - 1)
    place = torch.arange(most, device=device).float()
    # Centres before neighbours; of centres the smallest part's, of neighbours those that weigh most.
    claim = torch.where(
        far == 0,
        2.0 + place[None, :, None, None],
        share[:, :, None, None] - 1e-5 * place[None, :, None, None],
    )
    claim = torch.where((far <= reach[:, :, None, None]) & counted[:, :, None, None], claim, -1.0)
    best, owner = claim.max(dim=1, keepdim=True)
    sides = torch.log(torch.stack([x - x0, y - y0, x1 - x, y1 - y], dim=2).clamp(min=1.0))
    values = torch.cat([torch.stack([gx, gy, share], dim=2), sides], dim=2)
    taken = torch.gather(values, 1, owner.reshape(n, h * w, 1).expand(-1, -1, 7))
    own_x, own_y, own_share, *own_sides = taken.reshape(n, h, w, 7).unbind(dim=3)
    regression = torch.stack(
        [own_x - column, own_y - line[:, None], *own_sides, torch.where(best[:, 0] >= 2.0, 1.0, own_share)],
        dim=1,
    )
    return heat, weight, torch.where(best >= 0.0, regression, 0.0)
