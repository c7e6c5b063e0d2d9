"""Where a foot that is about to land belongs, so that the next step carries the robot on: by its capture point.

The robot is taken for a linear inverted pendulum on the foot that stands. Its capture point (divergent component of
motion) runs away from that foot as exp(omega t). Walking goes on as commanded if the other foot lands at an offset from
where the capture point will be then (Khadiv et al., "Step timing adjustment", 2016, equations 5 and 6). After a push
this is where the robot has to step, wherever the command points.
"""

from __future__ import annotations

import numpy as np

from golem.capabilities.legs.balance_errors import heading_frame
from golem.capabilities.legs.gait import Gait
from golem.training.legs.batch_world import BatchTruth
from golem.training.legs.training_model import FEET_APART, STAND_HEIGHT
from golem.types import GRAVITY, Array

OMEGA = float(np.sqrt(GRAVITY / STAND_HEIGHT))
"""Rate at which the pendulum falls over [1/s]."""
SIDE = np.array([1.0, -1.0])
"""Left and right along y."""
REACH = 0.5
"""Farthest that a foot lands ahead of or behind the other one [m]."""
APART = (0.16, 0.55)
"""Least and largest distance of the feet to the side when one lands [m]: less, and a leg meets the other one."""


def landing_errors(truth: BatchTruth, twist: Array, gait: Gait) -> Array:
    """Return (n, 2): how far each sole is from where it belongs when it lands next [m]; heading frame.

    It means something for a foot in the second half of its swing.

    Args:
        truth: of the robots.
        twist: (n, 3) command [m/s, m/s, rad/s].
        gait: the clocks.
    """
    heading = heading_frame(truth.R)
    spin = np.einsum("nij,nj->ni", truth.R, truth.rate)
    velocity = truth.velocity + np.cross(spin, truth.com)
    point = truth.com[:, :2] + velocity[:, :2] / OMEGA
    into = np.swapaxes(heading, -1, -2)[:, None]
    soles = np.einsum("nkij,nkj->nki", np.broadcast_to(into, (len(twist), 2, 2, 2)), truth.soles[:, :, :2])
    capture = np.einsum("nij,nj->ni", into[:, 0], point)[:, None]
    standing = soles[:, ::-1]
    left = np.clip(1.0 - gait.phases, 0.0, 1.0 - gait.config.stance) * gait.config.period
    later = standing + (capture - standing) * np.exp(OMEGA * left)[..., None]
    step = 0.5 * gait.config.period
    growth = float(np.exp(OMEGA * step))
    target = later - (twist[:, None, :2] * step) / (growth - 1.0)
    target[..., 1] += SIDE * FEET_APART[1] / (growth + 1.0)
    relative = target - standing
    ahead = np.clip(relative[..., 0], -REACH, REACH)
    sideways = SIDE * np.clip(SIDE * relative[..., 1], *APART)
    return np.linalg.norm(soles - standing - np.stack([ahead, sideways], axis=-1), axis=-1)
