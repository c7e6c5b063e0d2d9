"""The safety process with an e-stop that is a device: its faults are told as the device says them."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.runtime.live.conftest import Live

from golem.errors import ConfigError
from golem.hardware.estop.estop_config import VirtualEstop
from golem.interfaces.payloads import EstopMessage, GateState
from golem.middleware.dds.domain import DdsConfig
from golem.runtime.live.launch import LaunchConfig, commands
from golem.runtime.lockstep import LockstepRunner, build_robot
from golem.stack import parse_stack

UNPLUGGED = "The serial port '/dev/ttyACM0' is gone."


class Plugged:
    """An e-stop with a plug."""

    def __init__(self, plugged: bool = True) -> None:
        self.plugged = plugged
        self._frames = VirtualEstop()

    @property
    def fault(self) -> str:
        return "" if self.plugged else UNPLUGGED

    def step(self, t: float) -> EstopMessage | None:
        return self._frames.step(t) if self.plugged else None


@pytest.fixture
def estop(live: Live) -> Plugged:
    """The e-stop of a gate that has just started."""
    estop = Plugged(plugged=False)
    live.leave("safety")
    live.start_gate(estop=estop)
    return estop


def test_the_gate_says_what_the_board_says_is_wrong(live: Live, estop: Plugged) -> None:
    live.run(0.2)
    assert live.gate is not None
    assert (live.state, live.reason, live.gate.status.detail) == (GateState.INIT, "estop_never_seen", UNPLUGGED)
    estop.plugged = True
    live.activate()
    estop.plugged = False
    live.run(0.04)
    assert live.state is GateState.ACTIVE
    live.run(0.03)
    assert (live.state, live.reason, live.gate.status.detail) == (GateState.STOP1, "estop_stale", UNPLUGGED)


def test_a_board_is_pressed_by_hand_only(live: Live, estop: Plugged) -> None:
    estop.plugged = True
    live.activate()
    assert live.ask("press") == (False, "This emergency stop is not virtual: press the button.")
    assert live.state is GateState.ACTIVE


def test_the_stack_file_names_the_board_for_a_launch(tmp_path: Path) -> None:
    stack = tmp_path / "mine.yaml"
    stack.write_text("estop: {use: serial, port: /dev/ttyACM3}\n")
    words = commands(LaunchConfig(str(stack), dds=DdsConfig()))["safety"]
    assert words[-4:] == ["--estop.use", "serial", "--estop.port", "/dev/ttyACM3"]


def test_lock_step_has_no_board() -> None:
    stack = parse_stack("robot: {use: mujoco}\nestop: {use: serial, port: /dev/ttyACM3}\n", "mine")
    robot = build_robot(stack, 0)
    with pytest.raises(ConfigError, match="in lock-step estop.use is 'virtual'"):
        LockstepRunner(stack, robot)
    robot.close()
