"""Odometry from outside of this stack: whatever somebody publishes as nav_msgs/Odometry, FAST-LIO for one."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from golem.capabilities.odometry.base import NO_COVARIANCE, Ignores, OdometryEstimate, OdomOrigin, Source, lidar_in_base
from golem.errors import ConfigError
from golem.interfaces.lidar import ExternalOdometry, LegOdometry
from golem.robots.model.spatial import transform
from golem.robots.sensors.mid360 import P_LIDAR_IMU
from golem.types import Array

SPEED, TURNING = 3.0, 5.0
"""What no walking robot does: it is refused [m/s, rad/s] [own]."""
JUMP, TURN = 0.2, 0.3
"""By how much a pose may be off beside that [m, rad] [own]: a SLAM corrects itself."""
WINDOW = 0.2
"""Time over which poses are compared [s] [own]; also the most for which a gap excuses a way."""
UPRIGHT = 0.5
"""Least cosine of the base's tilt: 60 degrees [own]; a robot that tilts so has fallen."""
CHILDREN = ("base_link", "lidar", "lidar_imu")
"""What an odometry may follow."""


@dataclass(frozen=True, slots=True)
class ExternalTopicConfig:
    """Options of `ExternalTopic`.

    Attributes:
        child: what it follows: base_link, lidar, or the IMU inside the LiDAR (lidar_imu), as FAST-LIO does.
        level: whether its frame is level. That of FAST-LIO is the frame in which its IMU began, which is not: its first
            pose is then taken for that of a robot that stands upright.
        silent_after: age of the newest message, by the legs' clock, at which it is silent [s].
    """

    child: str = "lidar_imu"
    level: bool = False
    silent_after: float = 0.5


class ExternalTopic(Ignores):
    """What is published on /Odometry; see `LidarOdometry`.

    What no robot does is refused: a pose that is tilted by 60 degrees, or that the last one cannot have led to. After a
    jump the odometry stays silent until it is back, or `reset`: where the robot is in odom, nobody knows.
    """

    sources: tuple[Source, ...] = ("external",)

    def __init__(self, config: ExternalTopicConfig | None = None) -> None:
        """Wait for the first message. Raises ConfigError: `child` is none of `CHILDREN`."""
        self.config = config or ExternalTopicConfig()
        if self.config.child not in CHILDREN:
            raise ConfigError(
                f"The child of odometry topic is one of {', '.join(CHILDREN)}, not '{self.config.child}'."
            )
        self.reset()

    def reset(self) -> None:
        self._origin = OdomOrigin()
        self._T_level_frame: Array | None = None
        self._waist, self._now = 0.0, -np.inf
        self._newest: OdometryEstimate | None = None
        self._recent: deque[tuple[float, Array]] = deque()
        self._refused = ""

    @property
    def why(self) -> str:
        """See `LidarOdometry`."""
        if self._refused:
            return f"What comes on /Odometry {self._refused}: it is not believed."
        if self._newest is None:
            return "Nothing has come on /Odometry."
        age = self._now - self._newest.t
        return f"Nothing has come on /Odometry for {age:.1f} s." if age > self.config.silent_after else ""

    def add_legs(self, legs: LegOdometry) -> None:
        if np.isfinite([legs.t, legs.waist]).all():
            self._waist, self._now = legs.waist, legs.t

    def add_external(self, odometry: ExternalOdometry) -> None:
        numbers = (odometry.T_frame_child.ravel(), odometry.velocity, odometry.rate, [odometry.t])
        if not np.isfinite(np.concatenate(numbers)).all():
            return
        if self._newest is not None and odometry.t <= self._newest.t:
            return
        T_base_child = self._child()
        if self._T_level_frame is None:
            upright = T_base_child @ np.linalg.inv(odometry.T_frame_child)
            self._T_level_frame = np.eye(4) if self.config.level else upright
        T = self._T_level_frame @ odometry.T_frame_child @ np.linalg.inv(T_base_child)
        while len(self._recent) > 1 and odometry.t - self._recent[0][0] > WINDOW:
            self._recent.popleft()
        why = self._impossible(odometry, T)
        self._refused = why and (self._refused or why)  # the first says what happened
        if why:
            return
        self._recent.append((odometry.t, T))
        T = self._origin(T)
        R = T_base_child[:3, :3]
        rate = R @ odometry.rate
        velocity = R @ odometry.velocity - np.cross(rate, T_base_child[:3, 3])
        self._newest = OdometryEstimate(
            odometry.t, T, T[:3, :3] @ velocity, rate, NO_COVARIANCE, lidar_in_base(self._waist)
        )

    def estimate(self) -> OdometryEstimate | None:
        return None if self.why else self._newest

    def _impossible(self, odometry: ExternalOdometry, T: Array) -> str:
        """Return what no robot can do about a message and its pose of the base (4, 4) in a level frame; else empty."""
        if T[2, 2] < UPRIGHT:
            return f"has the robot tilted by {np.degrees(np.arccos(np.clip(T[2, 2], -1.0, 1.0))):.0f} degrees"
        speed = float(np.linalg.norm(odometry.velocity))
        if speed > SPEED or np.linalg.norm(odometry.rate) > TURNING:
            return f"has the robot move at {speed:.1f} m/s and {np.linalg.norm(odometry.rate):.1f} rad/s"
        for t, before in (self._recent[-1], self._recent[0]) if self._recent else ():
            dt = odometry.t - t
            way = float(np.linalg.norm(T[:3, 3] - before[:3, 3]))
            turned = float(np.arccos(np.clip(0.5 * (np.sum(before[:3, :3] * T[:3, :3]) - 1.0), -1.0, 1.0)))
            if way > JUMP + SPEED * min(dt, WINDOW) or turned > TURN + TURNING * min(dt, WINDOW):
                return f"has moved the robot {way:.2f} m and {turned:.1f} rad in {dt:.2f} s"
        return ""

    def _child(self) -> Array:
        """Return the (4, 4) pose in base_link of what the odometry follows."""
        if self.config.child == "base_link":
            return np.eye(4)
        T = lidar_in_base(self._waist)
        return T if self.config.child == "lidar" else T @ transform(P_LIDAR_IMU)
