"""The compiled tick of `diff_ik` against the same written with Pinocchio and NumPy."""

from __future__ import annotations

import daqp
import numpy as np
import pinocchio as pin
import pytest

from golem.capabilities.arms import task_kernel
from golem.capabilities.arms.arm_kinematics import UpperKinematics
from golem.capabilities.arms.base import ARM_COLUMNS, NUM_UPPER, TargetError, check_pose
from golem.capabilities.arms.diff_ik import DiffIK
from golem.capabilities.arms.ik_kernel import rigid
from golem.capabilities.arms.postures import posture
from golem.capabilities.arms.task_space import NEAR, SINGULAR_TICKS, TaskSpaceConfig
from golem.capabilities.collision.collision_model import CollisionModel
from golem.capabilities.collision.sphere_robot import shipped_spheres
from golem.robots.model.table import JOINT_NAMES
from golem.types import NUM_JOINTS, SIDES, UPPER, Array

DT = 0.01


class PythonIK:
    """What the kernels compute, by other means."""

    def __init__(self, ik: DiffIK) -> None:
        self.ik, self.kinematics = ik, UpperKinematics()
        self.q, self.left_over, self.singular, self.ticks = ik.q.copy(), 0.0, 0.0, 0
        self.spheres = CollisionModel(shipped_spheres(), JOINT_NAMES[UPPER])

    def step(self, goals: tuple[Array | None, Array | None]) -> tuple[Array, Array, Array, bool]:
        ik, c, k = self.ik, self.ik.config, self.kinematics
        k.update(self.q)
        room, limited = ik.speed * DT, False
        rows, wanted, damping, singular = [], [], c.damping + c.error_damping * self.left_over, 0.0
        root = np.repeat(np.sqrt([c.position_weight, c.rotation_weight]), 3)
        for side, goal in zip(SIDES, goals, strict=True):
            if goal is None:
                room[ARM_COLUMNS[side]] = 0.0
                continue
            to_frame = pin.SE3(goal).actInv(k.placement(side))
            residual = -pin.log6(to_frame).vector
            distance, angle = np.linalg.norm(residual[:3]), np.linalg.norm(residual[3:])
            reach, turn = c.palm_speed * DT, c.palm_turn * DT
            share = min(reach / max(distance, reach), turn / max(angle, turn))
            if share < 1.0:
                limited, residual = True, share * residual
                to_frame = pin.exp6(-residual)
            rows.append(root[:, None] * (pin.Jlog6(to_frame) @ k.jacobian(side)))
            wanted.append(c.palm_gain * root * residual)
            J = k.jacobian(side)[:, ARM_COLUMNS[side]]
            lost = max(0.0, 1.0 - np.sqrt(max(np.linalg.eigvalsh(J @ J.T)[0], 0.0)) / c.singular_value)
            singular += c.singular_damping * lost**2
        if self.ticks % SINGULAR_TICKS == 0:
            self.singular = singular
        self.ticks += 1
        A = np.concatenate(rows)
        H = A.T @ A + np.diag(ik.soft + damping + self.singular)
        f = -(np.concatenate(wanted) @ A + ik.soft * min(1.0, c.posture_rate * DT) * (ik.rest - self.q))
        lower, upper = np.clip(ik.lower - self.q, -room, room), np.clip(ik.upper - self.q, -room, room)
        near = self.spheres.nearest(self.q, c.collision_rows, NEAR)
        bounds = -c.collision_gain * np.maximum(near.distance - c.clearance, 0.0)
        above, below = np.append(upper, np.full(len(bounds), 1e30)), np.append(lower, bounds)
        step, _, flag, _ = daqp.solve(H, f, near.gradient, above, below, np.zeros(len(below), np.int32))
        assert flag > 0
        held = (step <= lower + 1e-9) | (step >= upper - 1e-9)
        limited |= bool((held & (room > 0.0)).any())
        q = self.q + np.clip(step, lower, upper)
        self.q = np.clip(q, np.minimum(ik.lower, self.q), np.maximum(ik.upper, self.q))
        k.update(self.q)
        position, rotation = np.zeros(2), np.zeros(2)
        for i, (side, goal) in enumerate(zip(SIDES, goals, strict=True)):
            if goal is not None:
                here = k.placement(side)
                position[i] = np.linalg.norm(goal[:3, 3] - here.translation)
                rotation[i] = np.linalg.norm(pin.log3(here.rotation.T @ goal[:3, :3]))
        self.left_over = np.sqrt(c.position_weight * position @ position + c.rotation_weight * rotation @ rotation)
        return self.q, position, rotation, limited


