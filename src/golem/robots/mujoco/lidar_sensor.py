"""The MID-360 on the twin: rays from where it was at each point's own time, cast beside the control loop."""

from __future__ import annotations

import copy
import math
from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from golem.interfaces.lidar import LidarImu, LidarScan
from golem.kernels import njit
from golem.robots.model.imu_mount import torso_motion
from golem.robots.model.table import BASE_LINK, FRAMES
from golem.robots.mujoco.ray_kernel import KNOWN, carried, cast, shaken
from golem.robots.mujoco.scene import Scene
from golem.robots.sensors import mid360
from golem.robots.sensors.imu import ImuModel
from golem.robots.sensors.streams import stream
from golem.robots.worlds.parts import COLLISION_GROUP
from golem.types import Array


@njit(cache=True, nogil=True, error_model="numpy")
def turned(q: Array, rotvec: Array) -> Array:
    """Return the orientation (4,) after the turn `rotvec` (3,) [rad], which is given in the axes of `q` (4,)."""
    angle = math.sqrt(rotvec[0] ** 2 + rotvec[1] ** 2 + rotvec[2] ** 2)
    scale = 0.5 if angle < 1e-9 else math.sin(0.5 * angle) / angle
    c, x, y, z = math.cos(0.5 * angle), scale * rotvec[0], scale * rotvec[1], scale * rotvec[2]
    out = np.empty(4)
    out[0] = q[0] * c - q[1] * x - q[2] * y - q[3] * z
    out[1] = q[0] * x + q[1] * c + q[2] * z - q[3] * y
    out[2] = q[0] * y - q[1] * z + q[2] * c + q[3] * x
    out[3] = q[0] * z + q[1] * y - q[2] * x + q[3] * c
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def turn(p: Array, q: Array) -> Array:
    """Return the turn (3,) [rad] that takes orientation `p` (4,) to `q` (4,), in the axes of `p`."""
    w = p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3]
    v = np.empty(3)
    v[0] = p[0] * q[1] - p[1] * q[0] - p[2] * q[3] + p[3] * q[2]
    v[1] = p[0] * q[2] + p[1] * q[3] - p[2] * q[0] - p[3] * q[1]
    v[2] = p[0] * q[3] - p[1] * q[2] + p[2] * q[1] - p[3] * q[0]
    size = math.sqrt(v[0] ** 2 + v[1] ** 2 + v[2] ** 2)
    scale = 2.0 if size < 1e-12 else 2.0 * math.atan2(size, abs(w)) / size
    for i in range(3):
        v[i] *= -scale if w < 0.0 else scale
    return v


