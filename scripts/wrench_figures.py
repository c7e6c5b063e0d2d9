"""Measures what the hands feel: `python scripts/wrench_figures.py [SEEDS] [WALK_SECONDS]`, a twin pushed at its palms.

Each seed is another robot: friction, encoder zeros and gains of its motors are drawn. It stands in five postures near
`home`, `ready` and `forward`, and is pushed in directions drawn at random for 0.8 s by 2 to 15 N. Prints the RMS error
of the force [N], by its size how many pushes are found within 30, 100 and 300 ms, and how many events come while
nothing touches the hands: in the quiet before each push, and in walking.
"""

from __future__ import annotations

import sys

import numpy as np

from golem.capabilities.arms.arm_kinematics import UpperKinematics
from golem.capabilities.arms.base import ARM_COLUMNS
from golem.capabilities.arms.hand_force import ContactSense, HandForce
from golem.capabilities.arms.postures import POSTURES
from golem.interfaces import topics
from golem.robots.model import magpie_model
from golem.runtime.lockstep import LockstepRunner, build
from golem.skills.base import SkillResult
from golem.skills.context import Context
from golem.skills.walk import WalkGoal
from golem.stack import load_stack
from golem.types import SIDES, UPPER, Array

LENGTH, REST = 0.8, 3.0
"""Time of a push, and after it [s]: what friction keeps of it has to become what was there before."""
SIZES = ((2.0, 3.5), (3.5, 6.0), (6.0, 9.0), (9.0, 12.0), (12.0, 15.0))


class Pose:
    """Brings the arms to joints (15,), in 2 s."""

    Goal = object

    def __init__(self, q: Array) -> None:
        """Go to `q` [rad]."""
        self._q = q

    def timeout(self, goal: object) -> float:
        """Return the time it may take [s]."""
        return 20.0

    async def run(self, context: Context, goal: object) -> SkillResult:
        """Go there."""
        start, k = context.commanded_joints.copy(), np.linspace(0.0, 1.0, 50)[:, None]
        await context.follow(np.linspace(0.0, 1.96, 50), start + (3.0 * k**2 - 2.0 * k**3) * (self._q - start))
        return SkillResult(True, "done", None, "", {})


class Felt:
    """Looks at both hands after every tick."""

    def __init__(self, seed: int) -> None:
        """Build the robot of a seed."""
        self.running: LockstepRunner
        stack = load_stack("stand", profile="bench").with_options("robot", world="open")
        self.running, self.robot = build(stack, seed)
        self._force, self.senses = HandForce(), [ContactSense(side) for side in SIDES]
        self._bodies = [self.robot.data.body(magpie_model.hand_name(side)).id for side in SIDES]
        self.pushed: Array = np.zeros((2, 3))
        self.began: list[tuple[float, int]] = []
        self.forces: list[Array] = []
        self._t = -1.0

    def tick(self) -> None:
        """Push, and feel."""
        self.robot.data.xfrc_applied[self._bodies, :3] = self.pushed
        state, base = self.running.bus.latest(topics.LOW_STATE), self.running.bus.latest(topics.BASE)
        if state is None or base is None or state.t == self._t:
            return
        self._t = state.t
        for k, sense in enumerate(self.senses):
            if sense.step(state) and sense.touching:
                self.began.append((self.running.executor.t, k))
        q, tau = state.q[UPPER], state.tau[UPPER]
        self.forces.append(np.array([base.T_odom_base[:3, :3] @ self._force(side, q, tau) for side in SIDES]))

    def run(self, seconds: float) -> Array:
        """Let time pass; return the (n, 2, 3) forces of the hands, in odom [N]."""
        self.forces.clear()
        self.running.executor.run(self.running.executor.t + seconds, lambda: self.tick() is not None)
        return np.array(self.forces)


def stand(seed: int, errors: list[Array], found: list[tuple[float, float]]) -> tuple[float, int]:
    """Push 20 times at both hands; return the quiet time [s], and the events in it."""
    felt, rng, arm = Felt(seed), np.random.default_rng(seed), UpperKinematics()
    felt.run(REST)
    quiet, events = 0.0, 0
    for k in range(20):
        if k % 4 == 0:
            q = POSTURES[("ready", "home", "forward")[k // 4 % 3]].copy()
            for columns in ARM_COLUMNS.values():
                q[columns] += rng.uniform(-0.25, 0.25, 7)
            felt.running.execute(Pose(np.clip(q, arm.lower + 0.05, arm.upper - 0.05)), None, watch=felt.tick)
            felt.run(REST)
        felt.began.clear()
        before = felt.run(0.5)[-100:].mean(axis=0)
        quiet, events = quiet + 1.0, events + len(felt.began)
        felt.began.clear()
        way = rng.normal(size=(2, 3))
        size = 3.0 if k % 2 == 0 else rng.uniform(2.0, 15.0)
        start, felt.pushed[:] = felt.running.executor.t, size * way / np.linalg.norm(way, axis=1, keepdims=True)
        free = [not sense.touching for sense in felt.senses]
        late = felt.run(LENGTH)[250:]
        means = late[: len(late) // 25 * 25].reshape(-1, 25, 2, 3).mean(axis=1)  # of 50 ms, as /wrench is
        errors.append((-(means - before) - felt.pushed).reshape(-1, 3))
        for hand in np.flatnonzero(free):
            found.append((size, min((t for t, h in felt.began if h == hand), default=np.inf) - start))
        felt.pushed[:] = 0.0
        felt.run(REST)
    felt.robot.close()
    return quiet, events


def walk(seed: int, seconds: float) -> None:
    """Walk about, and print how many events there are."""
    felt, rng = Felt(seed), np.random.default_rng(seed)
    felt.run(REST)
    felt.began.clear()
    start = felt.running.executor.t
    while felt.running.executor.t - start < seconds:
        goal = WalkGoal(rng.uniform(-2.0, 2.0), rng.uniform(-1.0, 1.0), rng.uniform(-2.0, 2.0), timeout=40.0)
        felt.running.execute("walk", goal, watch=felt.tick)
    length = felt.running.executor.t - start
    print(f"walking {length:.0f} s, both hands, nothing touched: {len(felt.began)} events", flush=True)
    felt.robot.close()


def main(seeds: int, seconds: float) -> None:
    """Measure, and print."""
    errors, found = list[Array](), list[tuple[float, float]]()
    quiet = np.array([stand(seed, errors, found) for seed in range(100, 100 + seeds)])
    by_push = np.array([np.sqrt((e**2).sum(axis=1).mean()) for e in errors])
    rms = np.sqrt((by_push**2).mean())
    rng = np.random.default_rng(0)
    again = [np.sqrt((rng.choice(by_push, len(by_push)) ** 2).mean()) for _ in range(2000)]
    low, high = np.percentile(again, [2.5, 97.5])
    print(f"known pushes, n = {2 * len(errors)}: RMS error of the force {rms:.2f} N, 95 % [{low:.2f}, {high:.2f}]")
    for least, most in SIZES:
        delays = np.array([delay for size, delay in found if least <= size < most])
        shares = ", ".join(f"{(delays <= late).sum()} within {1e3 * late:.0f} ms" for late in (0.03, 0.1, 0.3))
        print(f"{least:g} to {most:g} N: of {len(delays)} found {shares}")
    print(f"standing {quiet[:, 0].sum():.0f} s, one hand, nothing touched: {quiet[:, 1].sum():.0f} events", flush=True)
    if seconds:
        walk(100, seconds)


if __name__ == "__main__":
    main(int((sys.argv[1:2] or ["3"])[0]), float((sys.argv[2:3] or ["60"])[0]))