@pytest.mark.parametrize("name", ["circles", "far", "stretched", "one hand"])
def test_ticks_are_those_of_the_python_form(name: str) -> None:
    ik, start = DiffIK(), np.zeros(NUM_JOINTS)
    start[UPPER] = posture("ready")
    ik.reset(start)
    other, k = PythonIK(ik), ik.kinematics
    hands = [k.pose(side, ik.q).copy() for side in SIDES]
    damped = 0.0
    for i in range(300):
        goals: list[Array | None] = [T.copy() for T in hands]
        for T in goals:
            assert T is not None
            phase = 2.0 * np.pi * i * DT / 1.5
            T[:3, 3] += 0.08 * np.array([0.0, np.sin(phase), np.cos(phase) - 1.0])
            T[:3, :3] = T[:3, :3] @ pin.exp3(np.array([0.3 * np.sin(phase), 0.2, -0.4]) * min(1.0, i / 50))
            if name == "far":
                T[:3, 3] += (0.3, 0.0, 0.2)
                T[:3, :3] = T[:3, :3] @ pin.exp3(np.array([0.0, 0.0, 2.5]))
            elif name == "stretched":
                T[:3, 3] += (0.0, 0.4 * np.sign(T[1, 3]), -0.6)
        if name == "one hand":
            goals[i // 150] = None
        # From the same state: at a limit, sums in another order grow from tick to tick.
        other.q, other.left_over = ik.q.copy(), float(ik.task.state[task_kernel.LEFT_OVER])
        command = ik.step(goals[0], goals[1], start, DT)
        q, position, rotation, limited = other.step((goals[0], goals[1]))
        # Stretched arms: the program is nearly singular, and DAQP itself is only as exact as that.
        near = 1e-8 if name == "stretched" else 1e-9
        np.testing.assert_allclose(command.q, q, rtol=0.0, atol=near)
        np.testing.assert_allclose(command.error_position, position, rtol=0.0, atol=near)
        np.testing.assert_allclose(command.error_rotation, rotation, rtol=0.0, atol=near)
        assert command.limited == limited
        assert ik.task.state[task_kernel.SINGULAR] == pytest.approx(other.singular, abs=1e-10)
        damped = max(damped, other.singular)
    assert (damped > 0.0) == (name == "stretched")


def test_the_derivative_of_the_logarithm_is_that_of_pinocchio() -> None:
    rng, A, C = np.random.default_rng(0), np.empty((3, 3)), np.empty((3, 3))
    for angle in (0.0, 1e-9, 1e-5, 0.02, 0.0299, 0.0301, 0.5, 2.0, 3.1):
        twist = rng.standard_normal(6)
        twist[3:] *= angle / np.linalg.norm(twist[3:])
        task_kernel.log_derivative(-twist, A, C)
        wanted = pin.Jlog6(pin.exp6(twist))
        np.testing.assert_allclose(np.block([[A, C @ A], [np.zeros((3, 3)), A]]), wanted, rtol=0, atol=1e-9)


def test_a_pose_is_let_pass_where_the_readable_check_does() -> None:
    rng = np.random.default_rng(0)
    for _ in range(300):
        T = pin.SE3.Random().homogeneous + rng.choice([0.0, 1e-6, 1e-3]) * rng.standard_normal((4, 4))
        T[3] = (0.0, 0.0, 0.0, 1.0) if rng.random() < 0.8 else rng.choice([0.0, 1.0, np.nan], 4)
        T[:3, 0] *= rng.choice([1.0, -1.0])
        if rng.random() < 0.2:
            T[rng.integers(4), rng.integers(4)] = rng.choice([np.nan, np.inf])
        try:
            check_pose("It", np.asfortranarray(T))  # which only the readable one looks at
            good = True
        except TargetError:
            good = False
        assert rigid(T) == good


def test_the_last_row_of_bounds_is_that_of_the_nearest_pairs() -> None:
    ik = DiffIK(TaskSpaceConfig(collision_rows=3))
    n = NUM_UPPER
    assert ik.task.state[task_kernel.COUNT] == 3
    assert (np.diff(ik.task.distance) >= 0.0).all()
    assert (ik.task.below[n:] <= 0.0).all() and (ik.task.above[n:] == task_kernel.FAR).all()
