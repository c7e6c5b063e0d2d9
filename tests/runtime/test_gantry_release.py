"""A stack on the ground lets the band go by itself, when all is ready and not before."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from golem.errors import ModuleFault
from golem.robots.base import HasGantry
from golem.runtime.lockstep import LockstepRunner, build, start_posture
from golem.runtime.standing_legs import READY
from golem.stack import Choice, Stack

CROUCH = Choice("hold", {"stance": "crouch", "standing": True})
STANDING = Stack(
    {"robot": Choice("mujoco", {"support": "ground", "world": "open"}), "lower_body": CROUCH, "fallback": CROUCH},
    profile="ideal",
)


@pytest.fixture
def stack() -> Iterator[tuple[LockstepRunner, HasGantry]]:
    """A running stack whose legs only hold the crouch, and its robot."""
    running, robot = build(STANDING, seed=0)
    yield running, robot
    robot.close()


def released_at(running: LockstepRunner, robot: HasGantry, until: float) -> float | None:
    while running.executor.t < until:
        running.executor.step()
        if not robot.on_gantry:
            return running.executor.t
    return None


def test_it_is_released_when_gate_servo_and_legs_are_ready(stack: tuple[LockstepRunner, HasGantry]) -> None:
    running, robot = stack
    at = released_at(running, robot, 3.0)
    assert at is not None and READY < at < READY + 0.1


def test_nothing_moves_until_then(stack: tuple[LockstepRunner, HasGantry]) -> None:
    running, robot = stack
    assert released_at(running, robot, READY - 0.05) is None
    base = robot.truth.base()  # pyright: ignore[reportAttributeAccessIssue]
    assert base.tilt < 0.02
    assert base.T_world_base[2, 3] == pytest.approx(0.965, abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("profile", ["ideal", "field"])
def test_a_robot_that_can_balance_stands_from_the_first_second(profile: str) -> None:
    stack = STANDING.with_choice("lower_body", "wbc").with_choice("fallback", "wbc")
    running, robot = build(replace(stack, profile=profile), seed=1)
    start = robot.truth.base().T_world_base[:3, 3]
    while running.executor.t < 6.0:
        running.executor.step()
        base = robot.truth.base()
        assert base.tilt < 0.03
        assert np.linalg.norm(base.T_world_base[:3, 3] - start) < 0.04
    assert not robot.on_gantry
    assert not robot.data.xfrc_applied.any()
    robot.close()


def test_a_pressed_button_keeps_the_band(stack: tuple[LockstepRunner, HasGantry]) -> None:
    running, robot = stack
    running.executor.run(0.5)
    running.estop.press()
    assert released_at(running, robot, READY + 1.0) is None


def test_a_robot_that_hangs_is_never_released() -> None:
    running, robot = build(Stack(profile="ideal"), seed=0)
    running.executor.run(READY + 0.5)
    assert robot.truth.base().T_world_base[2, 3] == pytest.approx(1.10, abs=0.01)
    robot.close()


def test_each_support_has_its_posture() -> None:
    # Knees: slightly bent where the legs hang, a crouch where they carry.
    assert start_posture()[3] == pytest.approx(0.36)
    assert start_posture(on_ground=True)[3] == pytest.approx(0.8)


BLIND = """
from dataclasses import replace
from golem.hardware.estimator.random_walk_kf import RandomWalkKF

class Blind(RandomWalkKF):
    def step(self, *args):
        return replace(super().step(*args), stale=True)
"""


def test_an_estimator_that_finds_no_floor_is_named(tmp_path: Path) -> None:
    (tmp_path / "blind.py").write_text(BLIND)
    running, robot = build(STANDING.with_choice("estimator", f"{tmp_path / 'blind.py'}:Blind"), seed=0)
    assert released_at(running, robot, READY + 1.0) is not None
    with pytest.raises(ModuleFault, match="Module estimator: .*Blind failed: it found no foot"):
        running.executor.run(READY + 1.0)
    robot.close()