@njit(cache=True, nogil=True, error_model="numpy")
def matrix(q: Array) -> Array:
    """Return the (3, 3) rotation of an orientation `q` (4,)."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    R = np.empty((3, 3))
    R[0, 0], R[0, 1], R[0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
    R[1, 0], R[1, 1], R[1, 2] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    R[2, 0], R[2, 1], R[2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)
    return R


@njit(cache=True, nogil=True, error_model="numpy")
def between(
    q0: Array, rate0: Array, v0: Array, q1: Array, rate1: Array, v1: Array, arm: Array, share: float
) -> tuple[Array, Array]:
    """Return the orientation (4,) of a body, and the velocity (3,) of a point of it, between two moments.

    `q0`, `rate0` and `v0` are orientation, angular rate in the body's axes [rad/s] and velocity of its origin [m/s] at
    one moment, `q1`, `rate1` and `v1` at the next. `arm` (3,) is the point in the body [m], `share` how far it is from
    one moment to the next.
    """
    rotvec, p0, p1 = turn(q0, q1), _point_rate(q0, rate0, v0, arm), _point_rate(q1, rate1, v1, arm)
    for i in range(3):
        rotvec[i] *= share
        p0[i] += share * (p1[i] - p0[i])
    return turned(q0, rotvec), p0


@njit(cache=True, nogil=True, error_model="numpy")
def _point_rate(q: Array, rate: Array, v: Array, arm: Array) -> Array:
    """Return the velocity (3,) of a point of a body: v + R (rate x arm)."""
    R, out = matrix(q), np.empty(3)
    x, y, z = (
        rate[1] * arm[2] - rate[2] * arm[1],
        rate[2] * arm[0] - rate[0] * arm[2],
        rate[0] * arm[1] - rate[1] * arm[0],
    )
    for i in range(3):
        out[i] = v[i] + (R[i, 0] * x + R[i, 1] * y + R[i, 2] * z)
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def sensed(q0: Array, v0: Array, q1: Array, v1: Array, mount: Array, gravity: Array, dt: float) -> tuple[Array, Array]:
    """Return the mean angular rate [rad/s] and specific force [m/s^2], (3,) each, of an IMU between two moments.

    `q0`, `v0` and `q1`, `v1` are orientation of the body and velocity of the IMU at both, `dt` the time between them
    [s], `mount` (3, 3) the IMU's axes in the body, `gravity` (3,) in the world [m/s^2].
    """
    rotvec, half = turn(q0, q1), np.empty(3)
    for i in range(3):
        half[i] = 0.5 * rotvec[i]
    R = matrix(turned(q0, half))
    body, rate, force = np.zeros(3), np.zeros(3), np.zeros(3)
    for i in range(3):
        for k in range(3):
            body[i] += R[k, i] * ((v1[k] - v0[k]) / dt - gravity[k])
    for i in range(3):
        for k in range(3):
            rate[i] += mount[k, i] * rotvec[k]
            force[i] += mount[k, i] * body[k]
        rate[i] /= dt
    return rate, force


LATENCY = 0.02
"""Time from the end of a scan to its arrival [s]; the rays of one are cast meanwhile."""
HOUSING = "head"
"""The shape of the robot in which the sensor sits; it would see nothing else."""

_SEEN, _ROBOT, _HIDDEN = 1, 0, 5
_GROUPS: NDArray[np.uint8] = np.array([1, 1, 0, 0, 0, 0], dtype=np.uint8)


@dataclass(frozen=True, slots=True)
class LidarMoment:
    """One instant `t` [s] of a simulation, as far as the LiDAR sees it: the state of the twin's model."""

    t: float
    qpos: Array
    qvel: Array


