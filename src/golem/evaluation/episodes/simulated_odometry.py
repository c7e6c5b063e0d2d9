"""A stand-in for the LiDAR odometry that a later issue brings: a pose with the errors such a source has.

It is an error model, no sensor. With the source `estimator` it adds noise to what the base estimator says: drift and
all, nothing the robot could not know. With `truth` it adds the noise to where the robot really is, which is what a
LiDAR odometry without drift would tell; nothing measured with that says how well the robot finds its way by itself.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from golem.interfaces import topics
from golem.interfaces.payloads import Odometry
from golem.middleware.bus import Bus
from golem.robots.mujoco.engine import MujocoRobot

Source = Literal["estimator", "truth"]

POSITION_NOISE = 0.01
"""Standard deviation of x and of y [m]."""
YAW_NOISE = float(np.radians(1.0))
"""Standard deviation of the heading [rad]."""
PERIOD = 0.1
"""Time between two poses [s]: one turn of a LiDAR."""
LATENCY = 0.05
"""Time from a pose to its arrival [s]."""


class SimulatedOdometry:
    """Publishes `topics.ODOMETRY` for a twin; call it after every tick."""

    def __init__(self, bus: Bus, robot: MujocoRobot, source: Source, rng: np.random.Generator) -> None:
        """Tell `bus` where `robot` is by `source`, with independent noise of every pose drawn from `rng`."""
        self._bus, self._robot, self._source, self._rng = bus, robot, source, rng
        self._T_odom_world = np.linalg.inv(robot.truth.T_world_odom)
        self._next = 0.0

    @property
    def due(self) -> float:
        """When the next pose is due [s]."""
        return self._next

    def __call__(self, t: float) -> None:
        """Publish a pose, if one is due at time `t` [s]."""
        if t < self._next - 1e-9:
            return
        self._next = t + PERIOD
        dx, dy = self._rng.normal(0.0, POSITION_NOISE, 2)
        turn = self._rng.normal(0.0, YAW_NOISE)
        if self._source == "truth":
            T = self._T_odom_world @ self._robot.truth.base().T_world_base
        else:
            base = self._bus.latest(topics.BASE)
            if base is None:
                return
            T = base.T_odom_base.copy()
        c, s = np.cos(turn), np.sin(turn)
        noise = np.eye(3)
        noise[:2, :2] = ((c, -s), (s, c))
        T[:3, :3] = noise @ T[:3, :3]
        T[:2, 3] += (dx, dy)
        self._bus.publish(topics.ODOMETRY, Odometry(t, T), t, LATENCY)
