"""The vendor's own low-level example for the H1-2, unchanged, against the wire; see `conftest.py` for what it needs."""

from __future__ import annotations

import time

import numpy as np
import pytest
from tests.middleware.wire.rpc import serve
from tests.robots.unitree.conftest import Started

from golem.middleware.dds.base import Qos
from golem.middleware.wire import convert, hg
from golem.robots.unitree import loco_service
from golem.robots.unitree.loco_service import CHECK_MODE, RELEASE_MODE, MotionSwitcher
from golem.types import NUM_JOINTS, Array, Imu, LowCommand, LowState

EXAMPLE = "h1_2/low_level/h1_2_low_level_example.py"
MACHINE = 6
WANTED = 300
"""Commands to look at."""
DEADLINE = 40.0
DURATION, PERIOD = 3.0, 0.002
"""Time over which the example moves to zero, and its period [s]; both as its source says."""

Q: Array = np.cos(np.pi * np.arange(NUM_JOINTS)) * np.linspace(0.1, 0.9, NUM_JOINTS)
"""A posture that tells every joint and its sign apart [rad]."""


class Twin:
    """A robot that stands still and listens.

    Attributes:
        payloads: every command that came.
        calls: the functions of the motion switcher that were called.
    """

    def __init__(self, domain: int) -> None:
        from golem.middleware.dds.connect import connect
        from golem.middleware.dds.domain import DdsConfig

        self.payloads: list[bytes] = []
        self.calls: list[int] = []
        self._participant = connect(DdsConfig(domain))
        low = Qos(depth=8)
        self._states = self._participant.writer("rt/lowstate", hg.LOW_STATE.type_name, low)
        self._commands = self._participant.reader("rt/lowcmd", hg.LOW_CMD.type_name, low)
        self._server = serve(self._participant, loco_service.SERVICE)
        self._switcher = MotionSwitcher()
        self._imu = Imu(np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), np.array([0.0, 0.0, 9.81]))

    def step(self, t: float) -> None:
        zero = np.zeros(NUM_JOINTS)
        self._states.write(convert.encode_low_state(LowState(t, Q, zero, zero, self._imu), MACHINE))
        for request in self._server.take():
            self.calls.append(request.api_id)
            self._server.reply(self._switcher.answer(request, t))
        self.payloads += [bytes(sample.payload) for sample in self._commands.take() if sample.alive]

    def close(self) -> None:
        self._participant.close()


@pytest.mark.slow
def test_the_vendors_example_reads_and_commands_this_robot(sdk: Started, domain: int) -> None:
    twin = Twin(domain)
    process = sdk("sdk_example.py", str(domain), EXAMPLE)
    try:
        start = time.monotonic()
        while len(twin.payloads) < WANTED and time.monotonic() - start < DEADLINE:
            assert process.poll() is None, process.communicate()[0]
            twin.step(time.monotonic() - start)
            time.sleep(PERIOD)
    finally:
        twin.close()
    process.kill()
    said = process.communicate()[0]
    assert twin.calls == [CHECK_MODE, RELEASE_MODE, CHECK_MODE], said
    assert len(twin.payloads) >= WANTED, said
    commands = [convert.decode_low_command(payload, 0.0, MACHINE) for payload in twin.payloads]
    ratios = [_check(command) for command in commands]
    # Each command moves the posture it read towards zero, by one period; a busy machine may miss a few.
    periods = -np.diff(ratios) * DURATION / PERIOD
    np.testing.assert_allclose(periods, np.round(periods), atol=1e-3)
    assert periods.min() > 0.5 and np.median(np.round(periods)) == 1.0
    assert "[0.0, 0.0, 0.0]" in said  # roll, pitch and yaw, which it prints every 500 states


def _check(command: LowCommand) -> float:
    """Check one command of the example's first stage; return the share of the posture it read that it commands."""
    share = command.q / Q
    np.testing.assert_allclose(share, share[0], atol=1e-6)
    assert 0.0 < share[0] < 1.0
    assert not command.dq.any() and not command.tau.any()
    np.testing.assert_array_equal(command.kp, np.where(np.arange(NUM_JOINTS) < 13, 100.0, 50.0))
    np.testing.assert_array_equal(command.kd, np.ones(NUM_JOINTS))
    return float(share[0])
