from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from golem.robots.model import magpie_model, mjcf
from golem.types import SIDES


def closed_form_pad(theta: float) -> np.ndarray:
    """Centre of finger a's pad in the hand frame, from the arc of its hinge."""
    angle = magpie_model.ANGLE_OPEN + theta
    hinge = magpie_model.CRANK_PIVOT + (
        magpie_model.FINGER_PIVOT[0],
        magpie_model.ARM * np.cos(angle),
        magpie_model.ARM * np.sin(angle),
    )
    return hinge + magpie_model.PAD_CENTER


def settle(model: mujoco.MjModel, data: mujoco.MjData, torque: float, steps: int) -> None:
    data.ctrl[27:] = torque
    for _ in range(steps):
        mujoco.mj_step(model, data)


@pytest.fixture
def floating(robot: mujoco.MjModel) -> Iterator[tuple[mujoco.MjModel, mujoco.MjData]]:
    """The robot without weight, so that only the hands move."""
    robot.opt.gravity[:] = 0.0
    robot.opt.timestep = 0.002
    data = mujoco.MjData(robot)
    yield robot, data
    robot.opt.gravity[:] = (0.0, 0.0, -9.81)


def test_gap_is_that_of_the_pivots(shared: Path) -> None:
    facts = json.loads((shared / "h12/h12_facts.json").read_text())["magpie"]["analytic_gap"]
    assert pytest.approx(facts["open_gap_mm"], abs=0.01) == 1e3 * magpie_model.MAX_GAP
    assert pytest.approx(facts["theta_closed_rad"], abs=1e-4) == magpie_model.CLOSED
    assert 2 * magpie_model.pad_offset(magpie_model.CLOSED) == pytest.approx(0.0, abs=1e-12)
    for sample in facts["samples"]:
        # The samples were read from a simulation that had not quite settled.
        assert 1e3 * 2 * magpie_model.pad_offset(sample["theta"]) == pytest.approx(sample["gap_mm"], abs=0.5)


@given(st.floats(0.0, magpie_model.MAX_GAP))
def test_a_gap_becomes_the_crank_angle_that_makes_it(gap: float) -> None:
    theta = magpie_model.crank_from_gap(gap)
    assert 0.0 <= theta <= magpie_model.CLOSED + 1e-12
    assert 2 * magpie_model.pad_offset(theta) == pytest.approx(gap, abs=1e-9)


def test_gaps_the_hand_cannot_make_are_clipped() -> None:
    assert magpie_model.crank_from_gap(-0.01) == pytest.approx(magpie_model.CLOSED)
    assert magpie_model.crank_from_gap(0.2) == pytest.approx(0.0, abs=1e-9)


@given(st.floats(0.0, magpie_model.CLOSED))
def test_the_crank_is_strong_enough_for_the_largest_force(theta: float) -> None:
    step = 1e-6
    travel = (magpie_model.pad_offset(theta - step) - magpie_model.pad_offset(theta + step)) / (2.0 * step)
    assert torque(magpie_model.MAX_FORCE, theta) == pytest.approx(magpie_model.MAX_FORCE * travel, rel=1e-6)
    assert torque(magpie_model.MAX_FORCE, theta) <= magpie_model.MAX_TORQUE


def torque(force: float, theta: float) -> float:
    """Return the crank torque [N m] that presses a pad with `force` [N], by virtual work."""
    return force * magpie_model.ARM * float(np.sin(magpie_model.ANGLE_OPEN + theta))


def test_hand_weighs_what_the_paper_says(robot: mujoco.MjModel) -> None:
    for side in SIDES:
        assert robot.body_subtreemass[robot.body(f"{side}_hand").id] == pytest.approx(magpie_model.MASS, abs=1e-6)
    assert magpie_model.lump().mass == pytest.approx(magpie_model.MASS, abs=1e-6)