class LidarSensor:
    """The sensor of one twin; it is told every moment of the simulation, and read like a device.

    The results depend on seed and moments alone: a scan arrives `LATENCY` after its end, and whoever reads it then
    waits for the worker if it has not finished.
    """

    def __init__(
        self, scene: Scene, profile: str, seed: int, *, mount: Array | None = None, dropout: float | None = None
    ) -> None:
        """Hang the sensor on the torso of the robot in `scene`. Raises ConfigError: there is no such profile.

        Args:
            scene: world and robot; a copy is kept.
            seed: draws mounting error, bias and noise.
            mount: (4, 4) pose of the real lidar_link in the nominal one instead of the draw.
            dropout: share of lost points instead of the profile's.
        """
        errors = mid360.lidar_errors(profile)
        self.errors = errors if dropout is None else replace(errors, dropout=dropout)
        self.mount = mid360.draw_mount(profile, seed) if mount is None else mount
        self._model = model = visible(scene.model)
        self._data = mujoco.MjData(model)
        self._shapes, self._others = seen_shapes(model)
        self._kinds: NDArray[np.int64] = model.geom_type.astype(np.int64)
        self._people = [(model.body(p.name).mocapid[0], p) for p in scene.people]
        self._torso = model.body("torso_link").id
        base, waist = model.joint("base"), model.joint("torso_joint")
        self._q, self._v = int(base.qposadr[0]), int(base.dofadr[0])
        self._waist, self._waist_v = int(waist.qposadr[0]), int(waist.dofadr[0])
        self._T_torso_lidar = FRAMES["lidar_link"].T_parent_frame @ self.mount
        self._arm: Array = self._T_torso_lidar[:3, 3] + self._T_torso_lidar[:3, :3] @ mid360.P_LIDAR_IMU
        self._gravity: Array = model.opt.gravity.copy()
        self._imu_model = ImuModel(
            errors.imu, errors.imu.draw_bias(stream(seed, "lidar/bias")), stream(seed, "lidar/imu")
        )
        self._rng = stream(seed, "lidar/points")
        self._moments: deque[LidarMoment] = deque()
        self._next_imu: float | None = None
        self._next_scan = 0.0
        self._before: tuple[Array, Array] | None = None
        self._imu: list[LidarImu] = []
        self._scans: deque[tuple[float, Future[LidarScan]]] = deque()
        self._worker = ThreadPoolExecutor(1, "lidar")

    def observe(self, moment: LidarMoment) -> None:
        """Take the next moment of the simulation, later than the one before."""
        if self._next_imu is None:
            self._next_imu = self._next_scan = moment.t
        self._moments.append(moment)
        while len(self._moments) > 1 and self._next_imu <= moment.t + 1e-9:
            self._sample(self._next_imu)
            self._next_imu = round(self._next_imu + mid360.IMU_PERIOD, 6)
        if moment.t >= self._next_scan + mid360.SCAN - 1e-9:
            start = self._next_scan
            # One moment more than the scan is long: each stands for the time around it.
            track = [m for m in self._moments if m.t > start - 1e-9]
            self._scans.append((start + mid360.SCAN, self._worker.submit(self._scan, start, track, self._draw())))
            self._next_scan = round(self._next_scan + mid360.SCAN, 6)
            while len(self._moments) > 2 and self._moments[1].t <= self._next_scan:
                self._moments.popleft()

    def read_imu(self) -> list[LidarImu]:
        """Return the IMU samples since the last call."""
        news, self._imu = self._imu, []
        return news

    def read_scan(self, t: float) -> LidarScan | None:
        """Return the oldest scan that has arrived by time `t` [s] and was not read; None if there is none."""
        if not self._scans or self._scans[0][0] + LATENCY > t + 1e-9:
            return None
        return self._scans.popleft()[1].result()

    def close(self) -> None:
        """End the worker. Closing twice does nothing."""
        self._worker.shutdown(cancel_futures=True)

    def _sample(self, t: float) -> None:
        """Add the IMU's sample at time `t` [s], the mean since the one before."""
        late, early = self._moments[-1], self._moments[-2]
        share = (t - early.t) / (late.t - early.t)
        q, v = between(*self._motion(early), *self._motion(late), self._arm, share)
        if self._before is not None:
            mount = self._T_torso_lidar[:3, :3]
            rate, force = sensed(*self._before, q, v, mount, self._gravity, mid360.IMU_PERIOD)
            told = self._imu_model.measure(_UPRIGHT, rate, force)
            self._imu.append(LidarImu(t, told.gyro, told.acc))
        self._before = q, v

    def _motion(self, moment: LidarMoment) -> tuple[Array, Array, Array]:
        """Return orientation (4,) and angular rate (3,) of the torso [rad/s], and velocity (3,) of base_link [m/s]."""
        q, v = moment.qpos, moment.qvel
        torso, rate = torso_motion(
            q[self._q + 3 : self._q + 7], v[self._v + 3 : self._v + 6], float(q[self._waist]), float(v[self._waist_v])
        )
        return torso, rate, v[self._v : self._v + 3]

    def _draw(self) -> tuple[Array, Array]:
        """Draw the errors of one scan: (n, 3) of range and direction, and (n,) for the losses."""
        n = round(mid360.SCAN * mid360.POINT_RATE)
        return self._rng.standard_normal((n, 3)), self._rng.random(n)

    def _scan(self, start: float, track: list[LidarMoment], draws: tuple[Array, Array]) -> LidarScan:
        """Cast one scan; runs on the worker."""
        noise, lost = draws
        n, errors, data = len(noise), self.errors, self._data
        offsets = np.arange(1, n + 1) / mid360.POINT_RATE
        rays = mid360.directions(start + offsets)
        rays_true = shaken(rays, noise, errors.direction_noise) if errors.direction_noise > 0.0 else rays
        distance = np.empty(n)
        azimuth, slack = (
            2.0 * np.pi * np.mod(mid360.TURNS * (start + offsets), 1.0),
            SLACK + 6.0 * errors.direction_noise,
        )
        times = np.array([m.t for m in track]) - start
        edges = np.searchsorted(offsets, 0.5 * (times[1:] + times[:-1]))
        edges = np.concatenate([[0], edges, [n]])
        for i, moment in enumerate(track):
            part = slice(edges[i], edges[i + 1])
            count = part.stop - part.start
            if count == 0:
                continue
            data.qpos[:] = moment.qpos
            for mocap, person in self._people:
                data.mocap_pos[mocap] = person.position(moment.t)
            mujoco.mj_kinematics(self._model, data)
            R_torso = data.xmat[self._torso].reshape(3, 3)
            R = R_torso @ self._T_torso_lidar[:3, :3]
            origin = data.xpos[self._torso] + R_torso @ self._T_torso_lidar[:3, 3]
            # Directions turn with the sensor between the moments; its place is that of the nearest moment.
            world = carried(rays_true[part], self._rate(moment), offsets[part] - times[i], R)
            half = np.pi * mid360.TURNS * count / mid360.POINT_RATE
            middle = float(azimuth[part.start]) + half
            wedge = np.array([math.atan2(math.sin(middle), math.cos(middle)), half + slack])
            cast(origin, R, wedge, world, self._shapes, self._kinds, self._model.geom_size, self._model.geom_rbound,
                 data.geom_xpos, data.geom_xmat, distance[part])  # fmt: skip
            if self._others:
                self._cast_others(origin, world, distance[part])
        ranges = distance + errors.range_noise * noise[:, 0]
        kept = (distance >= 0.0) & (distance > errors.near) & (distance < errors.far) & (lost >= errors.dropout)
        points = (rays[kept] * ranges[kept, None]).astype(np.float32)
        return LidarScan(start + mid360.SCAN, points, offsets[kept].astype(np.float32), mid360.SCAN)

    def _cast_others(self, origin: Array, rays: Array, distance: Array) -> None:
        """Let MuJoCo cast rays (n, 3) against shapes that the kernel does not know; `distance` (n,) gets the nearer."""
        n = len(rays)
        other, hit = np.empty(n), np.empty(n, dtype=np.int32)
        mujoco.mj_multiRay(
            self._model, self._data, origin, rays.ravel(), _GROUPS, True, -1, hit, other, None, n, self.errors.far
        )
        nearer = (hit >= 0) & ((distance < 0.0) | (other < distance))
        distance[nearer] = other[nearer]

    def _rate(self, moment: LidarMoment) -> Array:
        """Return the (3,) angular rate of the sensor in its own axes [rad/s]."""
        return self._T_torso_lidar[:3, :3].T @ self._motion(moment)[1]


