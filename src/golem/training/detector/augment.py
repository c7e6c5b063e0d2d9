"""Training crops: zoom, mirror, light, colour, blur, dirt and noise on rendered images, and their labels.

All on the device that trains: a processor cuts a few hundred crops a second, which is what a GPU trains on in a few
hundredths of one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from golem.training.detector.labels import MIN_SIDE, within
from golem.types import Array

MEAN = (0.45, 0.45, 0.45)
STD = (0.25, 0.25, 0.25)
"""Normalisation of RGB in 0..1."""
CROP = (320, 256)
"""Width and height of a training crop [px]."""
ZOOM = (0.6, 1.35)
REACH = 4
"""Half side of the blurs' kernels [px]."""
AROUND_A_PART = 0.85
"""Share of the crops that are cut around a part; the others are anywhere."""


class Images:
    """Images of any size on a device, padded to the largest."""

    def __init__(self, images: Sequence[NDArray[np.uint8]], device: str) -> None:
        height, width = (max(image.shape[side] for image in images) for side in (0, 1))
        self.sizes = np.array([image.shape[1::-1] for image in images], float)
        self.pixels = torch.zeros((len(images), 3, height, width), dtype=torch.uint8, device=device)
        for k, image in enumerate(images):
            whole = torch.from_numpy(image).to(device).permute(2, 0, 1)
            self.pixels[k, :, : image.shape[0], : image.shape[1]] = whole

    def cut(self, chosen: Sequence[int], scales: Array, shifts: Array, rng: torch.Generator) -> Tensor:
        """Return crops (n, 3, height, width) in 0..1 of images `chosen`: a pixel p of one is at scale * p + shift.

        Outside of the image is one colour, or its edge, smeared.

        Args:
            chosen: numbers of n images.
            scales: (n, 2) along x and y.
            shifts: (n, 2) along x and y [px].
            rng: draws what is outside; on the images' device.
        """
        device, n = self.pixels.device, len(chosen)
        image = self.pixels[torch.as_tensor(chosen, device=device)].float() / 255.0
        smaller = torch.as_tensor(scales[:, 1], dtype=torch.float32, device=device)
        image = filtered(image, gaussians(0.35 / smaller), smaller < 0.8)
        axes, inside = [], []
        for side, length in enumerate(CROP):
            place = (np.arange(length) - shifts[:, side : side + 1]) / scales[:, side : side + 1]
            last = self.sizes[list(chosen), side][:, None] - 1.0
            inside.append(torch.as_tensor((place >= 0.0) & (place <= last), device=device))
            whole = self.pixels.shape[3 - side] - 1.0
            unit = 2.0 * np.clip(place, 0.0, last) / whole - 1.0
            axes.append(torch.as_tensor(unit, dtype=torch.float32, device=device))
        x = axes[0][:, None, :].expand(n, CROP[1], CROP[0])
        y = axes[1][:, :, None].expand(n, CROP[1], CROP[0])
        pieces = functional.grid_sample(image, torch.stack([x, y], dim=3), align_corners=True)
        shade = torch.rand((n, 3, 1, 1), generator=rng, device=device)
        smeared = torch.rand((n, 1, 1, 1), generator=rng, device=device) < 0.3
        seen = (inside[0][:, None, :] & inside[1][:, :, None])[:, None] | smeared
        return torch.where(seen, pieces, shade)