def test_pads_meet_at_the_grasp_frame_when_closed(robot: mujoco.MjModel) -> None:
    data = mujoco.MjData(robot)
    for side in SIDES:
        for finger in magpie_model.FINGERS:
            crank, blade, _ = magpie_model.finger_names(side, finger)
            data.joint(crank).qpos[0], data.joint(blade).qpos[0] = magpie_model.CLOSED, -magpie_model.CLOSED
    mujoco.mj_kinematics(robot, data)
    for side in SIDES:
        T = data.body(f"{side}_hand").xmat.reshape(3, 3)
        grasp = data.site(f"{side}_gripper").xpos
        for finger, sign in (("a", 1.0), ("b", -1.0)):
            pad = T.T @ (data.geom(f"{side}_{finger}_pad").xpos - grasp)
            # Inner faces touch on the centre plane; the tip of the pads reaches the grasp point.
            assert pad[1] == pytest.approx(sign * magpie_model.PAD_HALF_SIZE[1], abs=1e-9)
            assert pad[2] + magpie_model.PAD_HALF_SIZE[2] == pytest.approx(0.0, abs=1e-4)


def test_fingers_translate_without_turning_in_simulation(floating: tuple[mujoco.MjModel, mujoco.MjData]) -> None:
    model, data = floating
    turned, off = 0.0, 0.0
    for torque in (0.05, -0.05):
        for _ in range(8):
            settle(model, data, torque, 25)
            mujoco.mj_kinematics(model, data)
            for side in SIDES:
                hand = data.body(f"{side}_hand").xmat.reshape(3, 3)
                for finger in magpie_model.FINGERS:
                    crank, blade, pad = magpie_model.finger_names(side, finger)
                    relative = hand.T @ data.body(blade).xmat.reshape(3, 3)
                    turned = max(turned, float(np.arccos(np.clip((np.trace(relative) - 1.0) / 2.0, -1.0, 1.0))))
                    theta = float(data.joint(crank).qpos[0])
                    position = hand.T @ (data.geom(pad).xpos - data.body(f"{side}_hand").xpos)
                    error = position - magpie_model.mirror(finger, closed_form_pad(theta))
                    off = max(off, float(np.abs(error).max()))
    assert turned < 2e-3
    assert off < 1e-4


def test_closing_torque_closes_both_hands_and_opening_torque_opens_them(
    floating: tuple[mujoco.MjModel, mujoco.MjData],
) -> None:
    model, data = floating
    cranks = [magpie_model.finger_names(side, finger)[0] for side in SIDES for finger in magpie_model.FINGERS]
    settle(model, data, 0.05, 500)
    np.testing.assert_allclose([data.joint(c).qpos[0] for c in cranks], magpie_model.CLOSED, atol=5e-3)
    settle(model, data, -0.05, 500)
    np.testing.assert_allclose([data.joint(c).qpos[0] for c in cranks], 0.0, atol=5e-3)


def test_a_held_block_feels_the_force_of_the_closed_form() -> None:
    """Squeeze a fixed 30 mm block and read the contact force of each pad."""
    spec = mjcf.robot_spec()
    T = magpie_model.T_HAND_GRIPPER[:3, 3]
    spec.body("left_hand").add_geom(
        name="block", type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.02, 0.015, 0.02], pos=[T[0], 0, T[2] - 0.02],
        contype=1, conaffinity=1, mass=0,
    )  # fmt: skip
    spec.option.gravity = [0, 0, 0]
    model = spec.compile()
    data = mujoco.MjData(model)
    theta = magpie_model.crank_from_gap(0.030)
    force = 8.0
    for finger in magpie_model.FINGERS:
        crank, blade, _ = magpie_model.finger_names("left", finger)
        data.joint(crank).qpos[0], data.joint(blade).qpos[0] = theta, -theta
        data.actuator(crank).ctrl[0] = torque(force, theta)
    for _ in range(500):
        mujoco.mj_step(model, data)
    for finger in magpie_model.FINGERS:
        pad = model.geom(f"left_{finger}_pad").id
        normal = 0.0
        for i in range(data.ncon):
            if pad in data.contact.geom[i]:
                wrench = np.zeros(6)
                mujoco.mj_contactForce(model, data, i, wrench)
                normal += wrench[0]
        assert normal == pytest.approx(force, rel=0.05)
