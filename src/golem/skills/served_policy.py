"""Let a policy server move arms, hands and base."""

from __future__ import annotations

import math
from contextlib import closing
from dataclasses import dataclass

import numpy as np

from golem.capabilities.policies.openpi import PolicyLinkConfig
from golem.capabilities.policies.stream import ActionStream, open_policy
from golem.capabilities.policies.vectors import GRIPS, HEIGHT, SHUT, TORSO, TWIST, ActionRefused, palm_pose
from golem.errors import ServiceUnavailable
from golem.options import require
from golem.robots.model.magpie_model import MAX_GAP
from golem.skills.base import SkillResult
from golem.skills.context import Context
from golem.skills.policy_view import PolicyView
from golem.types import SIDES, Array, Side, Twist

FORCE = 3.0
"""What a finger presses with where a policy closes a hand [N] [own]."""
SPEED, FAR = 0.25, 0.5
"""Speed of a hand [m/s], and how far from it a target may be [m] [own]: further is a fault, not a wish."""


@dataclass(frozen=True, slots=True)
class PolicyGoal:
    """What the policy is to do.

    Attributes:
        prompt: as a sentence, for policies that listen.
        seconds: how long it gets [s].
    """

    prompt: str = ""
    seconds: float = 30.0

    def __post_init__(self) -> None:
        require("policy's ", ("time", self.seconds, 0.0 < self.seconds < math.inf, "a positive number of seconds"))


class PolicySkill:
    """Let a policy server move arms, hands and base for a while."""

    Goal = PolicyGoal

    def __init__(self, config: PolicyLinkConfig | None = None) -> None:
        """Take the server's address; it is asked when the skill runs."""
        self._config = config or PolicyLinkConfig()
        self._gaps: list[float | None] = [None, None]

    def timeout(self, goal: PolicyGoal) -> float:
        """Return the time it may take [s]; see `Skill`."""
        return goal.seconds + 2.0 * self._config.timeout

    async def run(self, context: Context, goal: PolicyGoal) -> SkillResult:
        """Do what the policy says, as far as arms, legs and gate let it; see `Skill`."""
        live = context.modules.worker is not None
        policy, c = open_policy(self._config)
        context.say("policy", f"The policy {c.file or f'at {c.host}:{c.port}'} moves the robot.")
        with (
            closing(policy),
            closing(ActionStream(policy, c)) as stream,
            PolicyView(context, c.cameras, c.width, goal.prompt) as view,
        ):
            end = context.t + goal.seconds
            try:
                while context.t < end:
                    action = stream.step(context.t, view, live)
                    if action is not None:
                        self._do(context, action)
                    await context.tick()
            except (ServiceUnavailable, ActionRefused) as fault:
                context.legs.drive(Twist())
                return SkillResult(False, "policy", "skill", f"{fault} The arms stay where they are.")
        context.legs.drive(Twist())
        return SkillResult(True, "done", None, f"The policy moved the robot for {goal.seconds:g} s.")

    def _do(self, context: Context, action: Array) -> None:
        """Do one action.

        Raises:
            ActionRefused: a hand cannot be meant to go there.
        """
        T = context.T_odom_base
        goals: dict[Side, Array] = {side: T @ palm_pose(action[9 * k : 9 * k + 9]) for k, side in enumerate(SIDES)}
        for side, goal in goals.items():
            check_near(side, goal, context.arms[side].pose)
        context.torso = float(action[TORSO])
        for k, side in enumerate(SIDES):
            context.arms[side].approach(goals[side], SPEED)
            gap = float(np.clip(action[GRIPS][k], 0.0, MAX_GAP))
            last = self._gaps[k]
            if last is None or abs(gap - last) > 1e-3 or (gap < SHUT) != (last < SHUT):
                self._gaps[k] = gap
                hand = context.hands[side]
                hand.close(FORCE) if gap < SHUT else hand.open(gap)
        vx, vy, wz = action[TWIST].tolist()
        height = float(action[HEIGHT])
        context.legs.drive(Twist(vx, vy, wz, height if height > 0.0 else None))


def check_near(side: str, goal: Array, pose: Array) -> None:
    """Check that a hand at `pose` may be meant to go to `goal`, (4, 4) each.

    Raises:
        ActionRefused: it is further away than a policy sends a hand in one step.
    """
    far = float(np.linalg.norm(goal[:3, 3] - pose[:3, 3]))
    if far > FAR:
        raise ActionRefused(f"The policy sends the {side} hand {far:.2f} m away in one step; {FAR:g} m is the most.")
