"""LiDAR-inertial odometry: an iterated error-state Kalman filter on a map of planes, and the legs.

After the publications of FAST-LIO (Xu and Zhang, RA-L 2021) for the filter, of VoxelMap (Yuan et al., RA-L 2022) for
the map, and of Zhang, Kaess and Singh (ICRA 2016) for directions that the scan does not fix; own code throughout.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from golem.capabilities.odometry import plane_map
from golem.capabilities.odometry.base import BLIND, BODY, Ignores, OdometryEstimate, Source, lidar_in_base, of_the_world
from golem.capabilities.odometry.error_state import GRAVITY_XY, SIZE, YAW, ErrorState, ImuNoise, about_z, cross, deskew
from golem.capabilities.odometry.plane_map import PlaneMap
from golem.capabilities.odometry.sensor_agreement import SensorAgreement, up_in_base
from golem.capabilities.odometry.still_start import MovingStart, StillStart
from golem.interfaces.lidar import LegOdometry, LidarImu, LidarScan
from golem.robots.model.spatial import skew
from golem.robots.sensors.mid360 import P_LIDAR_IMU
from golem.types import Array


@dataclass(frozen=True, slots=True)
class LioConfig:
    """Options of `Lio`.

    Attributes:
        imu: what the IMU is taken to be.
        stride: one point in so many is used.
        range_noise, direction_noise: standard deviations of a point [m], [rad].
        overconfidence: by how much the variance of a point is raised because the errors of a plane's points are not
            independent.
        iterations: most iterations of an update.
        blind: distance from the sensor within which a point is the robot's [m].
        body: corners of a box in base_link within which a point is the robot's [m]: x, y, z of one, then of the other.
        legs: whether to use the legs.
        leg_noise: standard deviation of their velocity [m/s].
        leg_direction: standard deviation of the direction of their velocity, which no walk averages out [rad].
        mount: standard deviation of the sensor's tilt on its mount, per axis [rad].
        heading: standard deviation of the base's heading beside the sensor's, by encoder and delay of the waist [rad].
        yaw: angle by which the sensor is turned about the base's vertical beside the model, by an earlier walk (see
            `Lio.sensor_yaw`) [rad]; how well it is known then is `imu.yaw`.
        leg_period: time between two velocities that are used [s].
        degenerate: share of all planes' normals along a direction below which the scan does not fix it.
        least_matched: share of the points in known voxels that must fit the planes, or the scan is not believed.
        lost_at: standard deviation of the place from which the odometry is lost [m].
        silent_at: time without a scan that fits from which it is lost [s].
        found_after: scans in a row that must fit before it speaks again.
    """

    imu: ImuNoise = field(default_factory=ImuNoise)
    stride: int = 4
    range_noise: float = 0.02
    direction_noise: float = 0.0026
    overconfidence: float = 10.0
    iterations: int = 4
    blind: float = BLIND
    body: tuple[float, float, float, float, float, float] = BODY
    legs: bool = True
    leg_noise: float = 0.05
    leg_direction: float = 0.006
    mount: float = 0.01
    heading: float = 0.001
    yaw: float = 0.0
    leg_period: float = 0.05
    degenerate: float = 0.02
    least_matched: float = 0.3
    lost_at: float = 0.5
    silent_at: float = 5.0
    found_after: int = 5


_ARM = -P_LIDAR_IMU
"""(3,) the LiDAR's origin in the frame of its IMU [m]."""
_SIZES = np.array(plane_map.SIZES)
_MATCHED = 100
"""Fewest points that make an update."""
WALKING = 0.1
"""Speed by the legs from which a robot does not stand [m/s]."""
KEPT = 2.0
"""Samples are kept for a scan of theirs for so many times `silent_at`; a scan that is older is left out [own]."""
_GAP = 0.1
"""Time between two IMU samples from which motion in between is not known [s]."""


