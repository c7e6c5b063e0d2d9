"""A module that a skill calls and that returns nonsense is blamed by its own name, not as a fault of the skill."""

from __future__ import annotations

import numpy as np
import pytest

from golem.capabilities.grasping.base import Grasp, Gripper, OpenLoop, ServoStatus, ServoStep
from golem.capabilities.navigation.base import NavInputs
from golem.errors import ModuleFault
from golem.interfaces.nav_payloads import NavStep
from golem.runtime.checked import CheckedGraspMethod, CheckedNavigator
from golem.runtime.contract_check import ContractCheck
from golem.types import Array, Detection, LocalizedObject, PlanarPose, Twist

TARGET = LocalizedObject(Detection("screw", 0.9, np.zeros(4), np.zeros(2)), 0.0, np.zeros(3), np.zeros((0, 3)))
NO_SCENE = np.zeros((0, 3))
GRIPPER = Gripper("right", np.eye(4), yaw=0.0)
SHEARED = np.eye(4) + 0.1 * np.eye(4, k=1)


class Scripted(OpenLoop):
    """Proposes one grasp, and follows it with a law that says the same."""

    label = "screw"
    patience = 20.0
    latency = 0.0

    def __init__(self, T: Array) -> None:
        self._T = T

    def propose(self, target: LocalizedObject, scene: Array, gripper: Gripper) -> list[Grasp]:
        return [Grasp(self._T, 0.05, 1.0)]

    def servo(self, target: LocalizedObject, grasp: Grasp, t: float) -> Scripted:  # pyright: ignore
        return self

    def step(self, t: float, sightings: list[LocalizedObject] | None, T_odom_gripper: Array) -> ServoStep:
        return ServoStep(self._T, np.zeros(3), 0.0, ServoStatus.TRACKING)


def guarded(T: Array) -> CheckedGraspMethod:
    return CheckedGraspMethod(Scripted(T), ContractCheck("grasp_method", "mine.py:Mine"))


def test_a_sound_pose_passes() -> None:
    method = guarded(np.eye(4))
    (grasp,) = method.propose(TARGET, NO_SCENE, GRIPPER)
    law = method.servo(TARGET, grasp, 0.0)
    assert law is not None
    assert law.step(0.0, None, np.eye(4)).status is ServoStatus.TRACKING


def test_a_pose_that_is_no_rigid_transform_is_the_methods_fault() -> None:
    with pytest.raises(ModuleFault, match="grasp_method: mine.py:Mine failed: .*not a rigid transform"):
        guarded(SHEARED).propose(TARGET, NO_SCENE, GRIPPER)


def test_a_step_to_such_a_pose_is_the_methods_fault() -> None:
    law = guarded(SHEARED).servo(TARGET, Grasp(np.eye(4), 0.05, 1.0), 0.0)
    assert law is not None
    with pytest.raises(ModuleFault, match="grasp_method: mine.py:Mine failed: .*not a rigid transform"):
        law.step(0.0, None, np.eye(4))


HERE = PlanarPose(0.0, 0.0, 0.0)


class Lost:
    """A navigator that always says the same."""

    rate, latency = 10.0, 0.0

    def __init__(self, course: object) -> None:
        self._course = course

    def start(self, goal: PlanarPose) -> None:
        if goal.x < 0.0:
            raise ValueError("behind me")

    def step(self, inputs: NavInputs, dt: float) -> NavStep:
        return self._course  # pyright: ignore


def navigator(course: object) -> CheckedNavigator:
    return CheckedNavigator(Lost(course), ContractCheck("navigator", "mine.py:Mine"))


def test_a_sound_course_passes() -> None:
    course = NavStep(Twist(0.3), False, HERE)
    assert navigator(course).step(NavInputs(HERE, False), 0.01) is course


@pytest.mark.parametrize(
    ("course", "reason"),
    [
        (None, "the step is a NoneType"),
        (NavStep(Twist(0.1, float("nan")), False, HERE), "vy is nan"),
        (NavStep(0.5, False, HERE), "twist is a float"),  # pyright: ignore
        (NavStep(Twist(), 1, HERE), "arrived is a int"),  # pyright: ignore
        (NavStep(Twist(), False, None), "left is a NoneType"),  # pyright: ignore
        (NavStep(Twist(), False, PlanarPose(0.0, float("inf"), 0.0)), "left.y is inf"),
        (NavStep(Twist(), False, HERE, 3), "failure is a int"),  # pyright: ignore
    ],
)
def test_a_course_that_is_none_is_the_navigators_fault(course: object, reason: str) -> None:
    with pytest.raises(ModuleFault, match=f"navigator: mine.py:Mine failed: {reason}"):
        navigator(course).step(NavInputs(HERE, False), 0.01)


def test_what_a_navigator_raises_is_its_fault() -> None:
    with pytest.raises(ModuleFault, match="navigator: mine.py:Mine failed: ValueError: behind me"):
        navigator(None).start(PlanarPose(-1.0, 0.0, 0.0))
