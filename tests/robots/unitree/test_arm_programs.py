"""Unitree's arm example and xr_teleoperate's arm class, unchanged, on twins; see `conftest.py` for their needs."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from tests.robots.unitree.conftest import Started
from tests.runtime.live.test_processes import Launched, active

from golem.middleware.dds.base import Qos
from golem.middleware.wire import convert, hg
from golem.types import ARMS, LEGS, Array

pytestmark = [pytest.mark.slow, pytest.mark.alone, pytest.mark.timeout(900)]
EXAMPLE = "hg/arm_sdk.py"
"""In a checkout of unitree_sdk2_python up to 2024: `git checkout bddc17a -- example/hg/arm_sdk.py`."""


@pytest.fixture
def standing(tmp_path: Path, domain: int) -> Iterator[Launched]:
    pytest.importorskip("cyclonedds")
    stack = tmp_path / "stack.yaml"
    stack.write_text("robot: {use: mujoco, world: open, support: ground}\nlower_body: {use: almi}\nprofile: ideal\n")
    with active(stack, domain) as launched:
        yield launched


def watched(domain: int, program: subprocess.Popen[str], after: float = 4.0) -> tuple[Array, Array]:
    """Return (n, 27) states of the robot until `after` [s] past the program's end, and the commands past that end."""
    from golem.middleware.dds.connect import connect
    from golem.middleware.dds.domain import DdsConfig

    participant = connect(DdsConfig(domain))
    readers = [
        participant.reader(f"rt/{name}", layout.type_name, Qos(depth=2000))
        for name, layout in (("lowstate", hg.LOW_STATE), ("lowcmd", hg.LOW_CMD))
    ]
    states: list[Array] = []
    commands: list[Array] = []
    ended, t, deadline = None, 0.0, time.monotonic() + 400.0
    try:
        while time.monotonic() < deadline and (ended is None or t < ended + after):
            for sample in readers[0].take():
                if sample.alive:
                    state = convert.decode_low_state(sample.payload)
                    states.append(state.q)
                    t = state.t
            commands += [convert.decode_low_command(s.payload, 0.0).q for s in readers[1].take() if s.alive]
            if ended is None and program.poll() is not None:
                ended = t
                commands.clear()
            time.sleep(0.01)
    finally:
        participant.close()
    return np.array(states), np.array(commands)


def test_unitrees_arm_example_moves_the_arms_of_a_robot_that_stands(
    sdk: Started, standing: Launched, domain: int
) -> None:
    if not (Path(os.environ["GOLEM_UNITREE_SDK"]) / "example" / EXAMPLE).exists():
        pytest.skip(f"the checkout of the SDK has no example/{EXAMPLE}")
    program = sdk("sdk_example.py", str(domain), EXAMPLE)
    states, commands = watched(domain, program)
    assert program.stdout is not None and "Done!" in program.stdout.read()
    home = states[0]
    assert np.ptp(states[:, ARMS.start + 1]) > 0.5, "the shoulder did not lift"  # its target is 90 degrees
    assert np.abs(np.diff(commands[:, ARMS], axis=0)).max() < 0.02
    assert np.abs(states[-1][ARMS] - home[ARMS]).max() < 0.15, "the arms did not come back"
    assert np.abs(states[-1][LEGS] - home[LEGS]).max() < 0.3 and standing.process.poll() is None
    assert "active" in standing.golem("safety", "status").stdout


def test_the_arm_class_of_xr_teleoperate_moves_the_arms(sdk: Started, domain: int, tmp_path: Path) -> None:
    if not os.environ.get("GOLEM_XR_TELEOPERATE"):
        pytest.skip("GOLEM_XR_TELEOPERATE does not name a checkout of xr_teleoperate")
    source = (Path(os.environ["GOLEM_XR_TELEOPERATE"]) / "teleop/robot_control/robot_arm.py").read_text()
    motion = "motion_mode" in source.partition("class H1_2_ArmController")[2].partition("class H1_ArmController")[0]
    words = ["launch", "stand"] if motion else ["twin"]
    golem = [sys.executable, "-m", "golem", *words, "--domain", str(domain), "--profile", "ideal"]
    with subprocess.Popen(golem, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as robot:
        try:
            assert robot.stdout is not None
            for line in robot.stdout:
                if f"domain {domain}" in line if not motion else "Safety gate: active" in line:
                    break
            program = sdk("xr_arm.py", str(domain))
            said = program.communicate(timeout=300)[0]
        finally:
            robot.send_signal(signal.SIGINT)
    moved = [float(word) for word in said.rpartition("moved")[2].split()[:2]]
    assert len(moved) == 2 and all(-0.45 < angle < -0.15 for angle in moved), said
