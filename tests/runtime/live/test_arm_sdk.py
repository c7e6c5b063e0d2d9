"""A program of the vendor's gets the arms by its weight, without a jump, and never while they are not to be had."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from tests.runtime.live.conftest import Live

from golem.interfaces import topics
from golem.interfaces.public import WEIGHT, decode_arm_sdk, decode_sticks
from golem.interfaces.unitree_api import ArmSdkCommand
from golem.middleware.bus import Bus
from golem.middleware.dds.base import Qos
from golem.middleware.ros.msgs.unitree_go import WirelessController
from golem.middleware.wire import hg
from golem.middleware.wire.struct_layout import WireError
from golem.runtime.live.stack_streams import ArmSdk
from golem.types import ARMS, LEGS, NUM_JOINTS, TICK, Array, LowCommand

OWN = LowCommand(0.0, *(np.full(NUM_JOINTS, v) for v in (0.5, 0.0, 1.0, 100.0, 2.0)))


def message(
    weight: float, q: float | Array = -1.5, seal: bool = True,
    tau: float | Array = 0.0, kp: float | Array = 60.0, kd: float | Array = 1.5,
) -> bytes:  # fmt: skip
    """Return a command as the vendor's examples send it: modes 0, the weight in slot 27."""
    payload = bytearray(hg.LOW_CMD.size)
    payload[:4] = b"\0\1\0\0"
    image = hg.LOW_CMD.read(payload)
    for name, values in (("q", q), ("tau", tau), ("kp", kp), ("kd", kd)):
        image["motor"][name][ARMS] = values
    image["motor"]["q"][WEIGHT] = weight
    if seal:
        hg.COMMAND_CHECKSUM.seal(payload)
    return bytes(payload)


def test_a_command_is_read_as_examples_send_it() -> None:
    for seal in (True, False):
        command = decode_arm_sdk(message(0.25, seal=seal))
        assert command.weight == 0.25 and (command.motors[0] == -1.5).all() and (command.motors[3] == 60.0).all()
    assert decode_arm_sdk(message(7.0)).weight == 1.0 and decode_arm_sdk(message(-1.0)).weight == 0.0
    broken = bytearray(message(1.0))
    broken[100] ^= 1
    for wrong in (bytes(broken), message(float("nan"), seal=False), message(1.0, float("inf")), b"", message(1.0)[:-4]):
        with pytest.raises(WireError):
            decode_arm_sdk(wrong)


def test_sticks_are_velocities() -> None:
    twist = decode_sticks(WirelessController(0.5, 1.0, -1.0, 0.0, 0))
    assert (twist.vx, twist.vy, twist.wz) == pytest.approx((0.6, -0.15, 0.8))
    assert decode_sticks(WirelessController(0.0, 9.0, 0.0, 0.0, 0)).vx == 0.6
    with pytest.raises(WireError):
        decode_sticks(WirelessController(float("nan"), 0.0, 0.0, 0.0, 0))


class Rig:
    def __init__(self) -> None:
        self.bus, self.closed, self.t = Bus(), False, 1.0
        self.arms = ArmSdk(self.bus, lambda: self.closed)

    def run(self, seconds: float, weight: float | None) -> Array:
        """Return (n, 27) the positions that are commanded tick by tick while a program asks for `weight`."""
        rows: list[Array] = []
        for k in range(round(seconds / TICK)):
            if weight is not None and k % 10 == 0:
                self.bus.publish(topics.ARM_SDK, ArmSdkCommand(weight, np.full((5, 14), -1.5)), self.t)
            rows.append(self.arms.blend(OWN, self.t).q)
            self.t += TICK
        return np.array(rows)


def test_the_weight_comes_and_goes_without_a_jump_and_the_legs_stay_ours() -> None:
    rig = Rig()
    rows = np.vstack([rig.run(2.5, 1.0), rig.run(2.5, 0.0), rig.run(2.2, 1.0), rig.run(3.0, None), rig.run(0.1, 0.0)])
    assert np.abs(np.diff(rows, axis=0)).max() < 0.02
    arms = rows[:, ARMS.start]
    assert arms.min() == pytest.approx(-1.5) and arms[2499] == pytest.approx(0.5, abs=0.01)
    assert arms[-1] == 0.5 and (rows[:, : ARMS.start] == 0.5).all()


def test_who_has_the_arms_while_a_skill_runs_lets_go_first() -> None:
    rig = Rig()
    rig.run(2.2, 1.0)
    rig.closed = True
    assert np.abs(np.diff(rig.run(2.2, 1.0), axis=0)).max() < 0.02 and rig.arms.weight == 0.0
    rig.closed = False
    rig.run(2.2, 1.0)
    assert rig.arms.weight == 0.0
    rig.run(0.1, 0.0)
    rig.run(2.2, 1.0)
    assert rig.arms.weight == 1.0
    rig.closed = True
    rig.run(2.2, 1.0)
    rig.closed = False
    rig.run(1.1, None)
    rig.run(2.2, 1.0)
    assert rig.arms.weight == 1.0


@pytest.fixture
def active(live: Live) -> Iterator[Live]:
    live.activate()
    live.run(0.2)
    yield live


def test_arms_of_the_twin_follow_a_program_on_the_domain(active: Live) -> None:
    live = active
    writer = live.member("program")[0].writer("rt/arm_sdk", hg.LOW_CMD.type_name, Qos(depth=1))
    home = live.robot.joints()[0].copy()
    elbow, track = 16, [float(home[16])]

    def program(seconds: float, weight: float) -> None:
        for _ in range(round(seconds / 0.02)):
            writer.write(message(weight, float(home[elbow])))
            live.run(0.02)
            track.append(float(live.robot.joints()[0][elbow]))

    program(2.2, 1.0)
    there = live.robot.joints()[0].copy()
    assert np.abs(there[ARMS] - home[ARMS]).max() > 0.3
    np.testing.assert_allclose(there[LEGS], home[LEGS], atol=0.1)
    program(2.5, 0.0)
    live.run(1.0)
    assert np.abs(live.robot.joints()[0][ARMS] - home[ARMS]).max() < 0.1
    assert live.state.value == "active"
