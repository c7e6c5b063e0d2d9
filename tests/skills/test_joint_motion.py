"""A trajectory of joints waits for the safety gate, but not for ever."""

from __future__ import annotations

from typing import Any

import numpy as np

from golem.capabilities.arms.postures import POSTURES
from golem.interfaces import topics
from golem.skills.base import SkillResult
from golem.skills.body_interface import GATE_TIMEOUT
from golem.skills.context import Context
from golem.types import NUM_JOINTS, UPPER, Imu, LowState

HOME = POSTURES["home"]


async def _wave(context: Context) -> SkillResult:
    await context.follow(np.array([1.0]), HOME[None])
    return SkillResult(True, "done", None, "Waved.")


def test_a_gate_that_stays_shut_fails_the_skill_by_name(world: Any) -> None:
    q, zero = np.zeros(NUM_JOINTS), np.zeros(NUM_JOINTS)
    q[UPPER] = HOME
    still = Imu(np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), np.array([0.0, 0.0, 9.81]))
    world.bus.publish(topics.LOW_STATE, LowState(0.0, q, zero, zero, still), 0.0)
    run = world.run(_wave(world.context))
    assert run.result == SkillResult(False, "move", "safety", "The safety gate lets no commands through.")
    assert GATE_TIMEOUT <= world.t < GATE_TIMEOUT + 0.1
    assert world.bus.latest(topics.ARM_TRAJECTORY) is None
