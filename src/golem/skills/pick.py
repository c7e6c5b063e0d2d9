"""Pick: find an object, bring a hand over it, grasp it, pull it straight out and drop it in a container."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from golem.capabilities.grasping.base import Grasp, GraspMethod, ServoLaw, ServoStatus
from golem.errors import ConfigError
from golem.interfaces.payloads import Detections, GripState
from golem.skills.base import SkillCancelled, SkillResult, StageFailed
from golem.skills.context import Context
from golem.skills.poses import lifted, retracted
from golem.skills.travel import LineTravel, PlannedTravel, Travel
from golem.types import SIDES, Array, LocalizedObject, Side

Hand = Literal["left", "right", "either"]
CLOSED = (GripState.HOLDING, GripState.EMPTY)
"""States of a hand whose fingers have closed, on something or on nothing."""


@dataclass(frozen=True)
class PickGoal:
    """What to pick.

    Attributes:
        label: class of the object.
        container: class of what it is dropped into.
        side: which hand; `either` takes the one that reaches the object and the container.
    """

    label: str = "screw"
    container: str = "tray"
    side: Hand = "right"

    def __post_init__(self) -> None:
        """Check that there is something to look for.

        Raises:
            ConfigError: a class is empty.
        """
        if not (self.label and self.container):
            raise ConfigError("A pick names the class of the object and that of its container.")


@dataclass(frozen=True)
class PickConfig:
    """Distances, speeds and forces.

    Attributes:
        workspace: x_min, x_max, y_min, y_max, z_min, z_max within which an object must lie to be picked, in base_link
            [m], for the right arm (y is mirrored for the left). The paper's box (x <= 0.60, |y| <= 0.45, -0.05 <= z
            <= 0.60) but for z, which reaches 0.10 m deeper.
        yaw: heading of the gripper's x axis when it points down [rad], right arm; mirrored for the left.
        container_radius: objects nearer than this to the container's middle lie in it and are left there [m].
        comfort: x, y in base_link around which the arm works best [m]; the nearest object is taken first.
        attempts: how often a method that looks again may try to grasp and pull one object.
        candidates: how many objects it may try.
        travel: `planned` goes around what the head camera shows, in postures from which the way down is straight;
            `lines` goes up, across and down, blind to what is in the way.
        clearance: height of the gripper above the object when it arrives and when it leaves [m].
        travel_height: minimum height of the gripper when it moves across, in odom [m]; clears the tray's walls.
        travel_speed: between places [m/s].
        descend_speed: straight down to an open-loop grasp [m/s].
        servo_speed: limit of the visual servo [m/s].
        servo_timeout: time after which the servo is given up [s].
        force: force of each finger [N].
        close_timeout: time the fingers may take [s].
        pull: length of the straight extraction [m]; longer than any screw.
        pull_speed: how fast [m/s].
        tolerance: distance from a commanded pose at which the arm counts as arrived [m].
        drop_height: height of the fingertips above the container's floor when they open [m].
        release_gap: opening that lets go [m].
        look_timeout: time a camera may take to show the object [s].
        timeout: time after which the pick is given up [s]; the paper's grasps took 75 +- 16 s by the clock.
    """

    workspace: tuple[float, float, float, float, float, float] = (0.30, 0.60, -0.30, 0.10, -0.15, 0.60)
    yaw: float = -1.5707963267948966
    container_radius: float = 0.15
    comfort: tuple[float, float] = (0.45, -0.12)
    attempts: int = 2
    candidates: int = 3
    travel: Literal["lines", "planned"] = "lines"
    clearance: float = 0.15
    travel_height: float = 0.08
    travel_speed: float = 0.25
    descend_speed: float = 0.10
    servo_speed: float = 0.15
    servo_timeout: float = 20.0
    force: float = 16.0
    close_timeout: float = 2.5
    pull: float = 0.06
    pull_speed: float = 0.05
    tolerance: float = 0.006
    drop_height: float = 0.10
    release_gap: float = 0.060
    look_timeout: float = 3.0
    timeout: float = 90.0


@dataclass(frozen=True, slots=True)
class _Attempt:
    """An object to take, where to, and with which hand."""

    label: str
    container: str
    side: Side
    target: LocalizedObject


class Pick:
    """Find an object, grasp it, pull it straight out and drop it in a container."""

    Goal = PickGoal

    def __init__(self, config: PickConfig | None = None) -> None:
        """Take distances, speeds and forces from `config`."""
        self._config = config or PickConfig()
        self._method: GraspMethod
        self._travel: Travel
        self._looks_again = False

    def timeout(self, goal: PickGoal) -> float:
        """Return the time it may take [s]; see `Skill`."""
        return self._config.timeout

    async def run(self, context: Context, goal: PickGoal) -> SkillResult:
        """Pick one object with whatever grasp method the stack chose; see `Skill`."""
        self._method = context.grasp_method()
        lines = LineTravel(context, self._config.travel_height, self._config.tolerance)
        planned = self._config.travel == "planned"
        self._travel = PlannedTravel(context, lines, self._config.tolerance) if planned else lines
        try:
            return await self._pursue(context, goal)
        except SkillCancelled:
            # Stay where we are; what is held stays held.
            context.say("cancelled", "Stopped where it was.")
            raise

    async def _pursue(self, context: Context, goal: PickGoal) -> SkillResult:
        """Go through the stages, and home, whether they succeeded or not."""
        timings: dict[str, float] = {"start": context.t}
        tried: list[_Attempt] = []
        reason = f"The {goal.label} was dropped in the {goal.container}."
        result = SkillResult(True, "done", None, reason, timings)
        try:
            attempts, container = await self._detect(context, goal)
            attempt = await self._take_one(context, attempts, timings, tried)
            await self._place(context, attempt, container)
        except StageFailed as failure:
            context.say(failure.stage, str(failure), failed=True)
            result = SkillResult(False, failure.stage, failure.slot, str(failure), timings)
            for side in _hands(goal, tried):
                context.hands[side].open(self._config.release_gap)
        timings["total"] = context.t - timings.pop("start")
        for side in _hands(goal, tried):
            await self._travel.home(side, self._config.travel_speed)
        if result.success:
            context.say("done", f"The {goal.label} is in the {goal.container}.")
        return result

    async def _take_one(
        self, context: Context, attempts: list[_Attempt], timings: dict[str, float], tried: list[_Attempt]
    ) -> _Attempt:
        """Take the first object that comes out; `tried` gets each one that was approached.

        A screw that is tight or jammed is left for the next one. An open-loop method has no next one: the error that
        made it miss, that of the head camera, is the same everywhere.
        """
        while True:
            attempt = attempts[len(tried)]
            tried.append(attempt)
            try:
                grasp = await self._approach(context, attempt)
                await self._take(context, attempt, grasp, timings)
                return attempt
            except StageFailed as failure:
                if not self._looks_again or len(tried) == len(attempts):
                    raise
                context.say(failure.stage, f"{failure} Leaving it for the next {attempt.label}.")
                context.hands[attempt.side].open(self._config.release_gap)
                await self._back_off(context, attempt.side)

    async def _detect(self, context: Context, goal: PickGoal) -> tuple[list[_Attempt], LocalizedObject]:
        """Look once with the head camera: the reachable objects, the most comfortable first, and the container."""
        context.say("detect", f"Looking for a {goal.label} and a {goal.container}.")
        sides: tuple[Side, ...] = SIDES if goal.side == "either" else (goal.side,)
        with context.watch("head", goal.label, goal.container) as eye:
            end = context.t + self._config.look_timeout
            problem = "The head camera gave no detections in time."
            while True:
                sightings = await eye.look(end - context.t)
                if sightings is None:
                    raise StageFailed("detect", "localizer", problem)
                containers = [o for o in sightings.objects if o.label == goal.container]
                container = max(containers, key=lambda o: o.detection.score, default=None)
                attempts = [
                    _Attempt(goal.label, goal.container, side, o)
                    for side in sides
                    for o in self._reachable(context, goal, side, sightings, container)
                ]
                if attempts and container is not None:
                    break
                missing = goal.container if attempts else f"reachable {goal.label}"
                problem = f"The head camera shows no {missing}."
        if goal.side == "either":
            attempts = [a for a in attempts if self._serves(context, a.side, container)] or attempts
        attempts.sort(key=lambda a: self._discomfort(context, a.side, a.target))
        chosen = attempts[: self._config.candidates]
        self._travel.look([attempt.target.position for attempt in chosen])
        text = f"{len(attempts)} {goal.label}s in reach."
        context.say("detect", text, target=chosen[0].target.position.tolist())
        return chosen, container

    def _reachable(
        self,
        context: Context,
        goal: PickGoal,
        side: Side,
        sightings: Detections,
        container: LocalizedObject | None,
    ) -> list[LocalizedObject]:
        """Return the objects within the workspace of a hand, without those that lie in the container already."""
        x0, x1, y0, y1, z0, z1 = self._config.workspace

        def wanted(o: LocalizedObject) -> bool:
            if o.label != goal.label:
                return False
            if container is not None:
                apart = np.hypot(*(o.position - container.position)[:2])
                if apart < self._config.container_radius:
                    return False
            x, y, z = _in_base(context, side, o.position)
            return x0 <= x <= x1 and y0 <= y <= y1 and z0 <= z <= z1

        return [o for o in sightings.objects if wanted(o)]

    def _serves(self, context: Context, side: Side, container: LocalizedObject) -> bool:
        """Return whether a hand need not reach across the body to the container."""
        return bool(_in_base(context, side, container.position)[1] <= self._config.workspace[3])

    def _discomfort(self, context: Context, side: Side, o: LocalizedObject) -> float:
        x, y, _ = _in_base(context, side, o.position)
        return float(np.hypot(x - self._config.comfort[0], y - self._config.comfort[1]))

    async def _approach(self, context: Context, attempt: _Attempt) -> Grasp:
        """Bring the open hand over the object."""
        yaw = self._config.yaw if attempt.side == "right" else -self._config.yaw
        grasps = await context.propose(self._method, attempt.target, attempt.side, yaw)
        if not grasps:
            raise StageFailed("approach", "grasp_method", f"No grasp was proposed for the {attempt.label}.")
        grasp = grasps[0]
        context.say("approach", "Bringing the hand over it.", target=grasp.T_odom_gripper[:3, 3].tolist())
        context.hands[attempt.side].open(grasp.gap)
        T = grasp.T_odom_gripper
        await self._travel.over(attempt.side, lifted(T, self._config.clearance), T, self._config.travel_speed)
        return grasp

    async def _take(
        self,
        context: Context,
        attempt: _Attempt,
        grasp: Grasp,
        timings: dict[str, float],
    ) -> None:
        """Grasp and pull out. A method that looks again may try again; an open-loop one would only repeat itself."""
        for count in range(1, self._config.attempts + 1):
            law = self._method.servo(attempt.target, grasp, context.t)
            self._looks_again = law is not None
            try:
                if law is None:
                    await self._descend(context, attempt, grasp)
                else:
                    await self._servo(context, attempt, law)
                timings["detect_to_grasp"] = context.t - timings["start"]
                await self._extract(context, attempt)
                return
            except StageFailed as failure:
                if law is None or count == self._config.attempts:
                    raise
                context.say(failure.stage, f"{failure} Trying again.")
                context.hands[attempt.side].open(grasp.gap)
                await self._back_off(context, attempt.side)
                above = lifted(grasp.T_odom_gripper, self._config.clearance)
                await self._travel.line(attempt.side, above, self._config.travel_speed, failure.stage)

    async def _descend(self, context: Context, attempt: _Attempt, grasp: Grasp) -> None:
        """Open loop: go straight down to the grasp as proposed, and close."""
        arm = context.arms[attempt.side]
        context.say("descend", "Straight down to the proposed grasp.")
        await self._travel.line(attempt.side, grasp.T_odom_gripper, self._config.descend_speed, "descend")
        left = await arm.settle(self._config.tolerance, 2.0)
        if left > 2.0 * self._config.tolerance:
            raise StageFailed(
                "descend", "localizer", f"The hand was stopped {left * 1e3:.0f} mm before the grasp."
            )
        self._close(context, attempt)
        hand = context.hands[attempt.side]
        await context.until(lambda: hand.status.state in CLOSED, self._config.close_timeout)
        self._check_grip(context, attempt)

    async def _servo(self, context: Context, attempt: _Attempt, law: ServoLaw) -> None:
        """Closed loop: let the law bring the hand down, and let it follow the object while the fingers close."""
        arm, hand = context.arms[attempt.side], context.hands[attempt.side]
        end = context.t + self._config.servo_timeout
        closing = False
        with context.watch(f"{attempt.side}_hand", attempt.label) as eye:
            while context.t < end and not (closing and hand.status.state in CLOSED):
                fresh = eye.fresh()
                step = law.step(context.t, None if fresh is None else list(fresh.objects), arm.pose)
                if not closing:
                    if fresh is not None:
                        text = f"Servoing, sigma {step.sigma * 1e3:.1f} mm."
                        context.say("servo", text, target=step.target.tolist())
                    if step.status is ServoStatus.CONVERGED:
                        closing = True
                        end = context.t + self._config.close_timeout
                        self._close(context, attempt)
                    elif step.status is ServoStatus.LOST:
                        raise StageFailed("servo", "localizer", f"The palm camera lost the {attempt.label}.")
                    elif step.status is ServoStatus.STALLED:
                        raise StageFailed(
                            "servo", "upper_body", "The hand makes no progress towards the target."
                        )
                if not closing or hand.status.state is GripState.CLOSING:
                    arm.approach(step.T_odom_gripper, self._config.servo_speed)
                await context.tick()
        if not closing:
            raise StageFailed(
                "servo", "grasp_method", f"No convergence within {self._config.servo_timeout:g} s."
            )
        self._check_grip(context, attempt)

    def _close(self, context: Context, attempt: _Attempt) -> None:
        context.say("grasp", f"Closing with {self._config.force:g} N per finger.", side=attempt.side)
        context.hands[attempt.side].close(self._config.force)

    def _check_grip(self, context: Context, attempt: _Attempt) -> None:
        """Check that something is between the fingers."""
        status = context.hands[attempt.side].status
        if not status.holding:
            raise StageFailed(
                "grasp", "grasp_method", f"The fingers hold nothing (gap {status.gap * 1e3:.0f} mm)."
            )

    async def _extract(self, context: Context, attempt: _Attempt) -> None:
        """Pull straight out against the approach direction, then lift; the grip must hold."""
        arm, hand = context.arms[attempt.side], context.hands[attempt.side]
        # Off centre, one finger leans on its stop and the other pushes the object against its bore.
        centred = arm.commanded.copy()
        centred[:3, 3] += hand.status.offset * centred[:3, 1]
        await arm.move(centred, self._config.pull_speed)
        context.say("extract", "Pulling straight out.")
        await self._travel.line(
            attempt.side,
            retracted(arm.commanded, self._config.pull),
            self._config.pull_speed,
            "extract",
            stop=lambda: not hand.status.holding,
        )
        await arm.move(
            lifted(arm.commanded, self._config.clearance - self._config.pull),
            self._config.travel_speed,
            stop=lambda: not hand.status.holding,
        )
        if not hand.status.holding:
            raise StageFailed("extract", "grasp_method", f"The {attempt.label} slipped out of the fingers.")

    async def _place(self, context: Context, attempt: _Attempt, container: LocalizedObject) -> None:
        """Carry it over the container and let go."""
        context.say("place", f"Carrying it to the {attempt.container}.", target=container.position.tolist())
        arm, hand = context.arms[attempt.side], context.hands[attempt.side]
        T = arm.commanded.copy()
        T[:3, 3] = container.position + (0.0, 0.0, self._config.drop_height)
        await self._travel.carry(attempt.side, T, self._config.travel_speed)
        if not hand.status.holding:
            raise StageFailed("place", "grasp_method", f"The {attempt.label} was lost on the way.")
        hand.open(self._config.release_gap)
        await context.until(lambda: hand.status.state is GripState.OPEN, 2.0)

    async def _back_off(self, context: Context, side: Side) -> None:
        """Go straight up, away from what was not taken, with the fingers open."""
        arm = context.arms[side]
        await arm.move(lifted(arm.commanded, self._config.clearance), self._config.travel_speed)


def _hands(goal: PickGoal, tried: Sequence[_Attempt]) -> list[Side]:
    """Return the hand of the goal, or those of the attempts, each once."""
    return list(dict.fromkeys(attempt.side for attempt in tried)) if goal.side == "either" else [goal.side]


def _in_base(context: Context, side: Side, position: Array) -> Array:
    """Return (3,) `position` in base_link [m], mirrored for the left hand as if it were the right."""
    T = context.T_odom_base
    p = T[:3, :3].T @ (position - T[:3, 3])
    return p if side == "right" else p * (1.0, -1.0, 1.0)
