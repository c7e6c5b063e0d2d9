"""The hand's controller on the twin's hand: fingers with mass, friction and a servo's lag."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from golem.hardware.hands.magpie import MagpieHand
from golem.interfaces.payloads import GripState
from golem.robots.model.mjcf import robot_spec
from golem.robots.mujoco.hand_servos import HandServos

DT = 0.002


class Twin:
    """The left hand of a robot that is held in mid-air, with or without a floating cylinder between its fingers."""

    def __init__(self, width: float | None) -> None:
        spec = robot_spec(hands=True)
        spec.delete(spec.joint("base"))
        spec.option.timestep = 0.001
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        spec.option.gravity = [0.0, 0.0, 0.0]
        if width is not None:
            plain = spec.compile()
            data = mujoco.MjData(plain)
            mujoco.mj_forward(plain, data)
            site = data.site("left_gripper")
            body = spec.worldbody.add_body(name="bolt", pos=site.xpos)
            body.add_freejoint()
            size = [width / 2, 0.02, 0.0]
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=size, mass=0.05, friction=[0.6, 0.005, 1e-4])
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.servos = HandServos(self.model, "left")
        self.servos.reset(self.data, 0.06)
        self.hand = MagpieHand()

    def run(self, seconds: float, pull: float = 0.0) -> list[GripState]:
        """Let time pass, with a force [N] that pulls the object down; returns the states in order."""
        states: list[GripState] = []
        for _ in range(round(seconds / DT)):
            command = self.hand.step(self.servos.read(self.data, self.data.time), self.data.time)
            self.servos.command(command, DT)
            if pull:
                self.data.body("bolt").xfrc_applied[2] = -pull
            for _ in range(2):
                self.servos.drive(self.data)
                mujoco.mj_step(self.model, self.data)
            if not states or states[-1] is not self.hand.status().state:
                states.append(self.hand.status().state)
        return states


@pytest.mark.parametrize("force", [2.0, 8.0])
def test_it_holds_a_bolt_with_the_force_it_was_told(force: float) -> None:
    twin = Twin(0.016)
    twin.run(0.05)
    twin.hand.close(force)
    states = twin.run(1.5)
    assert states[-1] is GripState.HOLDING
    assert GripState.SLIPPED not in states
    status = twin.hand.status()
    assert status.gap == pytest.approx(0.016, abs=0.002)
    np.testing.assert_allclose(status.force, force, rtol=0.1)


def test_it_notices_that_nothing_is_there() -> None:
    twin = Twin(None)
    twin.hand.close(8.0)
    states = twin.run(2.0)
    assert states[-1] is GripState.EMPTY
    assert GripState.HOLDING not in states


def test_it_notices_that_the_bolt_was_torn_out() -> None:
    twin = Twin(0.016)
    twin.hand.close(4.0)
    assert twin.run(1.5)[-1] is GripState.HOLDING
    assert twin.run(1.0, pull=30.0)[-1] is GripState.SLIPPED
