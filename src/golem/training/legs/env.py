"""The game between the legs and the disturbances: commands in, observations and rewards out, for many robots.

A foot that is about to land belongs where the next step carries the robot on: by its capture point. The robot is taken
for a linear inverted pendulum on the foot that stands. Its capture point (divergent component of motion) runs away from
that foot as exp(omega t). Walking goes on as commanded if the other foot lands at an offset from where the capture
point will be then (Khadiv et al., "Step timing adjustment", 2016, equations 5 and 6). After a push this is where the
robot has to step, wherever the command points.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from golem.capabilities.legs.balance_errors import balance_errors, heading_frame
from golem.capabilities.legs.base import Envelope
from golem.capabilities.legs.gait import Gait, GaitConfig, swing_offset
from golem.capabilities.legs.observation import ObservationLayout, Signals, Term
from golem.hardware.safety.base import SafetyLimits
from golem.robots.model.leg_kinematics import leg_poses, sole_centers
from golem.training.legs.batch_world import BatchTruth, BatchWorld, Rows, WorldConfig
from golem.training.legs.disturbances import Difficulty, Quarters, RandomPushes, UpperBodyMotion
from golem.training.legs.rewards import Rewards, RewardWeights
from golem.training.legs.training_model import FEET_APART, KD, KP, STANCE, STAND_HEIGHT, STEP
from golem.types import GRAVITY, LEGS, Array

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
        twist: (n, 3) command [m/s, m/s, rad/s].
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


PERIOD = 0.02
"""Time between two actions [s]: 50 Hz, as ALMI."""
LAYOUT = (
    Term("base_velocity", 2.0),
    Term("base_rate", 0.25),
    Term("gravity", 2.0),
    Term("twist", (2.0, 2.0, 1.0)),
    Term("joint_position", 1.0, ("legs",)),
    Term("joint_velocity", 0.05, ("legs",)),
    Term("last_action", 0.5),
    Term("joint_position", 0.5, ("upper",)),
    Term("joint_velocity", 0.1, ("upper",)),
    Term("phase_sin"),
    Term("phase_cos"),
)
"""What the leg policy sees; the description beside its weights is written from this."""
SEEN = ObservationLayout(LAYOUT, np.concatenate([STANCE, np.zeros(15)]))
KNOWN = 39
"""How many values only the critic knows."""


@dataclass(frozen=True)
class EnvConfig:
    """The task.

    Attributes:
        envelope: twists that are commanded, a little more than what the controller will declare.
        standing: share of the commands that are zero.
        corners: share of the others in which each axis is at an end of its range or zero. A uniform draw hardly ever
            asks for everything at once, and there the robot falls.
        creeping: share of the others that are slow, as a robot is told that arrives.
        accelerate: how fast a command may change [m/s^2, m/s^2, rad/s^2]; the base layer limits it likewise.
        hold: shortest and longest time a command lasts [s].
        episode: length of an episode [s].
        action_scale: joint target per unit of action [rad].
        swing: amplitude of the feed-forward swing [rad].
        clearance: height of the sole in the middle of its swing that is rewarded [m].
        calm: share of the episodes without pushes and with slow arms: who is always disturbed learns neither to walk as
            told nor to stand quietly.
        impulse: largest push at full difficulty [N s].
        quarters: shares of the straight pushes ahead, to the left, back and to the right.
        recovery: time after the beginning of a push in which the command need not be followed [s].
        fall: what a fall costs beside the rewards it forgoes, which are worth as much: without, the less noise there
            was the better the robot stood and the more often it fell.
        gait: clock and gate.
        world: randomisation.
        weights: of the rewards.
    """

    envelope: Envelope = field(default_factory=lambda: Envelope((-0.45, 0.85), (-0.35, 0.35), (-0.65, 0.65)))
    standing: float = 0.2
    corners: float = 0.35
    creeping: float = 0.15
    accelerate: tuple[float, float, float] = (1.0, 1.0, 2.0)
    hold: tuple[float, float] = (2.0, 7.0)
    episode: float = 20.0
    action_scale: float = 0.25
    swing: float = 0.28
    clearance: float = 0.08
    calm: float = 0.4
    impulse: float = 90.0
    quarters: Quarters = (0.2, 0.3, 0.2, 0.3)
    recovery: float = 1.2
    fall: float = 5.0
    gait: GaitConfig = field(default_factory=lambda: GaitConfig(period=0.64))
    world: WorldConfig = field(default_factory=WorldConfig)
    weights: RewardWeights = field(default_factory=RewardWeights)


Task = Literal["walk", "rough", "stand"]
TASKS: dict[Task, EnvConfig] = {
    "walk": EnvConfig(),
    "rough": EnvConfig(
        impulse=60.0,
        world=WorldConfig(friction=(0.15, 1.1), payload=5.0, slope=0.15, roughness=0.03, ledge=0.05),
        clearance=0.14,
    ),
    "stand": EnvConfig(
        standing=1.0,
        calm=0.3,
        impulse=100.0,
        quarters=(0.2, 0.2, 0.4, 0.2),
        recovery=0.0,
        world=WorldConfig(delay=4),
        weights=RewardWeights(feet=-4.0, toes=0.0, dragged=0.0),
    ),
}
"""A network for each. One for both learned neither well: shoves of 90 N s teach a robot that walks to shuffle, and one
that is praised for standing to the millimetre, or has learned to walk, is slow to step. Who only stands steps after a
push, to wherever that is good: it pays less for where its feet are. Its delays go further, because legs of high gain
sway at 2 Hz from some delay on: of four networks trained to 30 ms two moved at 20 mm/s there, left alone, and those two
swayed by 7 mm in the twin at 22 ms. Its pushes are twice as often back: with a quarter each, legs that had stood 20 of
20 shoves of 80 N s backward stood 14. A walking robot is weakest to its sides. `rough` is
`walk` on ground as hard as that of rung `walk-rough`."""


@dataclass
class Step:
    """What one action led to; leading axis (n,).

    Attributes:
        reward: of the legs.
        ended: fallen, or stopped by the safety gate.
        truncated: the episode's time was over.
        terms: mean of each reward term.
    """

    reward: Array
    ended: NDArray[np.bool_]
    truncated: NDArray[np.bool_]
    terms: dict[str, float]


class LegsEnv:
    """`n` robots with commands, gait clocks, disturbances and rewards.

    Attributes:
        difficulty: of the disturbances, and how strict the rewards are.
        twist: (n, 3) present command.
        age: (n,) time since each episode began [s].
    """

    def __init__(self, n: int, config: EnvConfig, seed: int | tuple[int, ...], threads: int) -> None:
        self.n, self.config = n, config
        self._rng = np.random.default_rng(seed)
        self.world = BatchWorld(n, config.world, self._rng, threads)
        self.difficulty = Difficulty()
        self.gait = Gait(config.gait, (n,))
        self.upper = UpperBodyMotion(n, self._rng)
        self._pushes = RandomPushes(n, config.impulse, config.quarters, self._rng)
        self._limits = SafetyLimits.from_profile()
        self._rewards = Rewards(n, config.weights, config.gait, config.clearance, self._limits)
        self.twist: Array = np.zeros((n, 3))
        self._goal: Array = np.zeros((n, 3))
        self._left: Array = np.zeros(n)
        self.age: Array = np.zeros(n)
        self._action: Array = np.zeros((n, 12))
        self._capture: Array = np.zeros((n, 2))
        self._misplaced: Array = np.zeros(n)
        self.begin()

    @property
    def walking(self) -> NDArray[np.bool_]:
        """(n,) which robots are commanded to move."""
        return np.asarray(np.abs(self.twist).max(axis=1) > 1e-6)

    @property
    def recovers(self) -> NDArray[np.bool_]:
        """(n,) which robots were pushed so recently that they need not follow the command."""
        return self._pushes.since < self.config.recovery

    def reseed(self, seed: tuple[int, ...]) -> None:
        """Begin with other draws, as if `seed` had been given at the start."""
        self._rng.bit_generator.state = np.random.default_rng(seed).bit_generator.state
        self.begin()

    def begin(self) -> None:
        """Start every robot, each somewhere in its episode, so that they do not all end at once."""
        self.restart(np.arange(self.n))
        self.age = self._rng.uniform(0.0, self.config.episode, self.n)

    def reset(self, where: Rows) -> None:
        """Start the robots `where` anew."""
        if not len(where):
            return
        calm = self._rng.random(len(where)) < self.config.calm
        self.upper.reset(where, self.difficulty.amplitude, calm)
        self.world.reset(where, self.upper.target[where], self.difficulty.payload)
        self._pushes.reset(where, self.difficulty.push, calm)
        mask = np.zeros(self.n, dtype=bool)
        mask[where] = True
        self.gait.reset(mask)
        self._rewards.reset(where)
        self.age[where] = 0.0
        self._action[where] = 0.0
        self.twist[where] = 0.0
        self._command(where)

    def command(self, twist: Array) -> None:
        """Command `twist` (3,) [m/s, m/s, rad/s] to every robot for the rest of its episode."""
        self._goal[:], self._left[:] = twist, np.inf

    def shove(self, force: Array, duration: float, start: float | Array) -> None:
        """Push each robot once and never again; see `RandomPushes.once`."""
        self._pushes.once(force, duration, start)

    def observe(self) -> tuple[Array, Array]:
        """Return what the policy sees (n, SEEN.size), and beside it what only the critic knows (n, KNOWN)."""
        sensed, truth = self.world.sensed, self.world.truth
        R = sensed.R
        signals = Signals(
            q=sensed.q,
            dq=sensed.dq,
            gyro=sensed.rate,
            gravity=-R[:, 2],
            velocity=np.einsum("nji,nj->ni", R, sensed.velocity),
            twist=self.twist,
            action=self._action,
            phase=self.gait.phases,
            stepping=self.gait.stepping.astype(np.float64),
        )
        velocity = np.einsum("nji,nj->ni", truth.R, truth.velocity)
        force = np.einsum("nji,nj->ni", truth.R, self._pushes.force)
        known = [
            2.0 * velocity, 0.01 * force, self._pushes.on_torso[:, None], 0.002 * truth.force, self.world.payload,
            self.world.friction[:, None], 10.0 * self.world.slope, 10.0 * self._capture,
            10.0 * self._misplaced[:, None], 10.0 * truth.clearance, self.upper.target - sensed.q[:, 12:],
            self._rewards.tracked_error(self.twist), self.gait.stepping[:, None], self.recovers[:, None],
        ]  # fmt: skip
        return SEEN.observe(signals), np.concatenate(known, axis=1)

    def step(self, action: Array, steered: Rows, speeds: Array) -> Step:
        """Act for one period.

        Args:
            action: (n, 12) of the legs.
            steered: the robots whose upper body the learned adversary moves.
            speeds: (len(steered), 15) its action.
        """
        config, dt = self.config, PERIOD
        self.upper.step(self.difficulty, dt)
        if len(steered):
            self.upper.steer(steered, speeds, self.difficulty, dt)
        self._pushes.step(self.difficulty.push, heading_frame(self.world.truth.R), dt)
        action = np.clip(action, -10.0, 10.0)
        gait = config.gait
        swing = swing_offset(self.gait.phases, gait.period, gait.stance, config.swing, KD / KP)
        target = STANCE + config.action_scale * action + swing
        target = np.clip(target, self._limits.lower[LEGS], self._limits.upper[LEGS])
        self.world.step(target, self.upper.target, self._pushes.force, self._pushes.on_torso, round(dt / STEP))
        truth = self.world.truth
        reward, terms = self._rewards(
            truth, self.twist, self.gait, action, self._action, self._capture, self._misplaced,
            landing_errors(truth, self.twist, self.gait), self.recovers, self.difficulty.strictness, dt,
        )  # fmt: skip
        self._action = action
        self.age += dt
        low = truth.height - truth.clearance.mean(axis=1) < 0.6
        tilted = truth.R[:, 2, 2] < np.cos(self._limits.tilt)
        diverged = ~np.isfinite(truth.q).all(axis=1) | ~np.isfinite(reward)
        ended = low | tilted | self.world.stopped | diverged
        reward = np.where(diverged, 0.0, reward) - config.fall * ended
        truncated = ~ended & (self.age >= config.episode)
        self._left -= dt
        self._command(np.flatnonzero(self._left <= 0.0))
        maximum = np.array(config.accelerate) * dt
        self.twist = self.twist + np.clip(self._goal - self.twist, -maximum, maximum)
        stopped = ~self._goal.any(axis=1) & (np.linalg.norm(self.twist, axis=1) < 0.1)
        self.twist[stopped] = 0.0
        self._advance_gait(dt)
        return Step(reward, ended, truncated, terms)

    def restart(self, where: Rows) -> None:
        """Start the robots `where` anew after a step, and make their measurements current."""
        if len(where):
            self.reset(where)
            self.world.read()
            self._balance()

    def _advance_gait(self, dt: float) -> None:
        self._balance()
        before = self.gait.phases >= self.config.gait.stance
        self.gait.step(self.walking, self._capture, self._misplaced, dt)
        swing = (self.gait.phases >= self.config.gait.stance) & self.gait.stepping[:, None]
        middle = np.abs(self.gait.phases - 0.5 * (1.0 + self.config.gait.stance)) < 0.06
        self.world.shim(before & swing & middle & (self.world.truth.force < 1.0))

    def _balance(self) -> None:
        """Compute the balance errors as the base layer does: from measured joints and the estimated velocity."""
        sensed, R = self.world.sensed, self.world.sensed.R
        p, R_foot = leg_poses(sensed.q[:, :12])
        soles = np.einsum("nij,nkj->nki", R, sole_centers(p, R_foot))
        com = self.world.truth.com
        spin = np.einsum("nij,nj->ni", R, sensed.rate)
        velocity = sensed.velocity + np.cross(spin, com)
        self._capture, self._misplaced = balance_errors(R, com, velocity, soles, FEET_APART)

    def _command(self, where: Rows) -> None:
        rng, m, e = self._rng, len(where), self.config.envelope
        if not m:
            return
        low, high = np.array([e.vx, e.vy, e.wz]).T
        twist = rng.uniform(low, high, (m, 3))
        # Often along one axis only: that is how robots are driven.
        keep = rng.integers(-2, 3, m)
        for axis in range(3):
            twist[:, axis] = np.where((keep < 0) | (keep == axis), twist[:, axis], 0.0)
        ends = np.stack([low, np.zeros(3), high])[rng.integers(0, 3, (m, 3)), np.arange(3)]
        twist = np.where(rng.random((m, 1)) < self.config.corners, ends, twist)
        slow = rng.random((m, 1)) < self.config.creeping
        twist = np.where(slow, twist * rng.uniform(0.05, 0.3, (m, 1)), twist)
        still = (rng.random(m) < self.config.standing) | (np.linalg.norm(twist, axis=1) < 0.02)
        self._goal[where] = np.where(still[:, None], 0.0, twist)
        self._left[where] = rng.uniform(*self.config.hold, m)
