from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from tests.capabilities.legs.floor_plant import FloorPlant

from golem.capabilities.arms.postures import POSTURES
from golem.capabilities.legs.base import STANDING, LowerBody
from golem.capabilities.legs.hold import STANCES
from golem.capabilities.legs.wbc import StanceError, Wbc, WbcConfig
from golem.capabilities.legs.wbc_qp import QpWeights, StanceDynamics, StanceProgram, Tasks
from golem.errors import ConfigError
from golem.interfaces import topics
from golem.interfaces.payloads import LegCommand
from golem.robots.model import pinocchio_model
from golem.robots.model.leg_kinematics import SOLE_CENTER
from golem.robots.model.table import DOF, load_limits
from golem.robots.mujoco.engine import MujocoRobot
from golem.runtime.lockstep import build
from golem.stack import Choice, load_stack
from golem.types import LEGS, NUM_JOINTS, UPPER, Array, BaseEstimate, Imu, LowState

FRICTION = 0.6
BOUND = 0.85 * load_limits().torque[LEGS]


def torque(command: LegCommand) -> Array:
    assert command.tau is not None
    return command.tau


def crouching() -> Array:
    q = np.zeros(NUM_JOINTS)
    q[LEGS] = np.tile(STANCES["crouch"], 2)
    q[UPPER] = POSTURES["home"]
    return q


def state(q: Array) -> LowState:
    zero = np.zeros(NUM_JOINTS)
    imu = Imu(np.array([1.0, 0, 0, 0]), np.zeros(3), np.array([0, 0, 9.81]))
    return LowState(0.0, q, zero, zero, imu)


def still(height: float = 0.96) -> BaseEstimate:
    T = np.eye(4)
    T[2, 3] = height
    return BaseEstimate(0.0, T, height=height, contact=np.ones(2))


@cache
def dynamics() -> StanceDynamics:
    return StanceDynamics()


@cache
def reference() -> pin.Model:
    """The model of the robot with nothing of the stance controller in it."""
    model = pinocchio_model.build(free_base=True)
    model.armature[6:] = DOF.armature
    return model


@pytest.mark.parametrize("seed", range(20))
def test_solutions_obey_physics_whatever_is_asked(seed: int) -> None:
    rng = np.random.default_rng(seed)
    q = crouching() + rng.normal(0.0, 0.15, NUM_JOINTS)
    dq = rng.normal(0.0, 1.0, NUM_JOINTS)
    R = pin.exp3(rng.normal(0.0, 0.3, 3))
    velocity, rate = rng.normal(0.0, 0.5, 3), rng.normal(0.0, 1.0, 3)
    d = dynamics()
    d.update(R, velocity, rate, q, dq)
    wild = Tasks(*(rng.normal(0.0, 30.0, n) for n in (3, 3, 12, 12)))
    program = StanceProgram(BOUND, FRICTION, 0.005, QpWeights())
    solution = program.solve(d, wild)
    assert solution is not None
    # Equations of motion by another road: recursive Newton-Euler with the forces on the ankle links.
    model = reference()
    data = model.createData()
    configuration = np.concatenate([np.zeros(3), pin.Quaternion(R).coeffs(), q])
    v, a = np.concatenate([R.T @ velocity, rate, dq]), np.zeros(33)
    a[:18] = solution.acceleration
    tau = pin.rnea(model, data, configuration, v, a)
    tau[6:] += DOF.damping * dq
    pin.computeJointJacobians(model, data, configuration)
    for foot, side in enumerate(("left", "right")):
        frame = model.getFrameId(f"{side}_ankle_roll_link")
        J = pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
        place = pin.updateFramePlacement(model, data, frame)
        for corner, force in zip(program.corners, solution.forces[foot], strict=True):
            point = place.rotation @ (corner + SOLE_CENTER)
            tau -= J.T @ np.concatenate([force, np.cross(point, force)])
    np.testing.assert_allclose(tau[:6], 0.0, atol=1e-6)
    np.testing.assert_allclose(tau[6:18], solution.torque, atol=1e-6)
    assert (np.abs(solution.torque) <= BOUND + 1e-6).all()
    local = np.einsum("fij,fci->fcj", d.soles_R, solution.forces)
    assert (local[..., 2] >= -1e-6).all()
    assert (np.abs(local[..., 0]) + np.abs(local[..., 1]) <= FRICTION * local[..., 2] + 1e-6).all()


