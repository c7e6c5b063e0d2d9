"""Modules that skills call, behind a guard: a user's may raise or return nonsense, and the fault carries its name."""

from __future__ import annotations

from golem.capabilities.arms.base import check_pose
from golem.capabilities.navigation.base import Course, Navigator
from golem.runtime.guard import Guard
from golem.skills.grasping.base import Grasp, GraspMethod, ServoLaw, ServoStatus, ServoStep
from golem.types import Array, LocalizedObject, PlanarPose, Twist


class GuardedMethod:
    """A `GraspMethod` whose faults name the module."""

    def __init__(self, method: GraspMethod, guard: Guard) -> None:
        """Watch `method`."""
        self._method, self._guard = method, guard

    def propose(self, target: LocalizedObject, yaw: float) -> list[Grasp]:
        """Return the method's grasps; see `GraspMethod`."""
        grasps = self._guard.call(lambda: list(self._method.propose(target, yaw)))
        for grasp in grasps:
            self._guard.kind("a proposal", grasp, Grasp)
            self._guard.array("T_odom_gripper", grasp.T_odom_gripper, 4, 4)
            self._guard.call(check_pose, "T_odom_gripper", grasp.T_odom_gripper)
            self._guard.number("gap", grasp.gap, least=0.0)
        return grasps

    def servo(self, target: LocalizedObject, grasp: Grasp, t: float) -> ServoLaw | None:
        """Return the method's law, guarded; see `GraspMethod`."""
        law = self._guard.call(self._method.servo, target, grasp, t)
        if law is None:
            return None
        self._guard.satisfies(law, ServoLaw)
        return GuardedLaw(law, self._guard)


class GuardedLaw:
    """A `ServoLaw` whose faults name the module."""

    def __init__(self, law: ServoLaw, guard: Guard) -> None:
        """Watch `law`."""
        self._law, self._guard = law, guard
        self.label = law.label

    def step(self, t: float, sightings: list[LocalizedObject] | None, T_odom_gripper: Array) -> ServoStep:
        """Return the law's step; see `ServoLaw`."""
        step = self._guard.call(self._law.step, t, sightings, T_odom_gripper)
        self._guard.kind("the servo step", step, ServoStep)
        self._guard.kind("status", step.status, ServoStatus)
        self._guard.array("T_odom_gripper", step.T_odom_gripper, 4, 4)
        self._guard.call(check_pose, "T_odom_gripper", step.T_odom_gripper)
        self._guard.array("target", step.target, 3)
        self._guard.number("sigma", step.sigma, least=0.0)
        return step


class GuardedNavigator:
    """A `Navigator` whose faults name the module."""

    def __init__(self, navigator: Navigator, guard: Guard) -> None:
        """Watch `navigator`."""
        self._navigator, self._guard = navigator, guard

    def start(self, goal: PlanarPose) -> None:
        """Give the navigator its goal; see `Navigator`."""
        self._guard.call(self._navigator.start, goal)

    def step(self, pose: PlanarPose, moving: bool, dt: float) -> Course:
        """Return the navigator's course; see `Navigator`."""
        course = self._guard.call(self._navigator.step, pose, moving, dt)
        self._guard.kind("the course", course, Course)
        self._guard.kind("twist", course.twist, Twist)
        for name in ("vx", "vy", "wz"):
            self._guard.number(name, getattr(course.twist, name))
        self._guard.kind("arrived", course.arrived, bool)
        self._guard.kind("left", course.left, PlanarPose)
        return course
