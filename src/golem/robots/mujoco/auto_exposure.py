"""How a colour camera answers to the level of the light: it exposes longer, then amplifies, then the image is dark.

With the light at level L the camera wants a factor 1 / L. Up to `LONGER` it exposes longer, which costs nothing; from
there it amplifies up to `GAIN`, which amplifies the noise; what is missing then darkens the image. More light is
answered by a shorter exposure alone.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

LONGER = 2.0
"""Largest factor of the exposure time: 33 ms of a frame over what a lit hall takes [assumption]."""
GAIN = 8.0
"""Largest factor of the amplifier: 128 over 16, the range of the D435i's colour gain [vendor]."""
READ_NOISE = 0.4
"""Standard deviation of a pixel's value without light, per unit of gain, of 255 [assumption]."""
SHOT_NOISE = 0.15
"""The same of a value of 1 in light, per root of gain; grows with the root of the value [assumption]."""


POOL = 1 << 21
"""Random bytes that a camera draws once; each image takes a stretch of them that begins anywhere."""
_QUANTILES: NDArray[np.float64] = ndtri((np.arange(256) + 0.5) / 256.0)
"""Standard normal values of equal probability, one for each value of a random byte."""


class AutoExposure:
    """The colour of one camera under one level of the light."""

    def __init__(self, light: float, rng: np.random.Generator, noise: float = 1.0) -> None:
        """Expose for `light` (1 is nominal), with `noise` times the sensor's noise from `rng`."""
        self.gain = float(np.clip(1.0 / (light * LONGER), 1.0, GAIN))
        factor = min(1.0, light * LONGER * self.gain)
        self._rng, self._random = rng, rng.integers(0, 256, POOL, np.uint8)
        value = factor * np.arange(256.0)[:, None]
        sigma = noise * np.sqrt((READ_NOISE * self.gain) ** 2 + SHOT_NOISE**2 * self.gain * value)
        table = np.clip(np.rint(value + sigma * _QUANTILES), 0, 255).astype(np.uint8)
        self._table = None if noise == 0.0 and factor == 1.0 else table.ravel()

    def expose(self, rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return the image (height, width, 3) that the camera makes of `rgb`, which is lit nominally."""
        if self._table is None:
            return rgb
        first = int(self._rng.integers(0, POOL - rgb.size))
        place = np.empty((*rgb.shape, 2), np.uint8)  # of a row of the table, and in it: the bytes of a "<u2"
        place[..., 1] = rgb
        place[..., 0] = self._random[first : first + rgb.size].reshape(rgb.shape)
        return self._table.take(place.view("<u2")[..., 0])
