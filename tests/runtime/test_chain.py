"""The compiled chain against the nodes that it stands for: whole stacks, bit by bit, and plain Python in its middle."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from golem.hardware.estimator.random_walk_kf import RandomWalkKF
from golem.hardware.safety.base import OperatorRequest
from golem.interfaces import topics
from golem.interfaces.payloads import GateState
from golem.runtime import lockstep
from golem.stack import load_stack
from golem.types import Array, BaseEstimate, LowState

NEVER: Callable[[], float] = lambda: math.inf  # noqa: E731


def run(monkeypatch: Any, chained: bool, stack: str, seconds: float, act: Any = None, **robot: Any) -> Array:
    """Return what state, command and simulation are at the end of a run, with and without the chain."""
    with monkeypatch.context() as patch:
        if not chained:
            patch.setattr(lockstep, "chain_of", lambda bus, nodes: None)
        running, twin = lockstep.build(load_stack(stack, profile="field").with_options("robot", **robot), 3)
    due = NEVER if chained else None
    running.executor.run(0.6 * seconds, due=due)
    if act is not None:
        act(running, twin)
    running.executor.run(seconds, due=due)
    bus = running.bus
    state, command = bus.latest(topics.LOW_STATE), bus.latest(topics.LOW_CMD)
    base, safety = bus.latest(topics.BASE), bus.latest(topics.SAFETY)
    assert state is not None and command is not None and base is not None and safety is not None
    numbers = (
        *(twin.data.qpos, twin.data.qvel, state.q, state.dq, state.tau, state.imu.quat, state.imu.gyro),
        *(command.q, command.dq, command.tau, command.kp, command.kd, base.T_odom_base.ravel(), base.contact),
        [state.t, command.t, base.t, safety.t, twin.data.time, base.height, float(base.stale)],
        [float(bus.count(topics.LOW_STATE)), float(bus.count(topics.LOW_CMD))],
        [float(list(GateState).index(safety.state))],
    )
    twin.close()
    return np.concatenate(numbers)


def push(running: Any, twin: Any) -> None:
    twin.push(np.array([40.0, 25.0, 0.0]), point=np.array([0.1, 0.0, 0.2]))


def stop(running: Any, twin: Any) -> None:
    running.request(OperatorRequest.STOP)


def press(running: Any, twin: Any) -> None:
    running.estop.press()


@pytest.mark.parametrize(
    ("stack", "act", "robot"),
    [
        ("stand", None, {"world": "open"}),
        ("stand", push, {"world": "open"}),
        ("stand", stop, {"world": "open"}),
        ("tether", press, {}),
        ("fridge-tether", None, {}),
    ],
)
def test_a_stack_does_the_same_to_the_bit(monkeypatch: Any, stack: str, act: Any, robot: dict[str, Any]) -> None:
    chained, plain = (run(monkeypatch, c, stack, 3.0, act, **robot) for c in (True, False))
    np.testing.assert_array_equal(chained, plain)


class Mine:
    """An estimator in plain Python, with the shipped one inside."""

    def __init__(self) -> None:
        self._inner = RandomWalkKF()
        self.steps = 0

    def reset(self, state: LowState) -> None:
        self._inner.reset(state)

    def step(self, state: LowState, dt: float) -> BaseEstimate:
        self.steps += 1
        return self._inner.step(state, dt)


def test_a_plain_estimator_cuts_the_chain_and_changes_nothing(monkeypatch: Any) -> None:
    from golem.runtime import node_groups

    made: list[Mine] = []
    make = node_groups.registry.create

    def create(slot: str, *args: Any, **options: Any) -> Any:
        if slot != "estimator":
            return make(slot, *args, **options)
        made.append(Mine())
        return made[-1]

    expected = run(monkeypatch, True, "stand", 2.0, None, world="open")
    monkeypatch.setattr(node_groups.registry, "create", create)
    found = run(monkeypatch, True, "stand", 2.0, None, world="open")
    assert made[0].steps == 1000
    np.testing.assert_array_equal(found, expected)


class Other(RandomWalkKF):
    """A subclass with a step of its own."""

    def step(self, state: LowState, dt: float) -> BaseEstimate:
        return super().step(state, dt)


def test_a_subclass_with_a_step_of_its_own_has_no_stage() -> None:
    assert RandomWalkKF().native() is not None
    assert Other().native() is None