def place_crop(labels: Array, size: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Draw a zoomed and mirrored piece of an image, usually around a part: scale, shift, (2,) each; see `Images.cut`.

    Args:
        labels: (n, 8) of the image, columns as in `labels.COLUMNS`.
        size: (2,) width and height of the image [px].
        rng: draws it.
    """
    half = np.array(CROP) / 2
    zoom = float(np.exp(rng.uniform(*np.log(ZOOM))))
    labels = labels[labels[:, 7] == 0]
    if len(labels) and rng.random() < AROUND_A_PART:
        # Rare classes as often as frequent ones.
        kind = rng.choice(np.unique(labels[:, 0]))
        chosen = labels[rng.choice(np.flatnonzero(labels[:, 0] == kind)), 1:3]
        middle = chosen + rng.uniform(-0.84, 0.84, 2) * half / zoom
    else:
        middle = rng.uniform((0, 0), size)
    scale = np.array([zoom * (-1.0 if rng.random() < 0.5 else 1.0), zoom])
    return scale, half - 0.5 - scale * middle


def moved_labels(labels: Array, size: Array, scale: Array, shift: Array) -> Array:
    """Return the labels (n, 8) of a crop, with boxes clipped; see `labels.within`."""
    out = labels.copy()
    for first in (1, 3, 5):
        out[:, first : first + 2] = out[:, first : first + 2] * scale + shift
    if scale[0] < 0:
        out[:, [3, 5]] = out[:, [5, 3]]
    out = within(out, np.array(CROP))
    ends = np.stack([shift, (size - 1.0) * scale + shift])
    limit = np.array(CROP) - 1.0
    low, high = np.maximum(ends.min(axis=0), 0), np.minimum(ends.max(axis=0), limit)
    out[:, 3:5] = np.clip(out[:, 3:5], low, high)
    out[:, 5:7] = np.clip(out[:, 5:7], low, high)
    out[:, 7] = np.maximum(out[:, 7], (out[:, 5:7] - out[:, 3:5]).min(axis=1, initial=np.inf) < MIN_SIDE)
    return out


def corrupt(crops: Tensor, rng: torch.Generator) -> Tensor:
    """Return crops (n, 3, height, width), 0 to 1, normalised, with random exposure, colour, blur and noise."""
    n, _, height, width = crops.shape
    device = crops.device

    def uniform(low: float, high: float, *shape: int) -> Tensor:
        return low + (high - low) * torch.rand((n, *(shape or (1, 1, 1))), generator=rng, device=device)

    def normal(*shape: int) -> Tensor:
        return torch.randn((n, *shape), generator=rng, device=device)

    def sometimes(share: float) -> Tensor:
        return (uniform(0.0, 1.0) < share).float()

    cells = int(torch.randint(3, 9, (), generator=rng, device=device))
    field = functional.interpolate(normal(1, cells, cells), (height, width), mode="bicubic")
    x = crops * torch.exp(sometimes(0.5) * uniform(0.02, 0.25) * field)  # uneven light, dirt
    textured = sometimes(0.3)
    grain = normal(1, height // 2, width // 2)
    grain = filtered(grain, gaussians(uniform(0.5, 2.0, 1)[:, 0]), textured[:, 0, 0, 0] > 0)
    grain = functional.interpolate(grain, (height, width), mode="bilinear")
    x = x + textured * uniform(0.01, 0.08) * grain
    x = x * torch.exp(0.3 * normal(1, 1, 1) + 0.07 * normal(3, 1, 1))
    grey = x.mean(dim=1, keepdim=True)
    x = grey + (x - grey) * uniform(0.4, 1.3)
    mean = x.mean(dim=(1, 2, 3), keepdim=True)
    x = mean + (x - mean) * torch.exp(0.2 * normal(1, 1, 1))
    x = x.clamp(0.0, 1.2) ** torch.exp(0.15 * normal(1, 1, 1))
    choice = uniform(0.0, 1.0, 1)[:, 0]
    x = filtered(x, gaussians(uniform(0.3, 1.3, 1)[:, 0]), choice < 0.35)
    moving = (choice >= 0.35) & (choice < 0.5)
    x = filtered(x, strokes(uniform(2.0, 6.0, 1)[:, 0], uniform(0.0, float(np.pi), 1)[:, 0]), moving)
    x = x + sometimes(0.7) * uniform(0.0, 0.04) * normal(3, height, width)
    x = torch.round(x.clamp(0.0, 1.0) * 255.0) / 255.0
    centre, spread = (torch.tensor(v, device=device)[:, None, None] for v in (MEAN, STD))
    return (x - centre) / spread


def gaussians(sigma: Tensor) -> Tensor:
    """Return kernels (n, side, side) of blurs by `sigma` (n,) [px]."""
    step = torch.arange(-REACH, REACH + 1, device=sigma.device).float()
    line = torch.exp(-(step**2) / (2.0 * sigma[:, None] ** 2))
    line = line / line.sum(dim=1, keepdim=True)
    return line[:, :, None] * line[:, None, :]


def strokes(length: Tensor, direction: Tensor) -> Tensor:
    """Return kernels (n, side, side) of the blur of a motion by `length` (n,) [px] along `direction` (n,) [rad]."""
    way = torch.linspace(-0.5, 0.5, 15, device=length.device) * length[:, None]
    step = torch.arange(-REACH, REACH + 1, device=length.device).float()
    x, y = (way * turn(direction)[:, None] for turn in (torch.cos, torch.sin))
    near = [(1.0 - (step[None, None, :] - at[:, :, None]).abs()).clamp(min=0.0) for at in (x, y)]
    kernel = torch.einsum("nky,nkx->nyx", near[1], near[0])
    return kernel / kernel.sum(dim=(1, 2), keepdim=True)


def filtered(images: Tensor, kernels: Tensor, wanted: Tensor) -> Tensor:
    """Return n images (n, channels, height, width), those `wanted` (n,) filtered by their kernels (n, side, side)."""
    some = images[wanted]
    count, channels, height, width = some.shape
    if count == 0:
        return images
    weights = kernels[wanted][:, None].expand(count, channels, *kernels.shape[1:]).flatten(0, 1)[:, None]
    padded = functional.pad(some, (REACH,) * 4, mode="replicate")
    out = functional.conv2d(padded.flatten(0, 1)[None], weights, groups=count * channels)
    whole = images.clone()
    whole[wanted] = out.reshape(count, channels, height, width)
    return whole