SLACK = 0.03
"""Width that the motion within a moment adds to the wedge of azimuths that its rays are in [rad]."""
_UPRIGHT: Array = np.array([1.0, 0.0, 0.0, 0.0])
"""The IMU's orientation, which it does not report."""


def seen_shapes(model: mujoco.MjModel) -> tuple[NDArray[np.int64], bool]:
    """Return the shapes of `visible` that the kernel casts against, and whether there are others.

    Those that the kernel knows are hidden from MuJoCo's own rays.
    """
    seen = np.isin(model.geom_group, (_SEEN, _ROBOT)) & (_alpha(model) > 0.0)
    known = seen & np.isin(model.geom_type, KNOWN)
    model.geom_group[known] = _HIDDEN
    return np.flatnonzero(known).astype(np.int64), bool((seen & ~known).any())


def _alpha(model: mujoco.MjModel) -> Array:
    """Return the (n,) opacity of each shape, by its material if it has one."""
    material = model.geom_matid
    return np.where(material >= 0, model.mat_rgba[material, 3] if model.nmat else 1.0, model.geom_rgba[:, 3])


def visible(model: mujoco.MjModel) -> mujoco.MjModel:
    """Return a copy of `model` in which rays meet what the LiDAR sees: the world's looks, the robot's contact shapes.

    The robot's looks are meshes, which cost many times what its contact shapes do. The world's meshes are the heads of
    screws, smaller than the noise of the ranges; rays pass them.
    """
    out = copy.copy(model)
    robot = out.body_rootid[out.geom_bodyid] == out.body(BASE_LINK).id
    shape = robot & (out.geom_group == COLLISION_GROUP)
    shape[out.geom(HOUSING).id] = False
    looks = ~robot & (out.geom_group < COLLISION_GROUP) & (out.geom_type != mujoco.mjtGeom.mjGEOM_MESH)
    out.geom_group[:] = np.where(shape, _ROBOT, np.where(looks, _SEEN, _HIDDEN))
    out.geom_rgba[shape, 3] = 1.0
    out.geom_matid[shape] = -1
    return out