def test_a_quiet_stance_takes_the_torques_of_inverse_dynamics() -> None:
    # Without springs nothing is asked to accelerate, so what is left is statics.
    legs = Wbc(WbcConfig(com_gain=(0.0, 0.0, 0.0), turn_gain=0.0, posture_gain=0.0))
    q = crouching()
    legs.reset(state(q))
    command = legs.step(state(q), still(), STANDING, 0.002)
    assert legs._solution is not None
    forces, d = legs._solution.forces, legs._dynamics
    corners = d.soles[:, None] + np.einsum("fij,cj->fci", d.soles_R, legs._program.corners)
    np.testing.assert_array_equal(command.kp, 0.0)
    total = forces.sum(axis=(0, 1))
    model = reference()
    data = model.createData()
    configuration = np.concatenate([np.zeros(6), [1.0], q])
    np.testing.assert_allclose(total, [0, 0, pin.computeTotalMass(model) * 9.81], atol=0.5)
    pressure = np.einsum("fc,fci->i", forces[..., 2], corners) / total[2]
    np.testing.assert_allclose(pressure[:2], pin.centerOfMass(model, data, configuration)[:2], atol=1e-3)
    tau = pin.rnea(model, data, configuration, np.zeros(33), np.zeros(33))
    pin.computeJointJacobians(model, data, configuration)
    for foot, side in enumerate(("left", "right")):
        frame = model.getFrameId(f"{side}_ankle_roll_link")
        J = pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
        ankle = pin.updateFramePlacement(model, data, frame).translation
        for point, force in zip(corners[foot], forces[foot], strict=True):
            tau -= J.T @ np.concatenate([force, np.cross(point - ankle, force)])
    np.testing.assert_allclose(torque(command), tau[6:18], atol=0.3)


def test_stands_on_a_floor_and_takes_a_small_push() -> None:
    legs = Wbc()
    assert isinstance(legs, LowerBody)
    plant = FloorPlant()
    assert plant.run(legs, 5.0, (1.0, 0.2, np.array([60.0, 60.0, 0.0])))
    assert legs._solution is not None and legs._failures == 0
    assert (np.abs(legs._solution.torque) < BOUND - 1e-3).all()
    d = legs._dynamics
    assert np.linalg.norm((d.soles.mean(axis=0) - d.com)[:2]) < 0.02
    assert np.linalg.norm(plant.data.qvel[:6]) < 0.05


def test_feet_that_feel_no_ground_get_half_of_their_torques_and_all_of_them_once_they_do() -> None:
    legs = Wbc(WbcConfig(engage=1.0))
    q = crouching()

    def ticks(n: int, contact: float) -> LegCommand:
        base = replace(still(), contact=np.full(2, contact))
        return [legs.step(state(q), base, STANDING, 0.002) for _ in range(n)][-1]

    legs.reset(state(q))
    commands = [ticks(1, 0.0) for _ in range(600)]
    torques = np.array([torque(c) for c in commands])
    assert np.abs(torques[0]).max() < 0.5
    assert np.abs(np.diff(torques, axis=0)).max() < 0.5
    assert legs._share == 0.5
    np.testing.assert_allclose(commands[-1].kp, 0.5 * commands[0].kp, rtol=0.01)
    np.testing.assert_array_equal(commands[-1].q, q[LEGS])
    stands = ticks(251, 1.0)
    np.testing.assert_array_equal(stands.kp, 0.0)
    np.testing.assert_allclose(torque(stands), 2.0 * torques[-1], rtol=1e-6)
    # A foot that leaves the ground for a moment is no reason to let go.
    np.testing.assert_array_equal(ticks(1, 0.0).kp, 0.0)
    # Whoever takes over a standing robot carries it at once.
    legs.reset(state(q))
    np.testing.assert_allclose(torque(ticks(1, 1.0)), torque(stands), atol=0.5)


def test_feet_that_creep_apart_are_drawn_together() -> None:
    rolls = [2, 8]
    q = crouching()
    spread = q.copy()
    spread[rolls] += [0.001, -0.001]
    held = {}
    for gain in (0.0, 2500.0):
        legs = Wbc(WbcConfig(feet_gain=gain))
        legs.reset(state(q))
        first = torque(legs.step(state(q), still(), STANDING, 0.002))
        held[gain] = torque(legs.step(state(spread), still(), STANDING, 0.002))[rolls] - first[rolls]
    left, right = held[2500.0] - held[0.0]
    assert left < -1.0
    assert right == pytest.approx(-left, rel=0.05)


def test_bad_measurements_and_options_are_named() -> None:
    legs = Wbc()
    broken = crouching()
    broken[3] = np.nan
    with pytest.raises(StanceError, match="not finite"):
        legs.step(state(broken), still(), STANDING, 0.002)
    with pytest.raises(ConfigError, match="crouch"):
        Wbc(WbcConfig(stance="croch"))
    with pytest.raises(ConfigError, match="six"):
        Wbc(WbcConfig(kd=(1.0, 2.0)))


@pytest.mark.slow
def test_stands_in_the_whole_stack_on_estimates_alone() -> None:
    stack = load_stack("stand", profile="field")
    stack = stack.with_options("robot", world="open").with_choice("lower_body", "wbc")
    running, twin = build(stack.with_choice("fallback", Choice("hold", {"standing": True})), 3)
    assert isinstance(twin, MujocoRobot)
    running.executor.run(3.5)
    assert not twin.on_gantry
    start = twin.truth.base()
    running.executor.run(5.5)
    end = twin.truth.base()
    legs = running.bus.latest(topics.LEG_STATUS)
    assert legs is not None and (legs.controller, legs.fault) == ("wbc", None)
    assert np.abs(end.T_world_base[:3, 3] - start.T_world_base[:3, 3]).max() < 0.005
    assert end.tilt < 0.05
