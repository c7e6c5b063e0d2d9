"""Rungs of the ladder as gymnasium environments: `gymnasium.make("golem/tether-v0")`.

`reset(seed=k)` is the scene of trial k of `golem ladder`, whose judge says at the end whether the errand is done. The
trial runs in a thread of its own as on the ladder, but that its errand asks the agent what to do; one thread runs at a
time.
"""

from __future__ import annotations

import queue
import threading
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from golem.datasets.sampling import resized
from golem.errors import ConfigError, MissingExtra, unknown_name
from golem.types import SIDES, Array, Twist

try:
    import gymnasium as gym
    from gymnasium import spaces
except ModuleNotFoundError as error:
    raise MissingExtra("gymnasium", "gym") from error

RUNGS = ("tether", "stand", "fridge-tether", "fridge-stand", "counter-tether", "counter-stand")
"""Rungs that are one errand of arms and hands."""
ACTIONS: tuple[str, ...] = (
    *(f"{side}_palm.{axis}" for side in SIDES for axis in ("vx", "vy", "vz", "wx", "wy", "wz")),
    *(f"{side}_hand.gap" for side in SIDES),
    *("base.vx", "base.vy", "base.wz", "base.height"),
)
"""Names of the action's entries, each from -1 to 1: twists of both palms in base_link, openings (-1 closes), twist of
the base, its height about the legs' own."""
SPEED, TURN = 0.25, 1.0
"""What 1 is for a palm [m/s], [rad/s]."""
BASE = np.array([0.3, 0.2, 0.4])
"""What 1 is for the base [m/s], [rad/s]."""
DROP = 0.15
"""What -1 is for its height [m]."""
QUICK = 5.0
"""Acceleration of a palm target [m/s^2]."""
LEAD = 0.05
"""How far a palm target may run ahead of the hand [m]."""
_BOUND = {"q": 7.0, "dq": 60.0, "palms": 5.0, "gaps": 0.2, "forces": 100.0, "base": 10.0}
_PART = {
    "q": slice(0, 27), "dq": slice(27, 54), "palms": slice(54, 72), "gaps": slice(72, 74), "forces": slice(74, 78),
    "base": slice(78, 85),
}  # fmt: skip
"""Observation -> entries of the state vector, see `golem.capabilities.policies.vectors.STATE`."""


class _Over(BaseException):
    """The environment was reset or closed while its trial waited."""


@dataclass
class _Trial:
    """A trial in its thread, and what it and the agent hand to each other."""

    thread: threading.Thread
    told: queue.SimpleQueue[Any]
    seen: queue.SimpleQueue[Any]


