"""How a colour camera answers to the level of the light: it exposes longer, then amplifies, then the image is dark.

With the light at level L the camera wants a factor 1 / L. Up to `LONGER` it exposes longer, which costs nothing; from
there it amplifies up to `GAIN`, which amplifies the noise; what is missing then darkens the image. More light is
answered by a shorter exposure alone.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

LONGER = 2.0
"""Largest factor of the exposure time: 33 ms of a frame over what a lit hall takes [assumption]."""
GAIN = 8.0
"""Largest factor of the amplifier: 128 over 16, the range of the D435i's colour gain [vendor]."""
READ_NOISE = 0.4
"""Standard deviation of a pixel's value without light, per unit of gain, of 255 [assumption]."""
SHOT_NOISE = 0.15
"""The same of a value of 1 in light, per root of gain; grows with the root of the value [assumption]."""


class AutoExposure:
    """The colour of one camera under one level of the light."""

    def __init__(self, light: float, rng: np.random.Generator) -> None:
        """Expose for `light` (1 is nominal), with noise from `rng`."""
        self.gain = float(np.clip(1.0 / (light * LONGER), 1.0, GAIN))
        self._factor = min(1.0, light * LONGER * self.gain)
        self._rng = rng

    def expose(self, rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return the image (height, width, 3) that the camera makes of `rgb`, which is lit nominally."""
        if self.gain == 1.0 and self._factor == 1.0:
            return rgb
        value = rgb.astype(np.float32) * np.float32(self._factor)
        sigma = np.sqrt((READ_NOISE * self.gain) ** 2 + SHOT_NOISE**2 * self.gain * value)
        value += sigma * self._rng.standard_normal(value.shape, np.float32)
        return np.clip(np.rint(value), 0, 255).astype(np.uint8)
