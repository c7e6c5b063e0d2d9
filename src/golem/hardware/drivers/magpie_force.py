"""The force law of the MAGPIE hand's servos: load of an AX-12A <-> force of one finger.

Measured by the lab (its driver magpie_control), F in N, L the load or torque limit, 0 to 1023:

    F = 0.0025 L - 7e-7 L^2                          for L < 100
    F = -1.889e-5 L^2 + 0.038399 L - 3.4073          from there on

The second parabola has its top, 16.1 N, at L = 1016; from there on F stays at it, so that the law is monotone.
"""

from __future__ import annotations

import math

from golem.robots.model.magpie_model import MAX_FORCE

KNEE = 100
"""Load at which one law gives way to the other."""
_A, _B, _C = -1.889e-5, 0.038399, -3.4073
_TOP = -_B / (2.0 * _A)
_LOW_A, _LOW_B = -7e-7, 0.0025


def force_from_load(load: float) -> float:
    """Return the force of one finger [N] at a load of 0 to 1023; no less for more load, and at most `MAX_FORCE`."""
    if load < KNEE:
        return (_LOW_A * load + _LOW_B) * load
    load = min(load, _TOP)
    return min((_A * load + _B) * load + _C, MAX_FORCE)


def load_from_force(force: float) -> int:
    """Return the torque limit, 0 to 1023, whose force is nearest to `force` [N], 0 to `MAX_FORCE`."""
    if force < force_from_load(KNEE):
        exact = (-_LOW_B + math.sqrt(_LOW_B**2 + 4.0 * _LOW_A * force)) / (2.0 * _LOW_A)
    else:
        exact = (-_B + math.sqrt(max(_B**2 - 4.0 * _A * (_C - force), 0.0))) / (2.0 * _A)
    below = math.floor(exact)
    return min((below, below + 1), key=lambda load: abs(force_from_load(load) - force))
