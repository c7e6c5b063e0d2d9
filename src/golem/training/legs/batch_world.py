"""Many robots at once: batch physics with its randomisation, and the sensors of the robot as the stack would read them.

Two frames: the plane's, in which physics runs, and the level one, in which gravity points down. They differ by the
slope of the episode, which is drawn by turning gravity. Roughness is drawn by moving the contact spheres of a foot that
is in the air, as if it came down on a stone or an edge: unlike a height field it costs nothing.

Of the safety gate's rules those are left out that one sample suffices for, and that of a position outside its range: a
joint on its way there breaks the one of the braking distance first.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from golem.capabilities.legs.balance_errors import heading_frame
from golem.hardware.estimator.feet import Contact, ContactConfig
from golem.hardware.estimator.random_walk_kf import RandomWalk, RandomWalkConfig
from golem.hardware.safety.base import SafetyLimits
from golem.hardware.safety.limiter import spared
from golem.hardware.safety.monitor import at_rest
from golem.training.legs.training_model import KD, KP, STANCE, STAND_HEIGHT, STEP, build_model
from golem.types import GRAVITY, LEGS, NUM_JOINTS, TICK, Array

REMEMBERED = 8
"""Physics steps of which the state is remembered: more than any delay."""


class LegGate:
    """The gate of `n` robots, in physics steps.

    It predicts torques from a state as old as its command is late. So a torque may exceed what it lets through, and,
    where a leg is slowed down, does for as long as that takes: legs that had never met it were stopped in 20 of 20
    shoves of 80 N s ahead, for `joint_torque` in the four that were looked at.
    """

    def __init__(self, n: int) -> None:
        limits = SafetyLimits.from_profile()
        self._velocity, self._torque = limits.velocity[LEGS], limits.torque[LEGS]
        self._lower, self._upper = limits.state_lower[LEGS], limits.state_upper[LEGS]
        self._deceleration = limits.deceleration[LEGS]
        self._bound, self._slew = limits.torque_command[LEGS], limits.slew[LEGS]
        self._range = limits.lower[LEGS], limits.upper[LEGS]
        # Speed, braking distance, torque.
        samples = limits.leg_samples, limits.leg_samples, limits.torque_samples
        self._patience = np.rint(np.array(samples) * TICK / STEP)
        self._bad: NDArray[np.int64] = np.zeros((n, 3), dtype=np.int64)
        self._rows = np.arange(n)
        self._newest = 0
        self._q: Array = np.tile(STANCE, (REMEMBERED, n, 1))
        self._dq: Array = np.zeros((REMEMBERED, n, 12))
        self._sent: Array = np.tile(STANCE, (n, 1))

    def reset(self, where: NDArray[np.intp], q: Array) -> None:
        """Start the robots `where` anew, at rest at `q` (m, 12) [rad]."""
        self._q[:, where], self._dq[:, where] = q, 0.0
        self._sent[where] = q
        self._bad[where] = 0

    def limit(self, targets: Array, delay: NDArray[np.int64]) -> Array:
        """Return the (n, 12) positions that arrive now of `targets` that were sent `delay` (n,) physics steps ago.

        As `golem.hardware.safety.limiter`: the position inside its range and within reach of the last one, then pulled
        towards the measured one until the torque kp (q_cmd - q) - kd dq that it predicts is within its bound. A joint
        that is too fast, or too close to the end of its range for its speed, is braked whatever its target: where the
        gate does that by a feed-forward torque, the position that arrives stands for it. Legs have no feed-forward of
        their own, so that the bound of its rate is not met here.
        """
        then = (self._newest - delay) % REMEMBERED
        q, dq = self._q[then, self._rows], self._dq[then, self._rows]
        damp = np.clip(-KD * dq, -self._bound, self._bound)
        up, down = spared(q, dq, self._deceleration, self._velocity, self._lower, self._upper)
        highest, lowest = up * self._bound, -down * self._bound
        rest = np.minimum(np.maximum(damp, lowest), highest)
        up = np.sqrt(2.0 * self._deceleration * np.maximum(self._range[1] - self._sent, 0.0))
        down = np.sqrt(2.0 * self._deceleration * np.maximum(self._sent - self._range[0], 0.0))
        minimum = self._sent - np.minimum(down, self._slew) * STEP
        maximum = self._sent + np.minimum(up, self._slew) * STEP
        slewed = np.clip(np.clip(targets, *self._range), minimum, maximum)
        self._sent = np.minimum(np.maximum(slewed, q + (lowest - rest) / KP), q + (highest - rest) / KP)
        return self._sent + (rest - damp) / KP

    def judge(self, q: Array, dq: Array, torque: Array) -> NDArray[np.bool_]:
        """Take in the state after a physics step, (n, 12) each; return (n,) whether it stops the robot."""
        self._newest = (self._newest + 1) % REMEMBERED
        self._q[self._newest], self._dq[self._newest] = q, dq
        rest = at_rest(q, dq, self._deceleration)
        fast = np.any(np.abs(dq) > self._velocity, axis=1)
        beyond = np.any((rest > self._upper) | (rest < self._lower), axis=1)
        strong = np.any(np.abs(torque) > self._torque, axis=1)
        now = np.stack([fast, beyond, strong], axis=1)
        self._bad = np.where(now, self._bad + 1, 0)
        return np.any(self._bad >= self._patience, axis=1)


Rows = NDArray[np.intp]
WHOLE = 0.5
"""Share of the footholds on rough ground that are as high as a ledge is at most, or level: a step, up or down."""
SLIPPERY = 0.25
"""Share of the episodes in the most slippery tenth of the range: an even draw hardly ever is."""


@dataclass(frozen=True)
class WorldConfig:
    """Ranges of what differs from robot to robot and from episode to episode.

    Attributes:
        friction: of the soles.
        torso_mass: added to the torso [kg].
        payload: largest mass in each hand [kg].
        strength: factor on gains, and (up to 1) on the torque limits of the motors.
        delay: largest delay of a command, in physics steps of 10 ms, up to two periods of the policy. More than the
            20 ms of the robot: trained with those, legs that stood most precisely swayed by 6 mm at 2 Hz in the twin.
        slope: largest slope [rad].
        roughness: largest height of the ground under a corner of a sole [m].
        ledge: largest height of one foothold above another, on rough ground [m].
        leg_offset, arm_offset: encoder zeros, standard deviation [rad]; as in the twin's field profile.
        tilt: error of the IMU's roll and pitch, standard deviation [rad].
        foot_noise: noise of a foot's measured velocity [m/s].
        force_noise: noise of the measured foot force, share of it.
    """

    friction: tuple[float, float] = (0.4, 1.1)
    torso_mass: tuple[float, float] = (-2.0, 4.0)
    payload: float = 3.0
    strength: tuple[float, float] = (0.88, 1.1)
    delay: int = 3
    slope: float = 0.1
    roughness: float = 0.02
    ledge: float = 0.0
    leg_offset: float = 0.01
    arm_offset: float = 0.03
    tilt: float = 0.006
    foot_noise: float = 0.03
    force_noise: float = 0.1


@dataclass
class Sensed:
    """What the robots measure and the stack's estimator makes of it; leading axis (n,).

    Attributes:
        q, dq: (n, 27) [rad], [rad/s].
        rate: (n, 3) angular rate in base_link [rad/s].
        R: (n, 3, 3) believed rotation of base_link in the level frame.
        velocity: (n, 3) estimated velocity of base_link in the level frame [m/s].
    """

    q: Array
    dq: Array
    rate: Array
    R: Array
    velocity: Array


@dataclass
class BatchTruth:
    """What really is; leading axis (n,). Vectors in the level frame unless stated.

    Attributes:
        R: (n, 3, 3) rotation of base_link.
        velocity: (n, 3) of base_link [m/s].
        rate: (n, 3) angular rate in base_link [rad/s].
        soles: (n, 2, 3) centres of the soles relative to base_link's origin [m].
        clearance: (n, 2) height of the soles above the plane [m].
        sole_velocity: (n, 2, 3) [m/s].
        sole_up: (n, 2) cosine of the angle between each sole and the plane.
        force: (n, 2) normal force on each foot [N].
        com: (n, 3) centre of the nominal masses relative to base_link's origin [m].
        height: (n,) of base_link above the plane [m].
        torque: (n, 27) [N m].
        q, dq: (n, 27) [rad], [rad/s].
    """

    R: Array
    velocity: Array
    rate: Array
    soles: Array
    clearance: Array
    sole_velocity: Array
    sole_up: Array
    force: Array
    com: Array
    height: Array
    torque: Array
    q: Array
    dq: Array

    def heading_velocity(self) -> Array:
        """Return the (n, 3) velocity in the heading frame: vx, vy [m/s], wz [rad/s]."""
        planar = np.einsum("nji,nj->ni", heading_frame(self.R), self.velocity[:, :2])
        return np.concatenate([planar, np.einsum("nj,nj->n", self.R[:, 2], self.rate)[:, None]], axis=1)


class BatchWorld:
    """`n` robots in batch physics.

    Attributes:
        truth, sensed: after the last `step` or `reset`.
        payload: (n, 2) mass in each hand [kg].
        friction: (n,) of the soles.
        slope: (n, 2) tilt of gravity about y and x [rad].
        stopped: (n,) whether the safety gate would have stopped the robot in the last `step` for what its legs did.
    """

    def __init__(self, n: int, config: WorldConfig, rng: np.random.Generator, threads: int) -> None:
        """Build the batch on `threads` threads; everything random comes from `rng`."""
        self.config, self._rng, self.n = config, rng, n
        self._model, self.ids = build_model()
        self._batch = Batch(self._model, n, threads, True)
        b = self._batch
        self._qpos, self._qvel = b.bind("qpos"), b.bind("qvel")
        self._ctrl, self._xfrc = b.bind("ctrl"), b.bind("xfrc_applied")
        self._sensors, self._xipos = b.bind("sensordata"), b.bind("xipos")
        self._sites, self._site_axes = b.bind("site_xpos"), b.bind("site_xmat")
        self._torque = b.bind("actuator_force")
        self._gravity, self._mass = b.expand("opt.gravity"), b.expand("body_mass")
        self._friction, self._corners = b.expand("geom_friction"), b.expand("geom_pos")
        self._gain, self._bias = b.expand("actuator_gainprm"), b.expand("actuator_biasprm")
        self._limit = b.expand("actuator_forcerange")
        self._sole_sites = [self._model.site(f"{side}_sole").id for side in ("left", "right")]
        robot = np.flatnonzero(self._model.body_mass > 0.0)
        self._com = (robot, self._model.body_mass[robot] / self._model.body_mass[robot].sum())
        self._to_level: Array = np.tile(np.eye(3), (n, 1, 1))
        self._believed_tilt: Array = np.tile(np.eye(3), (n, 1, 1))
        self._offset: Array = np.zeros((n, NUM_JOINTS))
        self._delay: NDArray[np.int64] = np.zeros(n, dtype=np.int64)
        # The leg targets of the last two periods, the newest first.
        self._previous: Array = np.tile(STANCE, (2, n, 1))
        self._strength: Array = np.ones((n, LEGS.stop))
        self._rough: Array = np.zeros(n)
        self._force_scale: Array = np.ones((n, 2))
        self.payload: Array = np.zeros((n, 2))
        self.friction: Array = np.ones(n)
        self.slope: Array = np.zeros((n, 2))
        self._filter = RandomWalk(RandomWalkConfig(), (n,))
        self._contact = Contact(ContactConfig(), (n,))
        self._gate = LegGate(n)
        self.stopped: NDArray[np.bool_] = np.zeros(n, dtype=bool)

    def reset(self, where: Rows, upper: Array, payload: float) -> None:
        """Start the robots `where` anew: standing, upper body at `upper` (m, 15), payload up to the share `payload`."""
        if not len(where):
            return
        self._randomise(where, payload)
        rng, m = self._rng, len(where)
        self._batch.reset(where, stage=int(mujoco.mjtStage.mjSTAGE_NONE))
        q = np.concatenate([STANCE + rng.normal(0.0, 0.03, (m, 12)), upper], axis=1)
        yaw = rng.uniform(-np.pi, np.pi, m)
        self._qpos[where, :3] = 0.0
        self._qpos[where, 2] = STAND_HEIGHT + 0.005
        self._qpos[where, 3:7] = np.stack([np.cos(yaw / 2), 0 * yaw, 0 * yaw, np.sin(yaw / 2)], axis=1)
        self._qpos[where, 7 : 7 + NUM_JOINTS] = q
        self._qvel[where] = 0.0
        self._qvel[where, :2] = rng.normal(0.0, 0.1, (m, 2))
        self._previous[:, where] = STANCE
        self._batch.forward(where)
        mask = np.zeros(self.n, dtype=bool)
        mask[where] = True
        self._filter.reset(mask)
        self._contact.reset(mask)
        self._gate.reset(where, q[:, LEGS])

    def step(self, legs: Array, upper: Array, force: Array, on_torso: NDArray[np.bool_], substeps: int) -> None:
        """Advance by `substeps` physics steps under leg targets (n, 12), upper-body targets (n, 15) and a push."""
        self._xfrc[:, self.ids.torso, :3] = force * on_torso[:, None]
        self._xfrc[:, self.ids.base, :3] = force * ~on_torso[:, None]
        ctrl = self._ctrl
        ctrl[:, LEGS.stop : NUM_JOINTS] = upper - self._offset[:, LEGS.stop :]
        self.stopped[:] = False
        for k in range(substeps):
            late = (self._delay - k)[:, None]
            before = np.where(late > substeps, self._previous[1], self._previous[0])
            targets = np.where(late > 0, before, legs) - self._offset[:, LEGS]
            ctrl[:, LEGS] = self._gate.limit(targets, self._delay)
            self._batch.step(nstep=1, stage=int(mujoco.mjtStage.mjSTAGE_VEL))
            self._estimate()
            q, dq = self._qpos[:, 7 : 7 + LEGS.stop], self._qvel[:, 6 : 6 + LEGS.stop]
            # What the drives would report is what they were asked for, however strong the motor is.
            self.stopped |= self._gate.judge(q, dq, self._torque[:, LEGS] / self._strength)
        self._previous = np.stack([legs, self._previous[0]])
        self.read()

    def _estimate(self) -> None:
        """Let the stack's velocity filter and contact logic take one step on what the robots measure."""
        c, rng = self.config, self._rng
        base = self._qvel[:, None, :3]
        soles = self._sensors[:, self.ids.sole_velocity.ravel()].reshape(-1, 2, 3)
        # What a foot that stands still implies with exact kinematics, in closed form, and noise on top.
        measured = base - soles + rng.normal(0.0, c.foot_noise, soles.shape)
        force = self._sensors[:, self.ids.touch] * self._force_scale
        _, weight = self._contact.step(force, STEP)
        self._filter.step(np.einsum("nij,nkj->nki", self._to_level, measured), weight, STEP)

    def read(self) -> None:
        """Fill `truth` and `sensed` from the present state."""
        rng, n = self._rng, self.n
        G = self._to_level
        R_plane = rotations(self._qpos[:, 3:7])
        R = G @ R_plane
        position = self._qpos[:, None, :3]
        sites = self._sites[:, self._sole_sites]
        q, dq = self._qpos[:, 7 : 7 + NUM_JOINTS].copy(), self._qvel[:, 6 : 6 + NUM_JOINTS].copy()
        rows, share = self._com
        com = np.einsum("nbi,b->ni", self._xipos[:, rows], share) - position[:, 0]
        soles_v = self._sensors[:, self.ids.sole_velocity.ravel()].reshape(-1, 2, 3)
        level = lambda v: np.einsum("nij,n...j->n...i", G, v)  # noqa: E731
        self.truth = BatchTruth(
            R=R, velocity=level(self._qvel[:, :3]), rate=self._qvel[:, 3:6].copy(), soles=level(sites - position),
            clearance=sites[:, :, 2].copy(), sole_velocity=level(soles_v),
            sole_up=self._site_axes[:, self._sole_sites, 8], force=self._sensors[:, self.ids.touch], com=level(com),
            height=self._qpos[:, 2].copy(), torque=self._torque[:, :NUM_JOINTS].copy(), q=q, dq=dq,
        )  # fmt: skip
        self.sensed = Sensed(
            q=q + self._offset + rng.normal(0.0, 0.001, q.shape),
            dq=dq + rng.normal(0.0, 0.05, q.shape),
            rate=self._qvel[:, 3:6] + rng.normal(0.0, 0.01, (n, 3)),
            R=self._believed_tilt @ R,
            velocity=self._filter.velocity.copy(),
        )

    def shim(self, feet: NDArray[np.bool_]) -> None:
        """Draw new ground under the `feet` (n, 2) that are in the air."""
        robots, side = np.nonzero(feet & (self._rough > 0.0)[:, None])
        if not len(robots):
            return
        rng, m = self._rng, len(robots)
        x = np.array([-0.5, -0.5, 0.5, 0.5])
        y = np.array([-0.5, 0.5, -0.5, 0.5])
        plane = rng.uniform(-1.0, 1.0, (m, 3))
        height = 0.4 * plane[:, :1] + 0.6 * (plane[:, 1:2] * x + plane[:, 2:] * y) + rng.uniform(-0.3, 0.3, (m, 4))
        share = rng.random((m, 1))
        rough, whole = self._rough[robots, None], rng.random((m, 1)) < WHOLE
        ledge = self.config.ledge * np.where(whole, np.round(share), rough * share)
        corners = self.ids.soles.reshape(2, 4)[side]
        nominal = self._model.geom_pos[corners, 2]
        self._corners[robots[:, None], corners, 2] = nominal - rough * self.config.roughness * height - ledge

    def _randomise(self, where: Rows, payload: float) -> None:
        c, rng, m, model = self.config, self._rng, len(where), self._model
        share = rng.random(m) * np.where(rng.random(m) < SLIPPERY, 0.1, 1.0)
        self.friction[where] = c.friction[0] + (c.friction[1] - c.friction[0]) * share
        self._friction[where[:, None], self.ids.soles, 0] = self.friction[where, None]
        self.payload[where] = c.payload * payload * rng.random((m, 2)) * (rng.random((m, 2)) < 0.6)
        self._mass[where[:, None], self.ids.hands] = model.body_mass[self.ids.hands] + self.payload[where]
        self._mass[where, self.ids.torso] = model.body_mass[self.ids.torso] + rng.uniform(*c.torso_mass, m)
        gain = rng.uniform(*c.strength, (m, NUM_JOINTS))
        self._strength[where] = gain[:, LEGS]
        self._gain[where, :, 0] = model.actuator_gainprm[:, 0] * gain
        self._bias[where, :, 1:3] = model.actuator_biasprm[:, 1:3] * gain[:, :, None]
        self._limit[where] = model.actuator_forcerange * np.minimum(gain, 1.0)[:, :, None]
        self._delay[where] = rng.integers(0, c.delay + 1, m)
        self._offset[where, : LEGS.stop] = rng.normal(0.0, c.leg_offset, (m, LEGS.stop))
        self._offset[where, LEGS.stop :] = rng.normal(0.0, c.arm_offset, (m, NUM_JOINTS - LEGS.stop))
        self._force_scale[where] = 1.0 + rng.normal(0.0, c.force_noise, (m, 2))
        uneven = c.roughness > 0.0 or c.ledge > 0.0
        self._rough[where] = uneven * np.where(rng.random(m) < 0.5, 0.0, rng.random(m))
        self._corners[where] = model.geom_pos
        sloped = rng.random((m, 1)) < 0.4
        self.slope[where] = np.where(sloped, rng.uniform(-c.slope, c.slope, (m, 2)), 0.0)
        G = small_rotations(self.slope[where])
        self._to_level[where] = G
        self._gravity[where] = -GRAVITY * G[:, 2]
        self._believed_tilt[where] = small_rotations(rng.normal(0.0, c.tilt, (m, 2)))


def rotations(quat: Array) -> Array:
    """Return the (n, 3, 3) rotation matrices of unit quaternions (n, 4), wxyz."""
    w, x, y, z = quat.T
    out = np.empty((len(quat), 3, 3))
    out[:, 0] = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], axis=1)
    out[:, 1] = np.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], axis=1)
    out[:, 2] = np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], axis=1)
    return out


def small_rotations(angles: Array) -> Array:
    """Return the (n, 3, 3) rotations by angles (n, 2) about y, then about x [rad]."""
    a, b = angles.T
    ca, sa, cb, sb = np.cos(a), np.sin(a), np.cos(b), np.sin(b)
    out = np.zeros((len(angles), 3, 3))
    out[:, 0, 0], out[:, 0, 2] = ca, sa
    out[:, 1] = np.stack([sb * sa, cb, -sb * ca], axis=1)
    out[:, 2] = np.stack([-cb * sa, sb, cb * ca], axis=1)
    return out