class Lio(Ignores):
    """LiDAR-inertial odometry; see `LidarOdometry`.

    The filter stands at the end of the last scan. A second one runs ahead with every IMU sample; what it says is the
    estimate. A new scan moves the first one on with the samples kept since, and the second starts again from it.

    Attributes:
        degenerate: (3,) the direction in odom that the last scan did not fix; zero where it fixed all.
        matched: share of the points of the last scan in known voxels that fitted.
        map: the planes, in odom.
    """

    sources: tuple[Source, ...] = ("imu", "legs", "scan")

    def __init__(self, config: LioConfig | None = None) -> None:
        """Wait for the robot to stand still, or for its legs to say how it moves."""
        self.config = config or LioConfig()
        self.reset()

    def reset(self) -> None:
        self.map = PlaneMap()
        self.degenerate: Array = np.zeros(3)
        self.matched = 1.0
        self._start, self._moving = StillStart(), MovingStart()
        self._agree = SensorAgreement()
        self._legs: LegOdometry | None = None
        self._filter: ErrorState | None = None
        self._ahead: ErrorState | None = None
        self._buffer: deque[LidarImu | LegOdometry] = deque()
        self._frozen: NDArray[np.float32] | None = None
        self._waist = 0.0
        self._legs_used = -math.inf
        self._fitted_at = -math.inf
        self._fits = self.config.found_after
        self._lost = ""
        self._birth = 0.0

    def add_imu(self, sample: LidarImu) -> None:
        if not all(map(math.isfinite, [*sample.gyro.tolist(), *sample.acc.tolist(), sample.t])):
            return
        if self._ahead is None:
            legs = self._legs if self.config.legs else None
            walks = legs is not None and np.linalg.norm(legs.velocity) > WALKING
            begin = (None if walks else self._start.add(sample, self._waist)) or self._moving.add(sample, legs)
            if begin is not None and self._agree.stands(up_in_base(begin.R, self._waist), begin.force, sample.t):
                self._filter = ErrorState(sample.t, begin, self.config.yaw, self.config.imu)
                self._ahead = self._filter.copy()
                self._fitted_at = sample.t
            return
        if not self._agree.imu(sample, self._ahead.t):
            return
        self._buffer.append(sample)
        self._move(self._ahead, sample)
        self._judge(self._ahead)
        if sample.t - self._buffer[0].t > KEPT * self.config.silent_at:
            self._filter = self._ahead.copy()
            self._buffer.clear()

    def add_legs(self, legs: LegOdometry) -> None:
        if not all(map(math.isfinite, [*legs.velocity.tolist(), legs.waist])):
            return
        self._waist, self._legs = legs.waist, legs
        self._agree.legs(legs)
        if self._ahead is None or legs.stale or not self.config.legs:
            return
        if legs.t - self._legs_used < self.config.leg_period - 1e-6:
            return
        self._legs_used = legs.t
        self._buffer.append(legs)
        self._agree.velocity(self._walk(self._ahead, legs))

    def add_scan(self, scan: LidarScan) -> None:
        state = self._filter
        if state is None or self._ahead is None or not math.isfinite(scan.t):
            return
        if self._frozen is not None and np.array_equal(self._frozen, scan.points):
            return  # a driver that repeats itself under new stamps
        self._frozen = scan.points
        start = scan.t - scan.duration
        if not self._agree.scan(scan, self._ahead.t) or start < state.t - 1e-3:
            return  # of another clock or sensor, before the start, or out of order
        local = self._points(scan, start, self._advance(state, scan.t, start))
        if len(local):
            self._update(state, local)
        self._ahead = state.copy()
        for item in self._buffer:
            self._move(self._ahead, item) if isinstance(item, LidarImu) else self._walk(self._ahead, item)
        self._judge(self._ahead)

    @property
    def sensor_yaw(self) -> tuple[float, float]:
        """By what angle the sensor is turned about the base's vertical beside the model, and its deviation [rad]."""
        state = self._ahead
        if state is None:
            return self.config.yaw, self.config.imu.yaw
        return state.yaw, math.hypot(math.sqrt(state.P[YAW, YAW]), self.config.leg_direction)

    @property
    def why(self) -> str:
        """See `LidarOdometry`."""
        if self._agree.why:
            return self._agree.why
        if self._ahead is None:
            return "It waits for the LiDAR's IMU, and for a robot that stands still or whose legs tell how it moves."
        if self._lost:
            return self._lost
        return "" if self._fits >= self.config.found_after else "The scans do not fit the map."

    def estimate(self) -> OdometryEstimate | None:
        state = self._ahead
        if state is None or self.why:
            return None
        # The start's frame took the sensor for what the model says, and its first second for level; odom is level by
        # what is known now, and heads along x of the base that began.
        turn, Z = about_z(state.yaw), about_z(state.yaw) @ state.level()
        T_base_lidar = lidar_in_base(self._waist)
        T_base_lidar[:3] = turn @ T_base_lidar[:3]
        R_base_imu = T_base_lidar[:3, :3]
        arm = R_base_imu @ P_LIDAR_IMU + T_base_lidar[:3, 3]
        T = np.eye(4)
        T[:3, :3] = Z @ state.R @ R_base_imu.T
        T[:3, 3] = Z @ state.p - T[:3, :3] @ arm
        rate = R_base_imu @ state.rate()
        # Error of the pose of base_link: the place's, the turn's seen in odom, and the turn's over the lever arm.
        J = np.zeros((6, SIZE))
        J[3:, :3] = Z @ state.R
        J[:3, :3] = skew(T[:3, :3] @ arm) @ Z @ state.R
        J[:3, 3:6] = Z
        J[:2, YAW] = -T[1, 3], T[0, 3]
        J[3:, YAW] = np.array([0.0, 0.0, 1.0]) - T[:3, 2]
        J[3:, GRAVITY_XY] = tilt = turn @ state.level_error()
        J[:3, GRAVITY_XY] = -skew(T[:3, 3]) @ tilt
        covariance = J @ state.P @ J.T
        covariance[:3, :3] += self._birth * np.eye(3)
        self._add_what_the_filter_does_not_know(covariance, T, arm)
        velocity = Z @ state.v + T[:3, :3] @ cross(rate, -arm)
        return OdometryEstimate(state.t, T, velocity, rate, covariance, T_base_lidar)

    def _add_what_the_filter_does_not_know(self, covariance: Array, T: Array, arm: Array) -> None:
        """Add the errors of model and legs to the (6, 6) covariance of the pose `T` (4, 4); `arm` (3,) [m]."""
        config = self.config
        # The legs are zeroed with errors of their own, which no walk averages out.
        beside = np.array([-T[1, 3], T[0, 3], 0.0, 0.0, 0.0, 0.0])
        covariance += config.leg_direction**2 * np.outer(beside, beside)
        covariance[[3, 4, 5], [3, 4, 5]] += np.array([config.mount, config.mount, config.heading]) ** 2
        # A tilted mount puts base_link beside its place, always to the same side of it: seen once it has turned.
        turned = 2.0 - T[0, 0] - T[1, 1]
        covariance[[0, 1], [0, 1]] += max(turned, 0.0) * (config.mount * arm[2]) ** 2

    def _move(self, state: ErrorState, sample: LidarImu) -> None:
        dt = sample.t - state.t
        if dt <= 0.0:
            return
        if dt > _GAP:  # nothing is known of the motion meanwhile, up to a walking robot's
            state.P[3:6, 3:6] += (0.5 * dt) ** 2 * np.eye(3)
            state.P[6:9, 6:9] += 0.25 * np.eye(3)
            state.P[:3, :3] += (0.5 * dt) ** 2 * np.eye(3)
            state.t = sample.t - 0.005
        state.predict(sample.t, sample.gyro, sample.acc)

    def _walk(self, state: ErrorState, legs: LegOdometry) -> bool:
        T_base_lidar = lidar_in_base(legs.waist)
        R_base_imu = T_base_lidar[:3, :3]
        arm = -(R_base_imu.T @ T_base_lidar[:3, 3] + P_LIDAR_IMU)
        return state.update_velocity(legs.velocity, R_base_imu, arm, self.config.leg_noise)

    def _advance(self, state: ErrorState, end: float, start: float) -> list[tuple[float, Array, Array, Array, Array]]:
        """Move `state` to the time `end` of a scan, and return its motion since `start`: t, R, p, v, rate."""
        track = [(state.t, state.R.copy(), state.p.copy(), state.v.copy(), state.rate())]
        while self._buffer and self._buffer[0].t <= end + 1e-6:
            item = self._buffer.popleft()
            if isinstance(item, LegOdometry):
                self._walk(state, item)
                continue
            self._move(state, item)
            if state.t < start - 1e-9:
                track.clear()
            track.append((state.t, state.R.copy(), state.p.copy(), state.v.copy(), state.rate()))
        return track

    def _points(self, scan: LidarScan, start: float, track: list[tuple[float, Array, Array, Array, Array]]) -> Array:
        """Return (n, 3) the points of a scan that are not the robot's, in the frame of the IMU at its end [m]."""
        if len(track) < 2:
            return np.zeros((0, 3))
        # Those that are none are left out first: a sensor that loses every second one would lose all that are used.
        used = np.flatnonzero(np.isfinite(scan.points).all(axis=1) & np.isfinite(scan.offsets))
        used = used[:: self.config.stride]
        points, offsets = scan.points[used].astype(np.float64), scan.offsets[used].astype(np.float64)
        config, T_base_lidar = self.config, lidar_in_base(self._waist)
        good = np.flatnonzero(of_the_world(points, T_base_lidar, config.blind, config.body))
        t, R, p, v, rate = (np.array(column) for column in zip(*track, strict=True))
        # The rate of an interval is that of the sample at its end.
        rate = np.concatenate([rate[1:], rate[-1:]])
        return deskew(points[good], start + offsets[good], t, R, p, v, rate, _ARM)

    def _update(self, state: ErrorState, local: Array) -> None:
        """Correct `state` by the points of a scan, in the IMU's frame, and add them to the map."""
        config = self.config
        if not len(self.map):
            self.map.insert(local @ state.R.T + state.p, 0.0)
            self._fitted_at = state.t
            return
        noise = np.array([config.range_noise**2, config.direction_noise**2, config.overconfidence])
        prior = state.copy()
        information = np.linalg.inv(prior.P)
        A, b, N, told, blind = np.zeros((6, 6)), np.zeros(6), np.zeros((3, 3)), np.zeros(4), np.zeros(3)
        P6: Array = np.ascontiguousarray(prior.P[:6, :6])
        fits = False
        for iteration in range(config.iterations):
            cells, result = (self.map.keys, self.map.cells, _SIZES), (A, b, N, told)
            plane_map.accumulate(local, state.R, state.p, P6, *cells, noise, blind, *result)
            if iteration == 0:
                fits = told[1] > _MATCHED and told[1] > config.least_matched * told[0]
                self.matched = float(told[1] / max(told[0], 1.0))
                if not fits:
                    break
                blind = _unfixed(N / told[1], config.degenerate)
                if blind.any():
                    continue
            whole = information.copy()
            whole[:6, :6] += A
            error = -information @ state.minus(prior)
            error[:6] -= b
            step: Array = np.linalg.solve(whole, error).astype(np.float64)
            state.add(step)
            P6 = np.ascontiguousarray(np.linalg.inv(whole)[:6, :6], dtype=np.float64)
            if np.abs(step[:3]).max() < 1e-4 and np.abs(step[3:6]).max() < 5e-4:
                break
        if not fits:
            self._fits = 0
            return
        self._fits = min(self._fits + 1, config.found_after)
        self._fitted_at = state.t
        self.degenerate = blind
        state.P = np.linalg.inv(whole).astype(np.float64)
        if blind.any():
            _learn_nothing(state.P, prior.P, blind)
        self._birth = float(told[2] / told[1])
        if self._fits >= config.found_after:
            self.map.insert(local @ state.R.T + state.p, self._birth + float(np.trace(state.P[3:6, 3:6])) / 3.0)

    def _judge(self, state: ErrorState) -> None:
        spread = math.sqrt(max(float(state.P[3, 3]), float(state.P[4, 4]), float(state.P[5, 5])))
        age = state.t - self._fitted_at
        if age > self.config.silent_at:
            self._lost, self._fits = f"No scan has fitted the map for {age:.1f} s.", 0
        elif spread > self.config.lost_at:
            self._lost, self._fits = f"The place is only known to {spread:.2f} m.", 0
        elif self._fits >= self.config.found_after:
            self._lost = ""


def _unfixed(normals: Array, least: float) -> Array:
    """Return the (3,) direction along which the mean (3, 3) of n n^T, upper triangle, is below `least`; else zero."""
    values, vectors = np.linalg.eigh(normals, UPLO="U")
    return vectors[:, 0] if values[0] < least else np.zeros(3)


def _learn_nothing(P: Array, before: Array, direction: Array) -> None:
    """Give the covariance `P` (18, 18) the place's and the velocity's variance along `direction` that it had before.

    The blind direction is found anew in every scan, some hundredths of a radian off. What the planes fix beside it
    would leak into the true one, scan by scan, and the odometry would be sure of a place that it does not know.
    """
    for first in (3, 6):
        v = np.zeros(SIZE)
        v[first : first + 3] = direction
        P += max(float(v @ (before - P) @ v), 0.0) * np.outer(v, v)
