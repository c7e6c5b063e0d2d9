"""Joint limits as arrays in motor order, with named profiles for the disputed torque limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from golem.errors import unknown_name
from golem.robots.model.table import JOINTS
from golem.types import Array

TORQUE_PROFILES = ("urdf", "paper")
"""Sources of the torque limits: `urdf`, the vendor's, the lower for every joint; `paper`, the GOLEM paper's, up to
6.7 times higher (elbow 120 against 18 N m)."""


@dataclass(frozen=True, slots=True)
class Limits:
    """What the body's joints may do, each array (27,) in motor order, full vendor values without a safety factor.

    Attributes:
        lower, upper: range [rad].
        velocity: magnitude [rad/s].
        torque: magnitude [N m].
    """

    lower: Array
    upper: Array
    velocity: Array
    torque: Array


def load_limits(profile: str = "urdf") -> Limits:
    """Return the limits of the 27 joints.

    Args:
        profile: `"urdf"` or `"paper"`, which differ in the torque only.

    Raises:
        ConfigError: no such profile.
    """
    if profile not in TORQUE_PROFILES:
        raise unknown_name("torque limit profile", profile, TORQUE_PROFILES)
    torque = [j.torque[profile] for j in JOINTS]
    return Limits(
        lower=np.array([j.lower for j in JOINTS]),
        upper=np.array([j.upper for j in JOINTS]),
        velocity=np.array([j.velocity for j in JOINTS]),
        torque=np.array(torque),
    )
