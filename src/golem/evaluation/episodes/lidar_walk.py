"""Recorded walks for judging odometry: what the legs said, and all that a LiDAR on the robot would have seen."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass
from typing import Literal

import numpy as np

from golem.errors import ConfigError
from golem.evaluation.base import Onlooker
from golem.evaluation.episodes.episode import Episode, episode_seed, legs_stack
from golem.evaluation.episodes.scripted_motion import ArmMotion, ScriptedMotion
from golem.interfaces import topics
from golem.interfaces.lidar import LegOdometry, LidarImu, LidarScan
from golem.robots.model.imu_mount import sensed_base_rate
from golem.robots.model.table import JOINT_INDEX
from golem.robots.mujoco.lidar_sensor import LidarMoment, LidarSensor
from golem.robots.mujoco.scene import Scene
from golem.robots.sensors.streams import stream
from golem.types import Array, PlanarPose, Twist

Route = Literal["line", "loop", "corridor"]

START = 4.0
"""Time the robot stands before it walks [s]."""
REST = 1.5
"""Time it stands at the end [s]."""
SPEED = 0.5
"""Forward speed of a walk [m/s]."""
NEAR = 0.25
"""Distance at which a corner of the route counts as passed [m]."""
SLOWEST = 0.2
"""Mean speed below which a walk is given up [m/s]."""
ESTIMATOR = "invariant_ekf"
"""Who says what the legs say."""
_WAIST = JOINT_INDEX["torso_joint"]

WORLDS: dict[Route, str] = {"line": "furnished", "loop": "furnished", "corridor": "corridor"}
ROUTES: dict[Route, tuple[tuple[float, float], ...]] = {
    "line": ((6.0, 0.0),),
    "loop": ((6.0, 0.0), (6.0, 2.4), (0.0, 2.4), (0.0, 0.0)) * 3 + ((6.0, 0.0), (6.0, 2.4), (4.8, 2.4)),
    "corridor": ((20.0, 0.0),),
}
"""Corners of every route, from the origin [m]: 6 m straight, 60 m with 14 turns, 20 m straight."""


@dataclass(frozen=True, slots=True)
class LidarWalk:
    """One recorded walk: n moments of 2 ms.

    Attributes:
        seed: of world and sensors.
        profile: realism profile.
        scene: world and robot.
        t: (n,) time [s].
        qpos, qvel: (n, ...) states of the twin.
        legs: what the base estimator said.
        T: (n, 4, 4) true pose of base_link in odom.
        lost: how the robot was lost, empty if it was not.
    """

    seed: int
    profile: str
    scene: Scene
    t: Array
    qpos: Array
    qvel: Array
    legs: list[LegOdometry]
    T: Array
    lost: str

    @property
    def distance(self) -> float:
        """Length of the way [m]; sampled once a second, since the sway of walking is no way."""
        return float(np.linalg.norm(np.diff(self.T[::500, :2, 3], axis=0), axis=1).sum())

    def true_pose(self, t: float) -> Array:
        """Return the (4, 4) true pose of base_link in odom at the moment next to time `t` [s]."""
        return self.T[min(int(round((t - self.t[0]) / 0.002)), len(self.T) - 1)]

    def play(
        self, *, mount: Array | None = None, dropout: float | None = None
    ) -> Iterator[LidarImu | LegOdometry | LidarScan]:
        """Yield what LiDAR and legs said in the order of arrival; for the arguments see `LidarSensor`."""
        with closing(LidarSensor(self.scene, self.profile, self.seed, mount=mount, dropout=dropout)) as sensor:
            for t, qpos, qvel, legs in zip(self.t.tolist(), self.qpos, self.qvel, self.legs, strict=True):
                sensor.observe(LidarMoment(t, qpos, qvel))
                yield from sensor.read_imu()
                yield legs
                if (scan := sensor.read_scan(t)) is not None:
                    yield scan


class Pilot:
    """Somebody with a joystick who sees the robot: walks it along the corners of a route, by the truth."""

    def __init__(self, corners: tuple[tuple[float, float], ...]) -> None:
        """Begin at the origin of odom, with the first corner ahead."""
        self._corners = list(corners)

    @property
    def done(self) -> bool:
        """Whether every corner was passed."""
        return not self._corners

    def steer(self, at: PlanarPose) -> Twist:
        """Return what to do at a pose."""
        if self.done:
            return Twist()
        x, y = self._corners[0]
        left = at.to(PlanarPose(x, y, 0.0))
        distance, bearing = math.hypot(left.x, left.y), math.atan2(left.y, left.x)
        if distance < NEAR:
            self._corners.pop(0)
        if abs(bearing) > 0.5 and distance >= NEAR:
            return Twist(0.0, 0.0, math.copysign(0.5, bearing))
        return Twist(SPEED, 0.0, float(np.clip(1.5 * bearing, -0.4, 0.4)))


def record_walk(
    route: Route,
    index: int,
    *,
    seed: int = 0,
    profile: str = "field",
    legs: str = "almi",
    people: int = 0,
    overrides: Mapping[str, str] | None = None,
    onlooker: Onlooker | None = None,
) -> LidarWalk:
    """Let the robot walk a route, its arms moving.

    Args:
        route: where.
        index: number of the walk.
        seed: seed of all walks.
        profile: realism profile.
        legs: lower body.
        people: how many walk around it.
        overrides: stack slot -> implementation; the estimator is `ESTIMATOR` where it names none.
        onlooker: is shown the stack.

    Raises:
        ConfigError: a name is wrong.
    """
    if route not in ROUTES:
        raise ConfigError(f"There is no route '{route}'; choose from {', '.join(ROUTES)}.")
    own = episode_seed(seed, index)
    plant = {"world": WORLDS[route], "people": people}
    stack = legs_stack(legs, profile, {"estimator": ESTIMATOR, **(overrides or {})}, plant)
    episode = Episode(stack, own, onlooker)
    truth, data = episode.robot.truth, episode.robot.data
    T_odom_world = np.linalg.inv(truth.T_world_odom)
    pilot = Pilot(ROUTES[route])
    rows: list[tuple[float, Array, Array, LegOdometry, Array]] = []
    walking = False

    def pose() -> Array:
        return T_odom_world @ truth.base().T_world_base

    def twist(t: float) -> Twist:
        return pilot.steer(PlanarPose.of(rows[-1][4]))

    def sample() -> bool:
        # The state now and what was estimated last: of the tick before, which is what the estimator could know.
        base, state = episode.running.bus.latest(topics.BASE), episode.running.bus.latest(topics.LOW_STATE)
        if base is None or state is None or (rows and episode.t <= rows[-1][0] + 1e-9):
            return False
        T = base.T_odom_base
        v, rate = T[:3, :3].T @ base.velocity, sensed_base_rate(state)
        legs = LegOdometry(episode.t, T, v, float(state.q[_WAIST]), base.stale, rate)
        rows.append((episode.t, data.qpos.copy(), data.qvel.copy(), legs, pose()))
        return walking and pilot.done

    try:
        # An odometry finds its level and its biases at rest: neither legs nor arms move before.
        episode.run(START, sample)
        walking = True
        episode.start(ScriptedMotion(ArmMotion(stream(own, "walk/arms")), twist))
        length = float(np.abs(np.diff([(0.0, 0.0), *ROUTES[route]], axis=0)).sum())
        episode.run(length / SLOWEST + 10.0, sample)
        episode.run(REST, sample)
        loss = episode.loss
    finally:
        episode.close()
    t, qpos, qvel, T = (np.array([row[i] for row in rows]) for i in (0, 1, 2, 4))
    commands = [row[3] for row in rows]
    lost = loss.detail if loss is not None else "" if pilot.done else "It did not get to the end of its route."
    return LidarWalk(own, profile, episode.robot.scene, t, qpos, qvel, commands, T, lost)
