"""Rungs of the ladder as gymnasium environments: `gymnasium.make("golem/tether-v0")`.

`reset(seed=k)` is the scene of trial k of `golem ladder`, whose judge says at the end whether the errand is done. The
trial runs in a thread of its own as on the ladder, but that its errand asks the agent what to do; one thread runs at a
time.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np
import pinocchio as pin

from golem.capabilities.arms.steps import led
from golem.capabilities.policies.observer import Observer
from golem.datasets.sampling import recipe
from golem.errors import ConfigError, needs, unknown_name
from golem.robots.model.magpie_model import MAX_GAP
from golem.robots.mujoco.gl import choose_backend
from golem.skills.base import SkillResult
from golem.skills.context import Context
from golem.skills.served_policy import FORCE
from golem.types import SIDES, Array, Twist

with needs("gymnasium", "gym"):
    import gymnasium as gym
    from gymnasium import spaces

RUNGS = ("tether", "stand", "fridge-tether", "fridge-stand", "counter-tether", "counter-stand")
"""Rungs that are one errand of arms and hands."""
ACTIONS: tuple[str, ...] = (
    *(f"{side}_palm.{axis}" for side in SIDES for axis in ("vx", "vy", "vz", "wx", "wy", "wz")),
    *(f"{side}_hand.gap" for side in SIDES),
    *("base.vx", "base.vy", "base.wz", "base.height"),
)
"""Names of the action's entries, each from -1 to 1: twists of both palms in base_link, openings (-1 closes), twist of
the base, its height about the legs' own."""
SPEED, TURN, BASE, DROP = 0.25, 1.0, np.array([0.3, 0.2, 0.4]), 0.15
"""What 1 is for a palm [m/s], [rad/s], the base [m/s], [rad/s], and its height [m]."""
QUICK, LEAD = 5.0, 0.05
"""Acceleration of a palm target [m/s^2], and how far it may run ahead of the hand [m]."""
PARTS: dict[str, tuple[slice, float]] = {
    "q": (slice(0, 27), 7.0),
    "dq": (slice(27, 54), 60.0),
    "palms": (slice(54, 72), 5.0),
    "gaps": (slice(72, 74), 0.2),
    "forces": (slice(74, 78), 100.0),
    "base": (slice(78, 85), 10.0),
}
"""Observation -> entries of the state vector, see `golem.capabilities.policies.vectors.STATE`, and their bound."""
Line = queue.SimpleQueue[Any]


class _Over(BaseException):
    """The environment was reset or closed while its trial waited."""


class GolemEnv(gym.Env[dict[str, Any], Any]):
    """One rung; see `golem.evaluation.base.Rung`."""

    metadata: ClassVar[dict[str, Any]] = {"render_modes": []}

    def __init__(
        self,
        rung: str = "tether",
        profile: str = "field",
        ladder_seed: int = 0,
        period: float = 0.05,
        limit: float = 60.0,
        cameras: tuple[str, ...] = (),
        width: int = 96,
        use: dict[str, str] | None = None,
        options: dict[str, Any] | None = None,
    ) -> None:
        """Choose what is run.

        Args:
            rung: one of `RUNGS`.
            profile: realism of sensors and world.
            ladder_seed: seed of the ladder whose trials these are.
            period: robot time of a step [s].
            limit: robot time of an episode [s].
            cameras: whose pictures are observed.
            width: of them [px].
            use: slot -> implementation that replaces the rung's.
            options: of the rung.

        Raises:
            ConfigError: an option is wrong.
        """
        if rung not in RUNGS:
            raise unknown_name("environment's rung", rung, RUNGS)
        if not 0.01 <= period <= 1.0:
            raise ConfigError(f"A step takes 0.01 to 1 s, not {period:g}.")
        choose_backend()
        self._named, self._profile, self._ladder = rung, profile, ladder_seed
        self.ticks, self.limit, self._use, self._options = round(period / 0.01), limit, use or {}, options or {}
        self.cameras, self.width, self.late = cameras, width, False
        self.action_names = ACTIONS
        self.action_space: spaces.Space[Any] = spaces.Box(-1.0, 1.0, (len(ACTIONS),), np.float32)
        each: dict[str, spaces.Space[Any]] = {
            name: spaces.Box(-bound, bound, (part.stop - part.start,), np.float32)
            for name, (part, bound) in PARTS.items()
        }
        for name, (wide, high) in recipe(15, cameras, width, False, ()).cameras.items():
            each[f"image_{name}"] = spaces.Box(0, 255, (high, wide, 3), np.uint8)
        self.observation_space = spaces.Dict(each)
        self._trial: tuple[threading.Thread, Line, Line] | None = None
        self._last: dict[str, Any] = {}

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Begin the trial of number `seed`; without one, a trial of a number that is drawn."""
        super().reset(seed=seed)
        self.close()
        index, told, seen = int(self.np_random.integers(2**31)) if seed is None else seed, Line(), Line()
        thread = threading.Thread(target=self._run, args=(index, told, seen), name=f"trial {index}", daemon=True)
        self._trial = thread, told, seen
        thread.start()
        outcome = self._wait()
        if outcome is not None:
            raise ConfigError(f"The trial ended before it began: {outcome.detail}")
        return self._last, {"trial": index}

    def step(self, action: Array) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Let one period pass; the reward is 1 where the judge says at the end that the errand is done."""
        if self._trial is None:
            raise gym.error.ResetNeeded("This episode is over; call reset.")
        values = np.asarray(action, np.float64)
        if values.shape != (len(ACTIONS),) or not np.isfinite(values).all():
            raise ConfigError(f"An action is {len(ACTIONS)} finite numbers, not an array of shape {values.shape}.")
        self._trial[1].put(np.clip(values, -1.0, 1.0))
        outcome = self._wait()
        if outcome is None:
            return self._last, 0.0, False, False, {}
        out_of_time = self.late and not outcome.success
        info = {"success": outcome.success, "stage": outcome.stage, "detail": outcome.detail}
        return self._last, float(outcome.success), not out_of_time, out_of_time, info

    def close(self) -> None:
        """End the trial that runs."""
        if self._trial is not None:
            self._trial[1].put(None)
            self._trial[0].join()
            self._trial = None

    def _wait(self) -> Any:
        """Take the next observation and return None, or return the outcome of the trial; raise what it raised."""
        assert self._trial is not None
        seen, outcome, error = self._trial[2].get()
        if seen is not None:
            self._last = seen
            return None
        self._trial = None
        if error is not None:
            raise error
        return outcome

    def _run(self, index: int, told: Line, seen: Line) -> None:
        from golem.evaluation.base import RUNGS as TARGETS
        from golem.evaluation.base import TrialSpec, make_rung
        from golem.evaluation.episodes.oracle import Oracle
        from golem.runtime.lockstep import LockstepRunner

        rung, self.late, oracles = make_rung(TARGETS[self._named], self._options), False, list[Oracle]()

        def look(running: LockstepRunner, robot: Any) -> None:
            oracles.append(Oracle(robot))
            done = oracles[0].screws_in_tray if self._named in ("tether", "stand") else lambda: False
            errand = _Errand(self, told, seen, done)

            def execute(skill: object, goal: object, *given: Any, **named: Any) -> Any:
                result = LockstepRunner.execute(running, errand, goal, *given, **named)
                if errand.observer is not None and errand.observer.look() is not None:
                    self._last = errand.frame()  # what the last action led to, also where it ended the trial
                return result

            running.execute = execute

        rung.onlooker = look
        try:
            method, use, options = rung.default_methods[-1], self._use, self._options
            spec = TrialSpec(self._named, method, self._profile, self._ladder, index, use, options)
            seen.put((None, rung.run(spec, None), None))
        except _Over:
            pass
        except BaseException as error:  # of whatever kind, it is the agent's to hear of
            seen.put((None, None, error))
        finally:
            for oracle in oracles:
                oracle.close()


