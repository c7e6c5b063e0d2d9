"""Horizontal sway of the base: what a hoist's rope does to it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from golem.types import Array

TONES = 4
"""Sinusoids per axis."""
BAND = (0.2, 0.8)
"""Frequencies [Hz]; assumption: a pendulum of 4 m to 1 m (0.25 to 0.5 Hz), with a margin."""


@dataclass(frozen=True, slots=True)
class Sway:
    """A sum of sinusoids per axis; a function of time alone.

    Attributes:
        amplitude: of every sinusoid [m].
        omega: (2, TONES) angular frequencies [rad/s].
        phase: (2, TONES) [rad].
    """

    amplitude: float
    omega: Array
    phase: Array

    def offset(self, t: float) -> Array:
        """Return the (2,) displacement x, y from the undisturbed place at time `t` [s], in metres."""
        return self.amplitude * np.sin(self.omega * t + self.phase).sum(axis=1)


def draw_sway(radial_rms: float, rng: np.random.Generator) -> Sway:
    """Draw a sway whose radial displacement has the given RMS [m] over a long time."""
    omega = 2 * np.pi * rng.uniform(*BAND, size=(2, TONES))
    phase = rng.uniform(0, 2 * np.pi, size=(2, TONES))
    # Each of the 2 TONES sinusoids contributes amplitude^2 / 2 to the mean square radius.
    return Sway(radial_rms / np.sqrt(TONES), omega, phase)
