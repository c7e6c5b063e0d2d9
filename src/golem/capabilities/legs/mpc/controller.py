"""Sampling MPC behind the lower-body contract: it stands, by planning a second ahead many times a second.

Both keep a plan of joint targets at evenly spaced knots, linear between them, draw variations of it, and move the plan
towards what turned out cheap: the mean of the cheapest share (CEM; de Boer et al., Annals of OR 2005) or the cheapest
alone (predictive sampling; Howell et al., arXiv 2212.00541). One iteration per plan; the next one starts from the plan
shifted by the time that has passed.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from golem.capabilities.legs.balance_errors import balance_errors
from golem.capabilities.legs.base import LocomotionCommand
from golem.capabilities.legs.gait import GaitConfig
from golem.capabilities.legs.hold import STANCES, height_of, squat, standing
from golem.capabilities.legs.mpc.planning_model import PlanningModel, Stance, Trajectories
from golem.errors import ConfigError, GolemError, unknown_name
from golem.finite import check_finite, check_measured
from golem.interfaces.payloads import LegCommand
from golem.types import LEGS, Array, BaseEstimate, LowState

Method = Literal["cem", "predictive_sampling"]


@dataclass(frozen=True, slots=True)
class PlannerConfig:
    """How plans are varied and chosen.

    Attributes:
        method: `cem` or `predictive_sampling`.
        samples: rollouts per plan, the present plan among them.
        knots: knots of the spline.
        elite: share of the samples that CEM averages.
        gain: share of the way to that average that CEM moves a plan which is among the elite itself, so that a robot
            that stands well is not shaken by the sampling; a plan that is not goes all the way.
        noise: standard deviation of hip yaw, pitch, roll, knee, ankle pitch, roll that sampling starts from [rad].
        narrowest: CEM fits the noise to the elite, but not below this share of `noise`.
        wide: share of the samples that keep the full `noise` nevertheless: they find the way out after a push.
        seed: of the planner's own random numbers.
    """

    method: Method = "cem"
    samples: int = 12
    knots: int = 4
    elite: float = 0.17
    gain: float = 0.3
    noise: tuple[float, ...] = (0.015, 0.09, 0.06, 0.11, 0.3, 0.11)
    narrowest: float = 0.1
    wide: float = 0.25
    seed: int = 0


class Planner:
    """The plan, its noise and the random numbers."""

    def __init__(self, config: PlannerConfig, horizon: float, lower: Array, upper: Array) -> None:
        """Begin without a plan; the last knot will be at `horizon` [s], targets from `lower` to `upper` (12,) [rad].

        Raises ConfigError: fewer than two samples or knots, an elite outside 0 to 1, or not six values of noise.
        """
        if config.samples < 2 or config.knots < 2:
            raise ConfigError(
                f"The planner needs at least two samples and two knots, not {config.samples} and {config.knots}."
            )
        if not 0.0 < config.elite <= 1.0:
            raise ConfigError(f"The planner's elite is a share between 0 and 1, not {config.elite}.")
        if len(config.noise) != 6 or min(config.noise) <= 0.0:
            raise ConfigError(
                "The planner needs six positive values of noise: hip yaw, pitch, roll, knee, ankle pitch, roll."
            )
        self._config = config
        self._lower, self._upper = lower, upper
        self._times: Array = np.linspace(0.0, horizon, config.knots)
        self._noise: Array = np.tile(config.noise, (config.knots, 2))
        self.reset(np.zeros_like(lower))

    def reset(self, targets: Array) -> None:
        """Plan to stay at `targets` (12,) [rad], with the noise and the random numbers of the beginning."""
        self._plan: Array = np.tile(targets, (self._config.knots, 1))
        self._deviation = self._noise.copy()
        self._random = np.random.default_rng(self._config.seed)

    def targets(self, times: Array, knots: Array | None = None) -> Array:
        """Return the targets (..., len(times), 12) at `times` [s] of `knots` (..., knots, 12) or of the plan [rad].

        Beyond the last knot the targets stay where they are.
        """
        place = np.clip(times / self._times[1], 0.0, self._config.knots - 1)
        first = np.minimum(place.astype(int), self._config.knots - 2)
        share = (place - first)[:, None]
        values = self._plan if knots is None else knots
        return (1.0 - share) * values[..., first, :] + share * values[..., first + 1, :]

    def shift(self, dt: float) -> None:
        """Let the plan begin `dt` later [s]."""
        self._plan = self.targets(self._times + dt)

    def move(self, by: Array) -> None:
        """Let the whole plan go along with a reference posture that has moved `by` (12,) [rad]."""
        self._plan = np.clip(self._plan + by, self._lower, self._upper)

    def sample(self) -> Array:
        """Return the knots (samples, knots, 12) to try; the first are those of the present plan."""
        noise = self._random.standard_normal((self._config.samples - 1, *self._plan.shape))
        wide = round(self._config.wide * len(noise))
        noise[:wide] *= self._noise
        noise[wide:] *= self._deviation
        return np.concatenate([self._plan[None], np.clip(self._plan + noise, self._lower, self._upper)])

    def update(self, knots: Array, costs: Array) -> bool:
        """Move the plan towards the cheap ones of `knots` (samples, knots, 12), which cost `costs` (samples,).

        Rollouts whose cost is not finite lose against all others; where there are no others the plan stays, and False
        is returned.
        """
        config = self._config
        order = np.argsort(np.where(np.isfinite(costs), costs, np.inf), kind="stable")
        order = order[: np.count_nonzero(np.isfinite(costs))]
        if not len(order):
            return False
        if config.method == "predictive_sampling":
            self._plan = knots[order[0]]
            return True
        best = order[: max(2, round(config.elite * config.samples))]
        elite = knots[best]
        self._plan = self._plan + (config.gain if 0 in best else 1.0) * (elite.mean(axis=0) - self._plan)
        self._deviation = np.clip(elite.std(axis=0), config.narrowest * self._noise, self._noise)
        return True


@dataclass(frozen=True, slots=True)
class CostConfig:
    """Weights of the squared residuals; each residual is divided by what makes it count as 1.

    Attributes:
        height: CoM height against that of the reference stance, 5 cm.
        velocity: horizontal CoM velocity, 0.2 m/s.
        orientation: tilt of base_link, 0.1 rad, and half as much its angular rate, 1 rad/s.
        capture: capture point against the middle of the feet, 5 cm.
        feet: feet against where they belong relative to each other, 5 cm.
        effort: motor torques against the motors' bounds, mean over the motors.
        posture: leg joints against those of the stance, 0.1 rad, mean over the joints.
    """

    height: float = 1.0
    velocity: float = 0.5
    orientation: float = 1.0
    capture: float = 2.0
    feet: float = 0.3
    effort: float = 3.0
    posture: float = 0.3


def cost(config: CostConfig, runs: Trajectories, stance: Stance, torque: Array) -> Array:
    """Return the (n,) costs of `runs`, rollouts of m steps; `torque` (12,) bounds the motors [N m]."""
    capture, misplaced = balance_errors(runs.R, runs.com, runs.com_velocity, runs.soles, stance.feet)
    height = runs.com[..., 2] - runs.soles[..., 2].min(axis=-1) - stance.com_height
    total = (
        config.height * (height / 0.05) ** 2
        + config.velocity * _square(runs.com_velocity[..., :2] / 0.2)
        + config.orientation * (_square(runs.R[..., 2, :2] / 0.1) + 0.5 * _square(runs.rate))
        + config.capture * _square(capture / 0.05)
        + config.feet * (misplaced / 0.05) ** 2
        + config.effort * _square(runs.torque / torque) / torque.size
        + config.posture * _square((runs.q - stance.posture) / 0.1) / torque.size
    )
    return total.mean(axis=-1)


def _square(residual: Array) -> Array:
    return np.einsum("...i,...i->...", residual, residual)


FAILURES = 5
"""Plans in a row that may fail: a tenth of a second at 50 plans a second, on the plan of before."""


class PlanningError(GolemError):
    """The MPC has found no plan for too long."""


@dataclass(frozen=True, slots=True)
class MPCConfig:
    """Options of `MPC`.

    Attributes:
        planner: how plans are varied and chosen.
        cost: what a plan shall achieve.
        stance: name of the reference posture in `STANCES`.
        heights: lowest and highest height that is taken [m]; `off` takes none.
        kp: stiffness of hip yaw, pitch, roll, knee, ankle pitch, ankle roll [N m/rad].
        kd: damping of the same six joints [N m s/rad].
        horizon: how far a plan looks ahead [s].
        timestep: step of the rollouts [s].
        rate: ticks per second at which the plan is followed [Hz].
        plan_rate: plans per second [Hz], at most `rate`.
        latency: time one plan takes; see `LowerBody.latency`.
        threads: worker threads of the rollouts; 0 uses the caller's thread.
    """

    planner: PlannerConfig = field(default_factory=PlannerConfig)
    cost: CostConfig = field(default_factory=CostConfig)
    stance: str = "crouch"
    heights: tuple[float, float] | None = (0.80, 1.0)
    kp: tuple[float, ...] = (200.0, 200.0, 200.0, 300.0, 40.0, 40.0)
    kd: tuple[float, ...] = (2.5, 2.5, 2.5, 4.0, 2.0, 2.0)
    horizon: float = 1.0
    timestep: float = 0.02
    rate: float = 50.0
    plan_rate: float = 50.0
    latency: float = 0.02
    threads: int = 2


class MPC:
    """Stands by sampling model predictive control, by the plan of `planner`; its envelope has heights only.

    The command of every tick is the plan's value `latency` later, which is when the command arrives. What a new plan
    cannot change any more, because the legs will have done it by the time the plan is there, is the same in all of its
    rollouts.
    """

    def __init__(self, config: MPCConfig | None = None) -> None:
        """Build the planning model.

        Raises ConfigError: the stance is unknown, the gains are not six each, a time or rate is not positive, or an
        option of the planner is wrong.
        """
        self.config = c = config or MPCConfig()
        if c.stance not in STANCES:
            raise unknown_name("stance", c.stance, STANCES)
        if len(c.kp) != 6 or len(c.kd) != 6:
            raise ConfigError(
                "The MPC needs six values of kp and of kd: hip yaw, pitch, roll, knee, ankle pitch, roll."
            )
        if not 0.0 < c.timestep < c.horizon:
            raise ConfigError(
                f"The MPC's timestep ({c.timestep} s) must be positive and below its horizon ({c.horizon} s)."
            )
        if not 0.0 < c.plan_rate <= c.rate:
            raise ConfigError(
                f"The MPC's plan_rate ({c.plan_rate} Hz) must be positive and at most its rate ({c.rate} Hz)."
            )
        self.rate = c.rate
        self.latency = c.latency
        self.gait = GaitConfig(start="never")
        self._kp: Array = np.tile(c.kp, 2)
        self._kd: Array = np.tile(c.kd, 2)
        self._rest = np.tile(STANCES[c.stance], 2)
        self.envelope = standing(height_of(self._rest), c.heights)
        self._model = PlanningModel(self._rest, self._kp, self._kd, c.timestep, c.threads)
        self.planner = Planner(c.planner, c.horizon, self._model.lower, self._model.upper)
        self._times: Array = c.timestep * np.arange(round(c.horizon / c.timestep), dtype=np.float64)
        self._committed = int(np.count_nonzero(self._times < c.latency - 1e-9))
        self._age = np.inf
        self._failures = 0

    def reset(self, state: LowState) -> None:
        """Plan to stay in the posture of `state`."""
        self._model.posture = self._rest
        self.planner.reset(np.clip(state.q[LEGS], self._model.lower, self._model.upper))
        self._age = np.inf
        self._failures = 0

    def step(self, state: LowState, base: BaseEstimate, motion: LocomotionCommand, dt: float) -> LegCommand:
        """Return the plan's targets for when they arrive, after planning anew if it is time; see `LowerBody.step`.

        Raises PlanningError: no rollout has been finite for `FAILURES` plans in a row.
        """
        self._age += dt
        if self._age > 1.0 / self.config.plan_rate - 0.5 * dt:
            self.plan(state, base, self._rest if motion.height is None else squat(motion.height))
        q = self.planner.targets(np.array([self._age + self.latency]))[0]
        return LegCommand(q=q, kp=self._kp.copy(), kd=self._kd.copy(), tau=self._model.stance.tau.copy())

    def plan(self, state: LowState, base: BaseEstimate, posture: Array) -> None:
        """Plan once, from `state` and `base` towards `posture` (12,) [rad]: sample, roll out and choose."""
        if np.isfinite(self._age):
            self.planner.shift(self._age)
        self._age = 0.0
        check_measured(state)
        check_finite("the pose of the base", base.T_odom_base)
        check_finite("the velocity of the base", base.velocity)
        if posture is not self._model.posture:
            self.planner.move(posture - self._model.posture)
            self._model.posture = posture
        self._model.measure(state, base)
        knots = self.planner.sample()
        targets = self.planner.targets(self._times, knots)
        targets[:, : self._committed] = targets[0, : self._committed]
        costs = cost(self.config.cost, self._model.rollout(targets), self._model.stance, self._model.torque)
        self._failures = 0 if self.planner.update(knots, costs) else self._failures + 1
        if self._failures >= FAILURES:
            raise PlanningError(f"No rollout of the MPC was finite for {FAILURES} plans in a row.")
