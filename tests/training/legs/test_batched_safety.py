# ruff: noqa: E402 (nothing of the trainer can be imported where torch is absent)
"""The trainer's gate against the real one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("torch", reason="training needs the extra 'train'")

from golem.hardware.safety.base import Counters, Outgoing, SafetyLimits
from golem.hardware.safety.limiter import limit_command
from golem.hardware.safety.monitor import examine
from golem.training.legs.batch_world import LegGate
from golem.training.legs.training_model import KD, KP, STANCE, STEP
from golem.types import LEGS, NUM_JOINTS, Imu, LowCommand, LowState

LIMITS = replace(SafetyLimits.from_profile(), longest_tick=STEP)
ROBOTS = 16


def state(q: np.ndarray, dq: np.ndarray, tau: np.ndarray) -> LowState:
    full = np.zeros((3, NUM_JOINTS))
    full[:, LEGS] = q, dq, tau
    return LowState(0.0, full[0], full[1], full[2], Imu(np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), np.zeros(3)))


def test_what_it_lets_through_is_what_the_real_gate_does_from_a_state_as_old_as_the_command() -> None:
    rng, gate, none = np.random.default_rng(0), LegGate(ROBOTS), np.zeros((ROBOTS, 12))
    delay = np.arange(ROBOTS) % 5
    gains = np.zeros((2, NUM_JOINTS))
    gains[:, LEGS] = KP, KD
    sent = [Outgoing(np.concatenate([STANCE, np.zeros(15)]), *gains) for _ in range(ROBOTS)]
    history = [(np.tile(STANCE, (ROBOTS, 1)), none)] * 5
    pulled = braked = 0
    for _ in range(40):
        targets = STANCE + rng.normal(0.0, 0.3, (ROBOTS, 12))
        found = gate.limit(targets, delay)
        for i in range(ROBOTS):
            q, dq = (x[i] for x in history[-1 - delay[i]])
            q_cmd = np.concatenate([targets[i], np.zeros(15)])
            command = LowCommand(0.0, q_cmd, np.zeros(27), np.zeros(27), *gains)
            measured = state(q, dq, none[0])
            fast = examine(measured, LIMITS, Counters())[0].strained
            limited, sent[i] = limit_command(0.0, measured, command, LIMITS, sent[i], STEP, fast)
            # The trainer's motors take positions only: the braking torque is part of them.
            braked += bool(np.any(np.abs(limited.tau[LEGS]) > 1e-9))
            np.testing.assert_allclose(found[i], limited.q[LEGS] + limited.tau[LEGS] / KP, atol=1e-9)
            pulled += not np.allclose(limited.q[LEGS], targets[i])
        q, dq = STANCE + rng.normal(0.0, 0.2, (ROBOTS, 12)), rng.normal(0.0, 7.0, (ROBOTS, 12))
        gate.judge(q, dq, none)
        history.append((q, dq))
    assert pulled > 100 and braked > 50


@pytest.mark.parametrize("kind", ["speed", "braking", "torque"])
def test_it_stops_a_robot_when_the_real_gate_does(kind: str) -> None:
    gate, counters = LegGate(3), Counters()
    q, dq, tau = np.tile(STANCE, (3, 1)), np.zeros((3, 12)), np.zeros((3, 12))
    if kind == "speed":
        dq[1:, 3] = 1.1 * LIMITS.velocity[3]
    elif kind == "braking":
        q[1:, 4] = LIMITS.state_upper[4] - 0.01
        dq[1:, 4] = 3.0
    else:
        tau[1:, 0] = 1.02 * LIMITS.torque[0]
    samples = round(STEP / 0.002)
    for step in range(20):
        relaxed = step == 3
        stopped = gate.judge(q, dq * [[1], [1], [not relaxed]], tau * [[1], [1], [not relaxed]])
        for _ in range(samples):
            counters, fault = examine(state(q[1], dq[1], tau[1]), LIMITS, counters)
            if fault is not None:
                break
        assert stopped[1] == (fault is not None) and not stopped[0]
        if fault is not None:
            assert not stopped[2]  # it had a pause
            return
    pytest.fail("nobody stopped it")
