"""The vendor's own low-level example for the H1-2, unchanged, against `golem twin`; see `conftest.py` for its needs."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from tests.robots.unitree.conftest import Started
from tests.robots.unitree.test_sdk_example import EXAMPLE, PERIOD

from golem.middleware.dds.base import Qos
from golem.middleware.wire import convert, hg
from golem.types import Array, LowCommand, LowState

pytestmark = [pytest.mark.slow, pytest.mark.timeout(240)]
SWINGING = 2.5
"""How long to watch the example's second stage, in which ankles and wrists swing once a second [s]."""
DEADLINE = 120.0
ANKLES, WRISTS = (4, 5, 10, 11), (17, 24)
"""Motors that swing: left pitch and roll, right pitch and roll; left and right roll."""


Moment = tuple[LowState, LowCommand]


def watch(domain: int, twin: subprocess.Popen[str], example: subprocess.Popen[str]) -> list[Moment]:
    """Return every state of the twin with the command that was valid then, until the ankles have swung."""
    from golem.middleware.dds.connect import connect
    from golem.middleware.dds.domain import DdsConfig

    participant, whole = connect(DdsConfig(domain)), Qos(depth=1000)
    states = participant.reader("rt/lowstate", hg.LOW_STATE.type_name, whole)
    commands = participant.reader("rt/lowcmd", hg.LOW_CMD.type_name, whole)
    seen: list[Moment] = []
    command: LowCommand | None = None
    swinging_since: float | None = None
    deadline = time.monotonic() + DEADLINE
    try:
        while time.monotonic() < deadline:
            assert twin.poll() is None and example.poll() is None
            for sample in commands.take():
                command = convert.decode_low_command(sample.payload, 0.0) if sample.alive else command
            for sample in states.take():
                if sample.alive and command is not None:
                    seen.append((convert.decode_low_state(sample.payload), command))
            if seen and seen[-1][1].kp[4] == 80.0:  # what only the second stage asks of an ankle
                swinging_since = swinging_since or seen[-1][0].t
                if seen[-1][0].t > swinging_since + SWINGING:
                    return seen
            time.sleep(0.005)
    finally:
        participant.close()
    raise AssertionError(f"The example did not get to its second stage within {DEADLINE:g} s.")


def test_the_twin_does_what_the_vendors_example_says(sdk: Started, domain: int) -> None:
    golem = Path(sys.executable).with_name("golem")
    twin = subprocess.Popen(
        [str(golem), "twin", "--domain", str(domain), "--profile", "ideal", "--world", "open"],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    try:
        assert twin.stdout is not None
        said = twin.stdout.readline()
        assert f"domain {domain}" in said, said + twin.stdout.read()
        seen = watch(domain, twin, sdk("sdk_example.py", str(domain), EXAMPLE))
    finally:
        twin.terminate()
        twin.wait(20.0)
    first = [(state, command) for state, command in seen if command.kp[4] == 100.0]
    second = [(state, command) for state, command in seen if command.kp[4] == 80.0]
    start = first[0][0].q
    bent = np.abs(start) > 0.1
    assert bent.sum() >= 8  # so that joints and signs can be told apart
    share = first[len(first) // 10][1].q / np.where(bent, first[len(first) // 10][0].q, 1.0)
    np.testing.assert_allclose(share[bent], np.median(share[bent]), atol=0.1)
    # It moved to the zero posture, as far as such gains carry its weight.
    end = first[-1][0].q
    assert np.abs(end).max() < 0.25 and np.abs(end[bent]).sum() < 0.5 * np.abs(start[bent]).sum(), end
    wanted = np.array([command.q for _, command in second])
    measured = np.array([state.q for state, _ in second])
    for motor in (*ANKLES, *WRISTS):
        assert follows(measured[:, motor], wanted[:, motor]), motor
    assert not follows(measured[:, 3], wanted[:, 4])  # a knee does not


def follows(measured: Array, wanted: Array) -> bool:
    """Return whether an angle swings like another, at most an eighth of a period later."""
    maximum = max(
        float(np.corrcoef(measured[lag:], wanted[: len(wanted) - lag])[0, 1])
        for lag in range(0, int(0.125 / PERIOD), 5)
    )
    return maximum > 0.9 and float(np.ptp(measured)) > 0.5 * float(np.ptp(wanted))
