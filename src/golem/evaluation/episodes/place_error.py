"""How far a robot is from where it believes to be."""

from __future__ import annotations

import math

from golem.interfaces import topics
from golem.middleware.bus import Bus
from golem.robots.mujoco.engine import MujocoRobot
from golem.types import PlanarPose


def place_error(bus: Bus, robot: MujocoRobot) -> float:
    """Return how far the robot is from where map and odometry have it [m]; 0 where neither says."""
    believed, place = bus.latest(topics.ODOMETRY), bus.latest(topics.MAP_POSE)
    if believed is None or place is None:
        return 0.0
    off = robot.truth.pose().to(place.T_odom_map.to(PlanarPose.of(believed.T_odom_base)))
    return math.hypot(off.x, off.y)
