"""Sampling MPC behind the lower-body contract: it stands, by planning a second ahead many times a second."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from golem.capabilities.legs.balance_errors import balance_errors
from golem.capabilities.legs.base import LocomotionCommand
from golem.capabilities.legs.gait import GaitConfig
from golem.capabilities.legs.hold import STANCES, height_of, squat, standing
from golem.capabilities.legs.mpc.planner import Planner, PlannerConfig
from golem.capabilities.legs.mpc.planning_model import PlanningModel, Stance, Trajectories
from golem.errors import ConfigError, GolemError, unknown_name
from golem.finite import check_finite, check_measured
from golem.interfaces.payloads import LegCommand
from golem.types import LEGS, Array, BaseEstimate, LowState


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
    """Return the (n,) costs of `runs`.

    Args:
        runs: n rollouts of m steps.
        stance: the reference stance.
        torque: (12,) bounds of the motor torques [N m].
    """
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
    """Stands by sampling model predictive control; it cannot walk, and its envelope says so: it has heights only.

    The command of every tick is the plan's value `latency` later, which is when the command arrives. What a new plan
    cannot change any more, because the legs will have done it by the time the plan is there, is the same in all of its
    rollouts.

    Attributes:
        rate, latency, envelope, gait: see `LowerBody`.
        planner: the present plan.
    """

    def __init__(self, config: MPCConfig | None = None) -> None:
        """Build the planning model.

        Raises:
            ConfigError: the stance is unknown, the gains are not six each, a time or rate is not positive, or an option
                of the planner is wrong.
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

        Raises:
            PlanningError: no rollout has been finite for `FAILURES` plans in a row.
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
        runs = self._model.rollout(targets)
        costs = cost(self.config.cost, runs, self._model.stance, self._model.torque)
        self._failures = 0 if self.planner.update(knots, costs) else self._failures + 1
        if self._failures >= FAILURES:
            raise PlanningError(f"No rollout of the MPC was finite for {FAILURES} plans in a row.")
