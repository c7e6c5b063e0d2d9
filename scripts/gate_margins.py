"""How near ordinary work comes to the gate's plausibility limits: `python scripts/gate_margins.py`.

A second judge of the senses looks on, with the gate's own code and a memory of its own, while robots pick, stand, walk
and are shoved. What it prints is the table of docs/decisions/control.md.
"""

from __future__ import annotations

import math
from contextlib import closing
from dataclasses import dataclass

import numpy as np
import tyro

from golem.evaluation.episodes.episode import READY
from golem.hardware.safety.base import SafetyLimits
from golem.hardware.safety.senses import GRAVITY_TIME, SensesMemory, sense
from golem.interfaces import topics
from golem.interfaces.payloads import GateState
from golem.robots.mujoco.engine import MujocoRobot
from golem.runtime.lockstep import LockstepRunner, build
from golem.skills.pick_config import PickGoal
from golem.skills.walk import WalkGoal
from golem.stack import load_stack
from golem.types import GRAVITY, TICK, LowCommand, LowState

SHOVE = 0.2
"""How long a shove lasts [s]."""
EVERY = 4.0
"""Time between two shoves of a robot that walks [s]."""


@dataclass(frozen=True)
class MarginsConfig:
    """Measure how near ordinary work comes to the gate's plausibility limits."""

    trials: int = 3
    """Episodes of each kind: picks of a hanging robot, walks of 2 m with shoves."""
    seed: int = 0
    """Seed of the first."""
    profile: str = "field"
    """Realism profile."""
    shove: float = 40.0
    """Momentum of the shoves [N s]."""


class MarginWatch:
    """Judges a running robot's senses a second time, and keeps the extremes.

    Attributes:
        most: the most of each quantity so far, by name.
    """

    def __init__(self, running: LockstepRunner) -> None:
        """Look at the bus of `running`."""
        self._bus, self._limits = running.bus, SafetyLimits.from_profile(running.stack.limits)
        self._memory, self._sent = SensesMemory(), None
        self._last: LowState | None = None
        self.most: dict[str, float] = dict.fromkeys(ROWS, 0.0)

    def __call__(self) -> None:
        """Look at the newest tick."""
        state, status = self._bus.latest(topics.LOW_STATE), self._bus.latest(topics.SAFETY)
        if state is None or state is self._last:
            return
        before, last, self._last = self._memory, self._last, state
        if last is not None and state.t - last.t < 1.5 * TICK:
            self._add("jump of a joint in a tick [rad]", float(np.abs(state.q - last.q).max()))
        self._memory, _, _ = sense(state, state.t, before, self._limits, self._sent)
        active = status is not None and status.state is GateState.ACTIVE
        self._sent: LowCommand | None = self._bus.latest(topics.LOW_CMD) if active else None
        now = self._memory
        if now.looked is not state or before.looked is None:
            return
        speed = np.abs(state.dq + before.looked.dq)
        self._add("drift of a joint [rad]", float((np.abs(now.drift) - self._limits.drift_lag * speed).max()))
        self._add("orientation against rate [rad]", math.hypot(*now.turn))
        self._add("torque missing [ms]", 1e3 * float(now.dead.max()))
        self._add("numbers repeated [ms]", 1e3 * (now.tick - min(now.since)))
        if now.force is not None:
            size = math.hypot(*now.force)
            self._add("mean specific force below gravity [m/s^2]", GRAVITY - size)
            self._add("mean specific force above gravity [m/s^2]", size - GRAVITY)
        if now.force is not None and now.tick - now.restless >= GRAVITY_TIME:
            self._add("gravity off the orientation's up at rest [rad]", _gravity(state, now.force))

    def _add(self, name: str, value: float) -> None:
        self.most[name] = max(self.most[name], value)


_L = SafetyLimits.from_profile()
ROWS: dict[str, float] = {
    "drift of a joint [rad]": _L.drift,
    "orientation against rate [rad]": _L.imu_drift,
    "jump of a joint in a tick [rad]": _L.jump,
    "gravity off the orientation's up at rest [rad]": _L.gravity_angle,
    "mean specific force below gravity [m/s^2]": GRAVITY - _L.gravity_moving[0],
    "mean specific force above gravity [m/s^2]": _L.gravity_moving[1] - GRAVITY,
    "torque missing [ms]": 1e3 * _L.dead_time,
    "numbers repeated [ms]": 1e3 * _L.frozen,
}
"""What is looked at, and where the gate stops."""


def _gravity(state: LowState, force: tuple[float, float, float]) -> float:
    """Return the angle between the mean specific force and the orientation's up [rad]."""
    w, x, y, z = state.imu.quat.tolist()
    up = np.array([2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)])
    return math.acos(max(-1.0, min(1.0, float(up @ force) / math.hypot(*force))))


def picked(profile: str, seed: int) -> tuple[dict[str, float], float, str]:
    """Return the extremes of one pick in the hoist, its robot time [s], and why the gate stopped if it did."""
    running, robot = build(load_stack("tether", profile=profile), seed)
    with closing(robot):
        watch = MarginWatch(running)
        running.execute("pick", PickGoal(), watch=watch)
        return watch.most, running.executor.t, _stop(running)


def walked(profile: str, seed: int, momentum: float) -> tuple[dict[str, float], float, str]:
    """Return the same of a walk of 2 m that is shoved from changing sides with `momentum` [N s]."""
    stack = load_stack("stand", profile=profile).with_options("robot", world="open")
    running, robot = build(stack, seed)
    with closing(robot):
        running.executor.run(READY, lambda: not robot.on_gantry)
        watch, begin = MarginWatch(running), running.executor.t

        def look() -> None:
            watch()
            _shove(robot, running.executor.t - begin, momentum, seed)

        running.execute("walk", WalkGoal(2.0), watch=look)
        return watch.most, running.executor.t, _stop(running)


def _shove(robot: MujocoRobot, t: float, momentum: float, seed: int) -> None:
    turn, phase = divmod(t, EVERY)
    angle = 2.4 * (turn + seed)
    acting = turn >= 1 and phase < SHOVE
    force = momentum / SHOVE * np.array([math.cos(angle), math.sin(angle), 0.0]) if acting else np.zeros(3)
    robot.push(force)


def _stop(running: LockstepRunner) -> str:
    status = running.safety
    return status.why if status is not None and status.stopped else ""


def main() -> None:
    """Measure, and print the table."""
    config = tyro.cli(MarginsConfig)
    seeds = range(config.seed, config.seed + config.trials)
    runs = [picked(config.profile, seed) for seed in seeds]
    runs += [walked(config.profile, seed, config.shove) for seed in seeds]
    print("| what | most | stops at |\n|---|---|---|")
    for name, limit in ROWS.items():
        print(f"| {name} | {max(most[name] for most, _, _ in runs):.3g} | {limit:.3g} |")
    stops = [why for _, _, why in runs if why]
    print(
        f"{config.trials} picks and {config.trials} walks, seed {config.seed}, profile {config.profile}: "
        f"{sum(t for _, t, _ in runs):.0f} s of robot time, {len(stops)} stops{': ' if stops else ''}{'; '.join(stops)}"
    )


if __name__ == "__main__":
    main()
