"""Moves the robot as a pilot wants: arms, hands, legs and waist, as far as they and the gate let it."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import pinocchio as pin

from golem.capabilities.arms.steps import led
from golem.interfaces import topics
from golem.robots.model.magpie_model import MAX_GAP
from golem.skills.base import SkillCancelled, SkillResult
from golem.skills.context import Context
from golem.skills.served_policy import FORCE
from golem.teleop.pilot import HandPilot, Wish
from golem.types import SIDES, Array, PlanarPose, Side, Twist

LEAD, FAR, SHORT = 0.10, 0.6, 0.02
"""How far a target that is moved by rates may run ahead of the hand, distance of a dragged goal from which on it is
refused, and of a target that an arm is said not to reach [m] [own]."""
SPEED, ACCELERATION = 0.25, 5.0
"""Of a palm target on its way [m/s], [m/s^2] [own]: it is v / a behind, 30 ms at the fastest of keys and sticks."""
BOX = np.array([[-0.1, 0.8], [-0.9, 0.9], [-0.6, 0.8]])
"""Where palm targets may be in base_link [m] [own: what an arm of 0.75 m reaches, and not behind the back]."""
SHUT = 0.005
"""Opening below which a hand closes [m]."""


class Driving:
    """The routine of a robot that is driven by hand; see `golem.skills.base.Routine`.

    Attributes:
        refused: why a palm does not go where it is wanted, by side; empty where it does.
        goals: (4, 4) where each palm is sent, in odom; None before it was moved.
    """

    def __init__(self, pilot: HandPilot, clock: Callable[[], float] = time.monotonic) -> None:
        """Go by what `pilot` wants by its `clock` [s]."""
        self._pilot, self._clock = pilot, clock
        self.refused: dict[Side, str] = dict.fromkeys(SIDES, "")
        self.goals: dict[Side, Array | None] = dict.fromkeys(SIDES)
        self._grips: dict[Side, float] = {}
        self._gripped: dict[Side, tuple[int, Array, Array]] = {}
        self._height: float | None = None
        self._waist, self._moved, self._speed = 0.0, False, SPEED
        self._stood = np.eye(4)

    async def run(self, context: Context, goal: object) -> SkillResult:
        """Drive until it is cancelled; see `Routine`."""
        context.say("teleop", "The robot is driven by hand.")
        await context.until(lambda: context.bus.latest(topics.LOW_STATE) is not None, 5.0)
        self._waist = float(context.joints[0])
        try:
            while True:
                self._carry(context)
                wish = self._pilot.wish(self._clock())
                if wish.moves:
                    self._drive(context, wish)
                else:
                    self._hold(context)
                self._moved = wish.moves
                await context.tick()
        except SkillCancelled:
            context.legs.drive(Twist(height=self._height))
            raise

    def _carry(self, context: Context) -> None:
        """Take the goals along while the robot walks: they are the pilot's, who goes with it."""
        stands = PlanarPose.of(context.T_odom_base).matrix()
        walks = context.legs.reporting and context.legs.status.moving
        self._speed = 2.0 * SPEED if walks else SPEED
        if walks:
            step = stands @ np.linalg.inv(self._stood)
            self.goals = {side: None if goal is None else step @ goal for side, goal in self.goals.items()}
        self._stood = stands

    def _hold(self, context: Context) -> None:
        """Stay: targets that run ahead of the hands come back to them, and the base stands."""
        for side, goal in self.goals.items():
            if goal is not None:
                arm = context.arms[side]
                self.goals[side] = goal = arm.commanded.copy() if self._moved else goal
                arm.approach(goal, self._speed, ACCELERATION)
        self._gripped.clear()
        context.legs.drive(Twist(height=self._height))

    def _drive(self, context: Context, wish: Wish) -> None:
        self._waist = float(np.clip(self._waist + wish.waist * context.period, -0.5, 0.5))
        context.torso = self._waist if wish.waist or context.torso is not None else None
        for side in SIDES:
            self._palm(context, side, wish)
            grip, hand = wish.grips.get(side), context.hands[side]
            if grip is not None and grip != self._grips.get(side):
                self._grips[side] = grip
                hand.close(FORCE) if grip < SHUT else hand.open(min(grip, MAX_GAP))
        heights = context.legs.status.heights if context.legs.reporting else None
        if heights is not None and wish.lift:
            before = heights[1] if self._height is None else self._height
            self._height = float(np.clip(before + wish.lift * context.period, heights[0], heights[2]))
        vx, vy, wz = wish.twist.tolist()
        context.legs.drive(Twist(vx, vy, wz, self._height))

    def _palm(self, context: Context, side: Side, wish: Wish) -> None:
        arm, T, dt, goal = context.arms[side], context.T_odom_base, context.period, self.goals[side]
        rate, why = wish.rates.get(side, np.zeros(6)), ""
        if side in wish.goals:
            far = float(np.linalg.norm(wish.goals[side][:3, 3] - arm.pose[:3, 3]))
            goal, why = (wish.goals[side], "") if far < FAR else (goal, f"{far:.2f} m away: too far")
        elif side in wish.devices:
            goal = self._follow(context, side, *wish.devices[side])
        elif np.abs(rate).max() > 1e-6:
            goal = led(arm.commanded if goal is None else goal, arm.pose, dt * (T[:3, :3] @ rate[:3]), LEAD)
            goal[:3, :3] = pin.exp3(dt * (T[:3, :3] @ rate[3:])) @ goal[:3, :3]
        if goal is not None:
            inside = T[:3, :3].T @ (goal[:3, 3] - T[:3, 3])
            kept = np.clip(inside, BOX[:, 0], BOX[:, 1])
            if np.abs(kept - inside).max() > 1e-6:
                goal, why = goal.copy(), "outside the work space"
                goal[:3, 3] = T[:3, :3] @ kept + T[:3, 3]
            arm.approach(goal, self._speed, ACCELERATION)
            command = context.bus.latest(topics.ARM_COMMAND)
            short = 0.0 if command is None else float(command.error_position[SIDES.index(side)])
            why = why or (f"the arm ends {100.0 * short:.0f} cm before it" if short > SHORT else "")
        self.goals[side], self.refused[side] = goal, why

    def _follow(self, context: Context, side: Side, grip: int, device: Array) -> Array:
        """Return where a palm goes that follows a tracked device from where both were when the clutch was gripped."""
        if side not in self._gripped or self._gripped[side][0] != grip:
            self._gripped[side] = grip, device, context.arms[side].commanded.copy()
        _, start, hand = self._gripped[side]
        R, goal = context.T_odom_base[:3, :3], hand.copy()
        goal[:3, 3] += self._pilot.config.scale * (R @ (device[:3, 3] - start[:3, 3]))
        goal[:3, :3] = R @ device[:3, :3] @ start[:3, :3].T @ R.T @ hand[:3, :3]
        return goal
