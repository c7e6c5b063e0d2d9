"""What a skill works with: its legs, its two arms and hands, its eyes, its clock, a place to speak."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Literal, TypeVar

import numpy as np

from golem.capabilities.arms.base import check_pose
from golem.capabilities.arms.line import Line
from golem.capabilities.grasping.base import Grasp, GraspMethod, Gripper
from golem.capabilities.memory.base import Memory
from golem.capabilities.perception.lift import scene_of
from golem.capabilities.planning.base import ArmPlanner
from golem.capabilities.properties.base import Properties, PropertySource
from golem.interfaces import topics
from golem.interfaces.payloads import Feedback
from golem.middleware.bus import Bus, Topic
from golem.robots.model.pinocchio_model import Kinematics
from golem.skills.base import Skill, SkillResult, StageFailed, Tick, expect
from golem.skills.body_interface import HandInterface, LegsInterface, Navigation, follow
from golem.skills.detection_stream import DetectionStream
from golem.skills.pursuit import call
from golem.types import SIDES, UPPER, Array, LocalizedObject, PalmTargets, PlanarPose, Side

T = TypeVar("T")


@dataclass(frozen=True)
class Modules:
    """What a skill may have of its stack's modules, each guarded.

    Attributes:
        grasp_method: makes a new one.
        skill: makes a new skill, by its name in the stack.
        planner: the planner, made when it is first asked for.
        memory: where things are and were.
        properties: what things are like, by their names.
        worker: where slow modules think; None is on the clock, at the price of the latency that they declare.
    """

    grasp_method: Callable[[], GraspMethod]
    skill: Callable[[str], Skill[Context, Any]]
    planner: Callable[[], ArmPlanner]
    memory: Memory
    properties: PropertySource
    worker: Executor | None = None


class Arm:
    """One arm: a commanded gripper pose in odom, moved along lines or towards a moving goal."""

    def __init__(self, context: Context, side: Side) -> None:
        self._context = context
        self._side: Side = side
        self._commanded: Array | None = None
        self._velocity: Array = np.zeros(3)

    @property
    def pose(self) -> Array:
        """(4, 4) pose of the gripper in odom, by the measured joints and the base estimate."""
        return self._context.T_odom_base @ self._context.kinematics.pose(f"{self._side}_gripper")

    @property
    def commanded(self) -> Array:
        """(4, 4) pose in odom the arm is being sent to."""
        return self.pose if self._commanded is None else self._commanded

    @property
    def sent(self) -> bool:
        """Whether the arm is being sent anywhere."""
        return self._commanded is not None

    def stays_at(self, T: Array) -> None:
        """Take `T` (4, 4), in odom, for where the arm was sent: a trajectory has brought it there."""
        self._commanded, self._velocity = T, np.zeros(3)

    def forget(self) -> None:
        """Forget where the arm was sent."""
        self._commanded, self._velocity = None, np.zeros(3)

    async def move(
        self, T_goal: Array, v_max: float, w_max: float = 1.5, stop: Callable[[], bool] = lambda: False
    ) -> None:
        """Go straight to `T_goal` (4, 4) in odom, at `v_max` [m/s] and `w_max` [rad/s]; end once `stop()` is true."""
        self._velocity = np.zeros(3)
        line = Line(self.commanded, T_goal, v_max, w_max)
        start = self._context.t
        while not stop():
            self._send(line.pose(self._context.t - start))
            if self._context.t - start >= line.duration:
                break
            await self._context.tick()

    def approach(self, T_goal: Array, v_max: float, a_max: float = 0.6) -> None:
        """Go one tick further towards a goal that may move: critically damped, bounded in speed and acceleration.

        Args:
            T_goal: (4, 4) goal in odom; its orientation is taken over at once, so it should not jump.
            v_max: speed [m/s].
            a_max: acceleration [m/s^2].
        """
        dt = self._context.period
        T = self.commanded.copy()
        error = T_goal[:3, 3] - T[:3, 3]
        distance = float(np.linalg.norm(error))
        # Half of a_max stops from sqrt(a_max d) within d; the other half is left to turn towards a moving goal. The
        # last bound makes the end exponential, with a time constant of three ticks.
        speed = min(v_max, float(np.sqrt(a_max * distance)), distance / (3.0 * dt))
        wanted = error * (speed / distance) if distance > 1e-9 else np.zeros(3)
        change = wanted - self._velocity
        size = float(np.linalg.norm(change))
        self._velocity = self._velocity + change * min(1.0, a_max * dt / size) if size > 1e-12 else wanted
        T[:3, :3] = T_goal[:3, :3]
        T[:3, 3] += self._velocity * dt
        self._send(T)

    async def settle(self, tolerance: float, timeout: float) -> float:
        """Wait until the gripper is within `tolerance` [m] of its goal, or `timeout` [s]; return what is left [m]."""
        end = self._context.t + timeout
        while True:
            left = float(np.linalg.norm(self.pose[:3, 3] - self.commanded[:3, 3]))
            if left < tolerance or self._context.t >= end:
                return left
            await self._context.tick()

    def _send(self, T: Array) -> None:
        self._commanded = check_pose(f"The pose the {self._side} arm is sent to", T)
        self._context.send_palms()


class Context:
    """The world as a skill sees it.

    Attributes:
        bus: where everything is read from.
        modules: what there is of the stack's modules.
        kinematics: forward kinematics of the nominal model at the newest measured joints.
        period: time between two ticks of the skill [s].
        t: present time [s].
        legs: the lower body.
        arms, hands: by side.
        torso: angle that the waist is to have with the next palm targets [rad]; None is the controller's own.
        skill: name of the running skill, for its feedback.
    """

    def __init__(self, bus: Bus, kinematics: Kinematics, period: float, modules: Modules) -> None:
        """Work over `bus` and with `modules`, with forward kinematics and the skill period [s] given."""
        self.bus = bus
        self.modules = modules
        self.kinematics = kinematics
        self.period = period
        self.t = 0.0
        self.skill = ""
        self.torso: float | None = None
        self._checks: list[Callable[[], None]] = []
        self.legs = LegsInterface(self)
        self.arms: dict[Side, Arm] = {"left": Arm(self, "left"), "right": Arm(self, "right")}
        self.hands: dict[Side, HandInterface] = {side: HandInterface(self, side) for side in SIDES}

    def refresh(self, t: float) -> None:
        """Take over time and measured joints; the runner calls it before it resumes the skill."""
        self.t = t
        state = self.bus.latest(topics.LOW_STATE)
        if state is not None:
            self.kinematics.update(state.q)

    @property
    def T_odom_base(self) -> Array:
        """(4, 4) estimated pose of base_link in odom."""
        base = self.bus.latest(topics.BASE)
        return np.eye(4) if base is None else base.T_odom_base

    @property
    def heading(self) -> float:
        """Heading of base_link in odom [rad]."""
        return PlanarPose.of(self.T_odom_base).yaw

    @property
    def mapped(self) -> bool:
        """Whether there is a map, and the robot's place in it is known."""
        return self.bus.latest(topics.MAP) is not None and self.bus.latest(topics.MAP_POSE) is not None

    @property
    def T_odom_map(self) -> PlanarPose:
        """Where the frame of the map is in odom. Raises StageFailed: nobody says."""
        place = self.bus.latest(topics.MAP_POSE)
        if place is None:
            raise StageFailed("navigate", "mapper", "The robot's place in the map is not known.")
        return place.T_odom_map

    @property
    def T_odom_estimate(self) -> PlanarPose:
        """Where odom of the base estimate, which hands and cameras go by, is in odom of the odometry, which legs go by.

        They drift apart. Far from the robot it is as uncertain as both headings. Raises StageFailed: one is silent.
        """
        return PlanarPose.of(self.legs.pose) @ PlanarPose.of(self.T_odom_base).to(PlanarPose(0.0, 0.0, 0.0))

    @property
    def T_odom_memory(self) -> PlanarPose:
        """Where the frame of what is remembered is in odom of the odometry: the map's, or that of the base estimate.

        Raises StageFailed: it is the map's, and nobody says where that is.
        """
        status = self.bus.latest(topics.MEMORY_STATUS)
        in_map = self.mapped if status is None else status.frame == "map"
        return self.T_odom_map if in_map else self.T_odom_estimate

    @property
    def joints(self) -> Array:
        """(15,) measured joints of torso, left arm, right arm [rad]. Raises StageFailed: the motors do not report."""
        state = self.bus.latest(topics.LOW_STATE)
        if state is None:
            raise StageFailed("move", "robot", "The motors do not report.")
        return state.q[UPPER]

    @property
    def commanded_joints(self) -> Array:
        """(15,) joints of torso, left arm, right arm that the motors are being sent to [rad].

        Raises StageFailed: the motors do not report.
        """
        command = self.bus.latest(topics.ARM_COMMAND)
        return self.joints if command is None else command.q

    def publish(self, topic: Topic[T], value: T) -> None:
        """Send `value` on `topic` now."""
        self.bus.publish(topic, value, self.t)

    def send_palms(self) -> None:
        """Publish where both arms are being sent; an arm that was never moved keeps its posture."""
        left, right = (self.arms[side]._commanded for side in ("left", "right"))
        self.publish(topics.PALM_TARGETS, PalmTargets(self.t, left, right, self.torso))

    async def follow(self, times: Array, q: Array, dq: Array | None = None) -> float:
        """Move torso and arms along a timed joint trajectory; they stay where it ends.

        It begins as soon as the safety gate lets commands through: at the next tick, and a little later when the
        episode has only just begun. Cancelled on the way, the arms stay where they are.

        Args:
            times: (n,) times of its points after its beginning [s], increasing. A first time of 0 asks for a first
                point where the arms are; a later one lets them get there in a straight line.
            q: (n, 15) torso, left arm, right arm [rad]; `joints` has where they are.
            dq: (n, 15) velocities there [rad/s]; None goes straight from point to point.

        Returns:
            The largest distance of a measured joint from the last point at its time [rad].

        Raises:
            TargetError: the arms cannot follow it; nothing has moved.
            StageFailed: the motors do not report, or the safety gate stays shut.
        """
        return await follow(self, times, q, dq)

    def release_arms(self) -> None:
        """Forget where the arms were sent: they keep their posture, and the next motion starts from where they are."""
        if self.arms["left"].sent or self.arms["right"].sent:
            self.torso = None
            for arm in self.arms.values():
                arm.forget()
            self.send_palms()

    def grasp_method(self) -> GraspMethod:
        """Return a new grasp method, the one that the stack chose."""
        return self.modules.grasp_method()

    async def propose(
        self,
        method: GraspMethod,
        target: LocalizedObject,
        side: Side,
        yaw: float,
        approach: tuple[float, float, float] = (0.0, 0.0, -1.0),
        scene: Array | None = None,
    ) -> list[Grasp]:
        """Return the grasps that `method` proposes for `target`, best first, once it has thought.

        Args:
            yaw: heading of the gripper's x axis about the vertical that suits the arm best, in odom [rad].
            approach: direction in odom along which the hand is to come, of unit length.
            scene: (n, 3) points in odom of what is around [m]; by default what the head camera shows.
        """
        state = self.bus.latest(topics.LOW_STATE)
        q = None if state is None else state.q[UPPER]
        gripper = Gripper(side, self.arms[side].pose, yaw, np.array(approach), q, self.T_odom_base)
        around = self.scene("head") if scene is None else scene
        return await self.think(lambda: method.propose(target, around, gripper), method.latency)

    async def properties(self, label: str) -> Properties:
        """Return what a thing of class `label` is like, as the stack's source of properties has it.

        Raises ConfigError: it knows nothing of that name.
        """
        source = self.modules.properties
        return await self.think(lambda: source.properties(label), source.latency)

    def scene(self, camera: str) -> Array:
        """Return the (n, 3) points in odom that the newest frame of `camera` shows [m]; n is 0 before the first."""
        frame = self.bus.latest(topics.rgbd_images(camera))
        return np.zeros((0, 3)) if frame is None else scene_of(frame)

    async def think(self, function: Callable[[], T], latency: float) -> T:
        """Return what `function()` does: after `latency` [s] of robot time, or, live, when the worker is done."""
        if self.modules.worker is None:
            result = function()
            await self.sleep(latency)
            return result
        job = self.modules.worker.submit(function)
        while not job.done():
            await self.tick()
        return job.result()

    def navigate(self, goal: PlanarPose, frame: Literal["odom", "map"] = "odom") -> Navigation:
        """Let the stack's navigator bring base_link to `goal`, in `frame`, while what is returned is open."""
        return Navigation(self, goal, frame)

    async def run(self, name: str, goal: object, timeout: float | None = None) -> SkillResult:
        """Pursue `goal` with another skill of the stack, and return how that ended; its feedback is heard as its own.

        Cancelled meanwhile, it cancels that skill, gives it the time to leave the robot safe, and lets `SkillCancelled`
        pass, however that skill then ended. Raises ConfigError: there is no such skill, or the goal is none of it.

        Args:
            goal: of its kind, or its fields by name, as `{"times": 2}`.
            timeout: robot time after which it is cancelled [s]; by default what the skill itself allows.
        """
        return await call(self, name, goal, timeout)

    def say(self, stage: str, text: str, **data: object) -> None:
        """Give feedback: the stage, one line for a person, and numbers for a viewer."""
        expect("stage of the feedback", stage, str)
        expect("text of the feedback", text, str)
        self.publish(topics.FEEDBACK, Feedback(self.t, self.skill, stage, text, dict(data)))

    async def tick(self) -> None:
        """Give the tick back until the skill's next period."""
        await Tick()
        for check in self._checks:
            check()

    @contextmanager
    def minding(self, check: Callable[[], None]) -> Iterator[None]:
        """Call `check()` at every tick meanwhile, also of skills that this one runs; what it raises ends them."""
        self._checks.append(check)
        try:
            yield
        finally:
            self._checks.remove(check)

    async def sleep(self, seconds: float) -> None:
        """Let `seconds` of robot time pass."""
        end = self.t + seconds
        while self.t < end:
            await self.tick()

    async def until(self, condition: Callable[[], bool], timeout: float) -> bool:
        """Wait until `condition()` is true; returns False when `timeout` [s] passed first."""
        end = self.t + timeout
        while not condition():
            if self.t >= end:
                return False
            await self.tick()
        return True

    def watch(self, camera: str, *labels: str, doubtful: tuple[str, ...] = ()) -> DetectionStream:
        """Let a camera stream what it sees of `labels`, for as long as the returned `DetectionStream` is open.

        Of the `doubtful` ones of them unsure sightings are passed on, too, since the caller can tell.
        """
        return DetectionStream(self, camera, labels, doubtful)