class _Errand:
    """Does what the agent says, in the place of the rung's own skill."""

    def __init__(self, env: GolemEnv, told: Line, seen: Line, done: Callable[[], Any]) -> None:
        self._env, self._told, self._seen, self._done = env, told, seen, done
        self._gaps: list[float] = [np.inf, np.inf]
        self.observer: Observer | None = None

    async def run(self, context: Context, goal: object) -> SkillResult:
        """Ask, and do, until the errand is done or its time is over; see `Routine`."""
        env = self._env
        self.observer = observer = Observer(context.bus, env.cameras, env.width)
        await context.until(lambda: observer.look() is not None, 5.0)
        end = context.t + env.limit - 1e-6
        self._goals = {side: context.arms[side].pose for side in SIDES}
        while not self._done() and context.t < end:
            self._seen.put((self.frame(), None, None))
            action = self._told.get()
            if action is None:
                raise _Over
            for _ in range(env.ticks):
                self._move(context, action)
                await context.tick()
        env.late = context.t >= end
        return SkillResult(True, "done", None, "The agent's time is over." if env.late else "The agent is done.")

    def frame(self) -> dict[str, Any]:
        """Return the observation of this moment."""
        assert self.observer is not None
        out, seen = {}, self.observer.observation() or {}
        for name, (part, bound) in PARTS.items():
            out[name] = np.clip(seen["observation.state"][part], -bound, bound)
        return out | {f"image_{name}": seen[f"observation.images.{name}"] for name in self._env.cameras}

    def _move(self, context: Context, action: Array) -> None:
        """Do an action (18,), see `ACTIONS`, for one tick of the skill."""
        R, dt = context.T_odom_base[:3, :3], context.period
        for k, side in enumerate(SIDES):
            twist, arm, goal = action[6 * k : 6 * k + 6], context.arms[side], self._goals[side]
            if arm.sent or np.abs(twist).max() > 1e-3:
                self._goals[side] = goal = led(goal, arm.pose, dt * SPEED * (R @ twist[:3]), LEAD)
                goal[:3, :3] = pin.exp3(dt * TURN * (R @ twist[3:])) @ goal[:3, :3]
                arm.approach(goal, SPEED, QUICK)
            gap = float(0.5 * (action[12 + k] + 1.0) * MAX_GAP)
            shut = 0.05 * MAX_GAP
            if abs(gap - self._gaps[k]) > 0.02 * MAX_GAP or (gap < shut) != (self._gaps[k] < shut):
                self._gaps[k], hand = gap, context.hands[side]
                hand.close(FORCE) if gap < shut else hand.open(gap)
        heights = context.legs.status.heights if context.legs.reporting else None
        height = None if heights is None else float(np.clip(heights[1] + DROP * action[17], heights[0], heights[2]))
        vx, vy, wz = (BASE * action[14:17]).tolist()
        context.legs.drive(Twist(vx, vy, wz, height))


def register() -> None:
    """Make the environments known to gymnasium; `gymnasium.make` does so by itself where GOLEM is installed."""
    for rung in RUNGS:
        if f"golem/{rung}-v0" not in gym.registry:
            gym.register(f"golem/{rung}-v0", "golem.datasets.gym_env:GolemEnv", kwargs={"rung": rung})


register()
