"""A domain is shared: what others are there, what they say, and whose the motors are."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from tests.runtime.live.conftest import Live
from tests.runtime.live.test_live import VENDOR

from golem.errors import ConfigError
from golem.hardware.safety.base import SafetyLimits
from golem.interfaces import images, public, topics
from golem.interfaces import ros_convert as convert
from golem.interfaces.payloads import DetectionRequest, GateState
from golem.middleware.bus import Bus
from golem.middleware.dds.base import Qos
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.wire import convert as wire
from golem.middleware.wire import hg
from golem.middleware.wire.convert import answered, encode_low_state
from golem.robots.sensors.calibration import OPTICAL_FRAMES
from golem.robots.sensors.cameras import CAMERAS
from golem.runtime.executor import Executor, in_order
from golem.runtime.live.bridge import outgoing
from golem.runtime.live.role_endpoints import RoleEndpoints
from golem.runtime.live.safety_main import SafetyConfig, run_safety
from golem.runtime.live.safety_process import SafetyProcess
from golem.runtime.live.stack_streams import encoders
from golem.stack import Choice
from golem.types import NUM_JOINTS, Imu, LowCommand, LowState

STILL = Imu(np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), np.array([0.0, 0.0, 9.81]))


def at_rest(t: float) -> LowState:
    zeros = np.zeros(NUM_JOINTS)
    return LowState(t, zeros, zeros, zeros, STILL)


def test_a_gate_that_is_shut_leaves_the_motors_to_whoever_has_them(live: Live) -> None:
    participant, _ = live.member("listener")
    motors = participant.reader("rt/lowcmd", hg.LOW_CMD.type_name, Qos(reliable=False, depth=1000))
    other, _ = live.member("on_board")
    other.writer("rt/lowcmd", hg.LOW_CMD.type_name, VENDOR)
    live.run(0.1)
    assert (live.state, live.reason) == (GateState.INIT, "two_writers") and not motors.take(1000)
    other.close()
    live.run(0.1)
    assert live.state is GateState.ARMED and motors.take(1000)


def test_a_best_effort_writer_is_another_writer(live: Live) -> None:
    live.activate()
    intruder, _ = live.member("intruder")
    intruder.writer("rt/lowcmd", hg.LOW_CMD.type_name, Qos(reliable=False, depth=1))
    live.run(0.1)
    assert (live.state, live.reason) == (GateState.STOP1, "two_writers")


@pytest.mark.parametrize(("topic", "kind"), [("/safety/lowcmd_in", hg.LOW_CMD), ("/lowstate", hg.LOW_STATE)])
def test_a_second_stack_and_a_second_robot_stop_the_first(live: Live, topic: str, kind: hg.StructLayout) -> None:
    live.activate()
    second, _ = live.member("second")
    writer = second.writer(f"rt{topic}", kind.type_name, public.topic(topic).qos)
    live.run(0.1)
    assert (live.state, live.reason) == (GateState.STOP1, "two_writers")
    assert live.gate is not None
    assert f"{topic} is written by 2" in live.gate.status.detail and writer.guid.hex() in live.gate.status.detail


def test_an_operator_hands_over_to_a_second_stack_and_the_first_is_heard_no_more(live: Live) -> None:
    live.activate()
    assert live.ask("hand_over") == (False, "The robot is in motion; stop it first: golem safety stop.")
    second, _ = live.member("second")
    row = public.topic("/safety/lowcmd_in")
    second.writer("rt/safety/lowcmd_in", hg.LOW_CMD.type_name, row.qos)
    live.run(0.1)
    assert live.reason == "two_writers" and not live.ask("reset")[0]
    assert live.ask("hand_over")[0]
    live.run(1.0)
    assert live.ask("reset")[0]
    # The second says nothing, and what the first says does not count.
    assert live.gate is not None and live.gate._arrivals.ignored
    live.run(0.3)
    success, message = live.ask("activate")
    assert not success and "command_stale" in message


def test_a_motor_that_reports_an_error_is_named_once_it_persists(live: Live) -> None:
    live.activate()
    assert live.twin is not None
    start = live.twin.executor.t
    q, dq, tau = live.robot.joints()
    live.leave("twin")
    robot, _ = live.member("robot")
    writer = robot.writer("rt/lowstate", hg.LOW_STATE.type_name, public.topic("/lowstate").qos)
    seen = []
    for k in range(40):
        payload = bytearray(encode_low_state(LowState(start + 0.002 * k, q, dq, tau, STILL)))
        hg.LOW_STATE.read(payload)["motor"]["motorstate"][9] = 0x20
        hg.STATE_CHECKSUM.seal(payload)
        writer.write(bytes(payload))
        live.run(0.002)
        seen.append(live.reason)
    assert live.gate is not None
    assert "motor_error" in seen and seen.index("motor_error") >= 20
    assert "right_knee_joint reports error 0x20" in live.gate.status.detail


@pytest.mark.parametrize("first", [5.000, 5.001])
def test_a_stack_ticks_once_for_each_state_and_answers_that_one(live: Live, first: float) -> None:
    participant, node = live.member("answering")
    reader = live.member("gate")[0].reader("rt/safety/lowcmd_in", hg.LOW_CMD.type_name, Qos(depth=100))
    bus = Bus()
    sent = outgoing(bus, RoleEndpoints("stack", participant, node), encoders(bus, lambda: 0))
    executor = Executor(bus, in_order(sent), first)
    got = []
    for k in range(50):
        t = first + 0.002 * k
        bus.publish(topics.LOW_STATE, at_rest(t), t)
        zeros = np.zeros(NUM_JOINTS)
        bus.publish(topics.LOW_CMD_REQUEST, LowCommand(t, zeros, zeros, zeros, zeros, zeros), t)
        executor.advance(t, 5)
        got.append([answered(sample.payload) for sample in reader.take(100) if sample.alive])
    assert got == [[pytest.approx(first + 0.002 * k)] for k in range(50)]


@pytest.mark.parametrize("parent", ["camera_link", OPTICAL_FRAMES["head"]])
def test_only_the_robots_own_frames_calibrate_a_camera(live: Live, parent: str) -> None:
    live.run(0.02)
    driver, node = live.member("driver")
    row = public.topic("/tf_static")
    shifted = np.eye(4)
    shifted[0, 3] = 0.5
    publisher = node.publisher(row.name, row.type, row.qos)
    publisher.publish(convert.transforms(0.0, [(parent, public.optical_frame("head"))], shifted[np.newaxis]))
    live.run(0.02)
    assert live.up is not None
    moved = live.up._calibration["head"][0, 3]  # pyright: ignore[reportPrivateUsage]
    assert (abs(moved - 0.5) < 1e-9) == (parent == OPTICAL_FRAMES["head"])


def test_images_of_another_clock_are_refused_with_a_remedy(live: Live, capsys: pytest.CaptureFixture[str]) -> None:
    live.run(0.02)
    assert live.up is not None and live.up.side is not None
    bus = live.up.side.bus
    bus.publish(topics.detection_request("head"), DetectionRequest(("screw",)), 0.02)
    live.run(0.02)
    _, node = live.member("driver")
    send: dict[str, Callable[..., None]] = {}
    for what in (public.CAMERA_INFO, public.COLOR, public.DEPTH):
        row = public.topic(public.image("head", what))
        send[what] = node.publisher(row.name, row.type, row.qos).publish
    info, frame = CAMERAS["head"], public.optical_frame("head")
    for t in (1.7e9, 0.03):
        send[public.CAMERA_INFO](images.camera_info(t, info, frame))
        send[public.COLOR](images.color_image(t, np.zeros((info.height, info.width, 3), np.uint8), frame))
        send[public.DEPTH](images.depth_image(t, np.ones((info.height, info.width), np.float32), frame))
        live.run(0.02)
        newest = bus.latest(topics.exposures("head"))
        assert (newest is None) == (t > 1.0)
    assert capsys.readouterr().out.count("use_sim_time") == 1


def test_the_real_robots_own_leg_controller_is_not_commanded_against(live: Live, tmp_path: Path) -> None:
    mine = tmp_path / "mine.py"
    mine.write_text("from golem.capabilities.legs.vendor import Vendor\n\nclass Mine(Vendor):\n    pass\n")
    for legs in (
        Choice("vendor"),
        Choice("golem.capabilities.legs.vendor:Vendor"),
        Choice(f"{mine}:Mine"),
        Choice("handover", {"walk": {"use": f"{mine}:Mine"}, "stand": {"use": "almi"}}),
    ):
        live.stack = live.stack.with_choice("lower_body", legs)
        with pytest.raises(ConfigError, match="moves its legs itself"):
            live.start_up(real=True)


def test_no_module_of_a_real_robots_stack_can_call_its_own_controller(live: Live, tmp_path: Path) -> None:
    """Also one that hides that it does."""
    mine = tmp_path / "hidden.py"
    mine.write_text(
        "from golem.capabilities.legs.vendor import Vendor\n\n"
        "class Mine:\n    rate = latency = envelope = gait = reset = step = None\n"
        "    def __new__(cls, onboard): return Vendor(onboard=onboard)\n"
    )
    live.stack = live.stack.with_choice("lower_body", f"{mine}:Mine")
    live.start_twin()
    live.start_gate()
    live.start_up(real=True)
    with pytest.raises(ConfigError, match="only a stack that runs on a twin"):
        live.run(0.1)


def test_a_gate_that_fails_can_still_damp(live: Live, monkeypatch: pytest.MonkeyPatch) -> None:
    participant, _ = live.member("listener")
    motors = participant.reader("rt/lowcmd", hg.LOW_CMD.type_name, Qos(reliable=False, depth=1))
    live.activate()
    live.run(2.0)

    def stiffness() -> float:
        return max(wire.decode_low_command(s.payload, 0.0).kp.max() for s in motors.take())

    assert stiffness() > 0.0

    def fail(*_: object) -> None:
        raise RuntimeError("no")

    monkeypatch.setattr(SafetyProcess, "_judge", fail)
    assert live.gate is not None
    with pytest.raises(RuntimeError):
        live.gate.stop()
    live.gate.damp()
    assert stiffness() == 0.0


def test_a_safety_process_that_fails_damps_for_as_long_as_a_stop_takes(
    monkeypatch: pytest.MonkeyPatch, domain: int
) -> None:
    pytest.importorskip("cyclonedds")
    damped: list[float] = []

    def fail(gate: SafetyProcess) -> None:
        raise RuntimeError("no")

    monkeypatch.setattr(SafetyProcess, "step", fail)
    monkeypatch.setattr(SafetyProcess, "damp", lambda gate: damped.append(time.monotonic()))
    with pytest.raises(RuntimeError):
        run_safety(SafetyConfig(dds=DdsConfig(domain=domain)))
    assert damped[-1] - damped[0] > 0.9 * SafetyLimits.from_profile().damping_time and len(damped) > 100
