"""Recorded walks for judging odometry: what the legs said, and all that a LiDAR on the robot would have seen."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from golem.capabilities.odometry.base import OdometryEstimate
from golem.evaluation.base import Onlooker, TrialSpec
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


def record_walk(spec: TrialSpec, route: Route, people: int, legs: str, onlooker: Onlooker | None = None) -> LidarWalk:
    """Let the robot of a trial walk a route, its arms moving. Raises ConfigError: a name is wrong.

    Args:
        spec: the estimator is `ESTIMATOR` where its overrides name none.
        people: how many walk around it.
        legs: lower body.
        onlooker: is shown the stack.
    """
    own = episode_seed(spec.seed, spec.index)
    plant = {"world": WORLDS[route], "people": people}
    stack = legs_stack(legs, spec.profile, {"estimator": ESTIMATOR, **spec.overrides}, plant)
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

    with closing(episode):
        # An odometry finds its level and its biases at rest: neither legs nor arms move before.
        episode.run(START, sample)
        walking = True
        episode.start(ScriptedMotion(ArmMotion(stream(own, "walk/arms")), twist))
        length = float(np.abs(np.diff([(0.0, 0.0), *ROUTES[route]], axis=0)).sum())
        episode.run(length / SLOWEST + 10.0, sample)
        episode.run(REST, sample)
        loss = episode.loss
    t, qpos, qvel, T = (np.array([row[i] for row in rows]) for i in (0, 1, 2, 4))
    commands = [row[3] for row in rows]
    lost = loss.detail if loss is not None else "" if pilot.done else "It did not get to the end of its route."
    return LidarWalk(own, spec.profile, episode.robot.scene, t, qpos, qvel, commands, T, lost)


ANCHOR = 1.0
"""Time over whose mean odometry and truth are laid on one another [s]."""


@dataclass(frozen=True, slots=True)
class PoseTrack:
    """What an odometry said after every scan, where it said anything, and what was true then.

    Attributes:
        t: (n,) times [s].
        T: (n, 4, 4) poses of base_link by the odometry.
        covariance: (n, 6, 6) of them.
        true: (n, 4, 4) true poses.
    """

    t: Array
    T: Array
    covariance: Array
    true: Array

    @classmethod
    def of(cls, told: list[tuple[OdometryEstimate, Array]]) -> PoseTrack:
        """Return the track of estimates, each with the true (4, 4) pose of its time."""
        return cls(
            np.array([e.t for e, _ in told]),
            np.array([e.T_odom_base for e, _ in told]),
            np.array([e.covariance for e, _ in told]),
            np.array([true for _, true in told]),
        )

    def anchored(self, until: float) -> PoseTrack:
        """Return the track with odometry and truth each in the frame of its mean pose on the floor before a time.

        The mean is over the last second before `until` [s], or over the first second that there is.
        """
        first = self.t[0]
        at: NDArray[np.bool_] = (self.t > until - ANCHOR) & (self.t <= until)
        if not at.any():
            at = self.t <= first + ANCHOR
        own, true = (_in_mean(T, at) for T in (self.T, self.true))
        turn = np.zeros((6, 6))
        R = own[0][:3, :3] @ self.T[0][:3, :3].T
        turn[:3, :3] = turn[3:, 3:] = R
        return PoseTrack(self.t, own, turn @ self.covariance @ turn.T, true)


def ate(track: PoseTrack) -> float:
    """Return the absolute trajectory error [m]: the RMS of the distance after the best rigid alignment."""
    own, true = track.T[:, :3, 3], track.true[:, :3, 3]
    a, b = own - own.mean(axis=0), true - true.mean(axis=0)
    u, _, vt = np.linalg.svd(b.T @ a)
    R = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
    return float(np.sqrt((((a @ R.T) - b) ** 2).sum(axis=1).mean()))


def end_error(track: PoseTrack) -> tuple[float, float, float]:
    """Return how far an anchored track ends beside the truth on the floor [m], above it [m], and in heading [rad]."""
    off = track.T[-1, :3, 3] - track.true[-1, :3, 3]
    own, true = (PlanarPose.of(T[-1]) for T in (track.T, track.true))
    return float(np.hypot(off[0], off[1])), float(off[2]), math.remainder(own.yaw - true.yaw, math.tau)


def range_and_bearing(track: PoseTrack) -> tuple[float, float] | None:
    """Return how much too far from its beginning an anchored track ends [m], and in a direction how much off [rad].

    How far it is needs no direction ahead; the other error says how well that of base_link was known at the beginning.
    None for a walk that ends where it began, whose end has no direction.
    """
    own, true = (complex(*T[-1, :2, 3]) for T in (track.T, track.true))
    return None if abs(true) < 1.0 or not own else (abs(own) - abs(true), cmath.phase(own / true))


def nees(track: PoseTrack, since: float) -> tuple[float, float] | None:
    """Return the mean squared error of an anchored track over its covariance, per degree of freedom.

    Args:
        since: time from which it counts [s].

    Returns:
        Of the place, and of the heading: 1 where the covariance is honest, more where it is too small. None where there
        is no covariance.
    """
    chosen = (track.t >= since) & np.isfinite(track.covariance).all(axis=(1, 2))
    if not chosen.any():
        return None
    T, true, P = track.T[chosen], track.true[chosen], track.covariance[chosen]
    off = T[:, :3, 3] - true[:, :3, 3]
    R = T[:, :3, :3] @ true[:, :3, :3].transpose(0, 2, 1)
    heading = Rotation.from_matrix(R).as_rotvec()[:, 2]
    place = np.einsum("ni,nij,nj->n", off, np.linalg.inv(P[:, :3, :3]), off) / 3.0
    return float(place.mean()), float((heading**2 / P[:, 5, 5]).mean())


def _in_mean(T: Array, chosen: NDArray[np.bool_]) -> Array:
    """Return poses (n, 4, 4) in the level frame of the mean place and heading of those `chosen`."""
    first = T[chosen]
    xyz, yaw = first[:, :3, 3].mean(axis=0), np.arctan2(first[:, 1, 0], first[:, 0, 0])
    heading = math.atan2(np.sin(yaw).mean(), np.cos(yaw).mean())
    frame = PlanarPose(float(xyz[0]), float(xyz[1]), heading).matrix()
    frame[2, 3] = xyz[2]
    return np.linalg.inv(frame) @ T
