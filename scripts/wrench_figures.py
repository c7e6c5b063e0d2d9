"""Measures what the hands feel: `python scripts/wrench_figures.py [SECONDS]`, a twin that stands, pushed at its palms.

Prints the RMS error of the force of a known push [N], the delay from a push to its contact event [s], and how many
events come while nothing touches the hands in so many seconds of standing, and of walking.
"""

from __future__ import annotations

import sys

import numpy as np

from golem.capabilities.arms.hand_force import ContactSense, HandForce
from golem.interfaces import topics
from golem.robots.model import magpie_model
from golem.runtime.lockstep import LockstepRunner, build
from golem.skills.walk import WalkGoal
from golem.stack import load_stack
from golem.types import SIDES, UPPER, Array

EVERY = 0.01
"""Time between two looks at the force [s], as /wrench is sent."""
PUSHES = ((8.0, 0, 0), (-8.0, 0, 0), (0, 8.0, 0), (0, -8.0, 0), (0, 0, 8.0), (0, 0, -8.0))
"""In the world [N], each for 1 s."""


def felt(running: LockstepRunner, force: HandForce) -> Array:
    """Return the (2, 3) forces of the hands, in odom [N]."""
    state, base = running.bus.latest(topics.LOW_STATE), running.bus.latest(topics.BASE)
    assert state is not None and base is not None
    return np.array([base.T_odom_base[:3, :3] @ force(side, state.q[UPPER], state.tau[UPPER]) for side in SIDES])


def main(seconds: float) -> None:
    """Measure, and print."""
    running, robot = build(load_stack("stand", profile="bench").with_options("robot", world="open"), 0)
    force, senses = HandForce(), {side: ContactSense(side) for side in SIDES}
    events: list[tuple[float, str]] = []
    pushed: Array = np.zeros((2, 3))
    bodies = [robot.data.body(magpie_model.hand_name(side)).id for side in SIDES]

    def tick() -> None:
        t, state = running.executor.t, running.bus.latest(topics.LOW_STATE)
        robot.data.xfrc_applied[bodies, :3] = pushed
        for side, sense in senses.items():
            changed = state is not None and sense.step(t, state.q[UPPER], state.dq[UPPER], state.tau[UPPER])
            if changed and sense.touching:
                events.append((t, side))

    def run(length: float) -> list[Array]:
        rows: list[Array] = []
        for _ in range(round(length / EVERY)):
            running.executor.run(running.executor.t + EVERY, lambda: tick() is not None)
            rows.append(felt(running, force))
        return rows

    run(3.0)
    events.clear()
    quiet = run(seconds)
    print(f"standing {seconds:g} s, nothing touched: {len(events)} events")
    errors, delays = list[Array](), list[float]()
    for push in PUSHES:
        before = np.mean(quiet[-50:], axis=0)
        events.clear()
        start = running.executor.t
        pushed[:] = push
        rows = run(1.0)
        delays += [min((t for t, s in events if s == side), default=np.inf) - start for side in SIDES]
        means = np.array([np.mean(rows[k : k + 5], axis=0) for k in range(50, 95, 5)])  # of 50 ms, as /wrench is
        errors.append((-(means - before) - push).reshape(-1, 3))
        pushed[:] = 0.0
        quiet = run(1.5)
    rms = np.sqrt((np.concatenate(errors) ** 2).sum(axis=1).mean())
    print(f"known pushes of 8 N, n = {2 * len(PUSHES)}: RMS error of the force {rms:.2f} N")
    print(f"delay of the event after 8 N: median {1e3 * np.median(delays):.0f} ms, most {1e3 * np.max(delays):.0f} ms")
    delays.clear()
    for push in PUSHES:
        events.clear()
        start, pushed[:] = running.executor.t, np.array(push) * 3.0 / 8.0
        run(0.3)
        delays += [min((t for t, s in events if s == side), default=np.inf) - start for side in SIDES]
        pushed[:] = 0.0
        run(1.2)
    found = [d for d in delays if np.isfinite(d)]
    print(f"3 N: {len(found)} of {len(delays)} found, median {1e3 * np.median(found or [np.nan]):.0f} ms")
    events.clear()
    start = running.executor.t
    running.execute("walk", WalkGoal(3.0, timeout=60.0), watch=tick)
    print(f"walking {running.executor.t - start:.0f} s, nothing touched: {len(events)} events")
    robot.close()


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 10.0)