class GolemEnv(gym.Env[dict[str, Any], Array]):
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
            cameras: whose pictures are observed, `width` pixels wide.
            width: see there.
            use: slot -> implementation that replaces the rung's.
            options: of the rung.

        Raises:
            ConfigError: an option is wrong.
        """
        from golem.datasets.sampling import recipe
        from golem.robots.mujoco.gl import choose_backend

        if rung not in RUNGS:
            raise unknown_name("environment's rung", rung, RUNGS)
        if not 0.01 <= period <= 1.0:
            raise ConfigError(f"A step takes 0.01 to 1 s, not {period:g}.")
        choose_backend()
        self._rung_name, self._profile, self._seed = rung, profile, ladder_seed
        self._ticks, self._limit, self._use, self._options = round(period / 0.01), limit, use or {}, options or {}
        self._cameras = recipe(15, cameras, width, False, ()).cameras
        self.action_names = ACTIONS
        self.action_space = spaces.Box(-1.0, 1.0, (len(ACTIONS),), np.float32)
        size = {name: part.stop - part.start for name, part in _PART.items()}
        each: dict[str, spaces.Space[Any]] = {k: spaces.Box(-b, b, (size[k],), np.float32) for k, b in _BOUND.items()}
        for name, info in self._cameras.items():
            each[f"image_{name}"] = spaces.Box(0, 255, (info.height, info.width, 3), np.uint8)
        self.observation_space = spaces.Dict(each)
        self._trial: _Trial | None = None
        self._last: dict[str, Any] = {}

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Begin the trial of number `seed`; without one, a trial of a number that is drawn."""
        super().reset(seed=seed)
        self._end()
        index = int(self.np_random.integers(2**31)) if seed is None else seed
        told: queue.SimpleQueue[Any] = queue.SimpleQueue()
        seen: queue.SimpleQueue[Any] = queue.SimpleQueue()
        thread = threading.Thread(target=self._run, args=(index, told, seen), name=f"trial {index}", daemon=True)
        self._trial = _Trial(thread, told, seen)
        thread.start()
        self._last, _ = self._wait()
        return self._last, {"trial": index}

    def step(self, action: Array) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Let one period pass; the reward is 1 where the judge says at the end that the errand is done."""
        if self._trial is None:
            raise gym.error.ResetNeeded("This episode is over; call reset.")
        values = np.asarray(action, np.float64)
        if values.shape != (len(ACTIONS),) or not np.isfinite(values).all():
            raise ConfigError(f"An action is {len(ACTIONS)} finite numbers, not an array of shape {values.shape}.")
        self._trial.told.put(np.clip(values, -1.0, 1.0))
        seen, outcome = self._wait()
        if outcome is None:
            self._last = seen
            return seen, 0.0, False, False, {}
        self._trial = None
        out_of_time = not outcome.success and self._late
        info = {"success": outcome.success, "stage": outcome.stage, "detail": outcome.detail}
        return self._last, float(outcome.success), not out_of_time, out_of_time, info

    def close(self) -> None:
        """End the trial that runs."""
        self._end()

    def _end(self) -> None:
        if self._trial is not None:
            self._trial.told.put(None)
            self._trial.thread.join()
            self._trial = None

    def _wait(self) -> tuple[dict[str, Any], Any]:
        """Return the next observation, or the outcome of the trial.

        Raises:
            Exception: what the trial raised.
        """
        assert self._trial is not None
        seen, outcome, error = self._trial.seen.get()
        if error is not None:
            self._trial = None
            raise error
        if outcome is not None and not self._last:
            raise ConfigError(f"The trial ended before it began: {outcome.detail}")
        return seen, outcome

    def _run(self, index: int, told: queue.SimpleQueue[Any], seen: queue.SimpleQueue[Any]) -> None:
        """Run one trial, in its thread."""
        from golem.evaluation.base import RUNGS as TARGETS
        from golem.evaluation.base import TrialSpec, make_rung
        from golem.evaluation.episodes.oracle import Oracle
        from golem.runtime.lockstep import LockstepRunner

        rung, self._late = make_rung(TARGETS[self._rung_name], self._options), False
        oracles: list[Oracle] = []

        def look(running: LockstepRunner, robot: Any) -> None:
            oracles.append(Oracle(robot))
            done = oracles[0].screws_in_tray if self._rung_name in ("tether", "stand") else lambda: False
            errand = _Errand(self, told, seen, done)

            def execute(skill: object, goal: object, *given: Any, **named: Any) -> Any:
                return LockstepRunner.execute(running, errand, goal, *given, **named)

            running.execute = execute

        rung.onlooker = look
        try:
            spec = TrialSpec(
                self._rung_name, rung.default_methods[-1], self._profile, self._seed, index, self._use, self._options
            )
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

    def __init__(self, env: GolemEnv, told: queue.SimpleQueue[Any], seen: queue.SimpleQueue[Any], done: Any) -> None:
        self._env, self._told, self._seen, self._done = env, told, seen, done

    async def run(self, context: Any, goal: object) -> Any:
        """Ask, and do, until the errand is done or its time is over; see `Routine`."""
        from golem.capabilities.policies.vectors import Vectors, instant
        from golem.interfaces import topics
        from golem.skills.base import SkillResult

        env, vectors = self._env, Vectors()
        context.publish(topics.CAMERAS_WANTED, tuple(env._cameras))

        def frame() -> dict[str, Any] | None:
            now = instant(context.bus)
            pictures = {name: context.bus.latest(topics.exposures(name)) for name in env._cameras}
            if now is None or any(picture is None for picture in pictures.values()):
                return None
            state = vectors.state(now)
            out = {k: np.clip(state[p], -_BOUND[k], _BOUND[k]).astype(np.float32) for k, p in _PART.items()}
            for name, picture in pictures.items():
                info = env._cameras[name]
                out[f"image_{name}"] = resized(picture.rgb, (info.width, info.height))
            return out

        await context.until(lambda: frame() is not None, 5.0)
        end, mover = context.t + env._limit, Mover(context)
        while not self._done() and context.t < end - 1e-6:
            self._seen.put((frame(), None, None))
            action = self._told.get()
            if action is None:
                raise _Over
            for _ in range(env._ticks):
                mover.move(action)
                await context.tick()
        env._late = context.t >= end - 1e-6
        return SkillResult(True, "done", None, "The agent's time is over." if env._late else "The agent is done.")


class Mover:
    """Does relative actions: palm targets run ahead of the hands by `LEAD` at most."""

    def __init__(self, context: Any) -> None:
        """Move the robot of `context`."""
        self._context = context
        self._goals = {side: context.arms[side].pose for side in SIDES}
        self._gaps: list[float | None] = [None, None]
        self._height: float | None = None

    def move(self, action: Array) -> None:
        """Do an action (18,), see `ACTIONS`, for one tick of the skill."""
        import pinocchio as pin

        from golem.robots.model.magpie_model import MAX_GAP
        from golem.skills.served_policy import FORCE

        context, dt = self._context, self._context.period
        R = context.T_odom_base[:3, :3]
        for k, side in enumerate(SIDES):
            twist, arm = action[6 * k : 6 * k + 6], context.arms[side]
            if arm.sent or np.abs(twist).max() > 1e-3:
                goal, here = self._goals[side], arm.pose[:3, 3]
                ahead = goal[:3, 3] + dt * SPEED * (R @ twist[:3]) - here
                size = float(np.linalg.norm(ahead))
                goal[:3, 3] = here + ahead * min(1.0, LEAD / max(size, 1e-9))
                goal[:3, :3] = pin.exp3(dt * TURN * (R @ twist[3:])) @ goal[:3, :3]
                u, _, v = np.linalg.svd(goal[:3, :3])
                goal[:3, :3] = u @ v
                arm.approach(goal.copy(), SPEED, QUICK)
            gap = float(0.5 * (action[12 + k] + 1.0) * MAX_GAP)
            last, shut = self._gaps[k], gap < 0.05 * MAX_GAP
            if last is None or abs(gap - last) > 0.02 * MAX_GAP or shut != (last < 0.05 * MAX_GAP):
                self._gaps[k] = gap
                context.hands[side].close(FORCE) if shut else context.hands[side].open(gap)
        vx, vy, wz = (BASE * action[14:17]).tolist()
        heights = context.legs.status.heights if context.legs.reporting else None
        height = None if heights is None else float(np.clip(heights[1] + DROP * action[17], heights[0], heights[2]))
        context.legs.drive(Twist(vx, vy, wz, height))


def register() -> None:
    """Make the environments known to gymnasium; `gymnasium.make` does so by itself where GOLEM is installed."""
    for rung in RUNGS:
        if f"golem/{rung}-v0" not in gym.registry:
            gym.register(f"golem/{rung}-v0", "golem.datasets.gym_env:GolemEnv", kwargs={"rung": rung})


register()
