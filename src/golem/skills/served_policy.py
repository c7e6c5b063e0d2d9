"""Let a policy server move arms, hands and base."""

from __future__ import annotations

import math
from contextlib import closing
from dataclasses import dataclass

import numpy as np

from golem.capabilities.policies.observer import Observer
from golem.capabilities.policies.openpi import PolicyLinkConfig
from golem.capabilities.policies.stream import ActionStream, check_near, open_policy
from golem.capabilities.policies.vectors import GRIPS, HEIGHT, SHUT, TORSO, TWIST, ActionRefused, palm_pose
from golem.errors import ServiceUnavailable
from golem.interfaces import topics
from golem.options import require
from golem.robots.model.magpie_model import MAX_GAP
from golem.skills.base import SkillResult
from golem.skills.context import Context
from golem.types import SIDES, Array, Twist

FORCE, SPEED, FAR = 3.0, 0.25, 0.5
"""What a finger presses with where a policy closes a hand [N], speed of a hand [m/s], and how far from it a target may
be [m] [own]: further is a fault, not a wish."""


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
        self._config, self._gaps = config or PolicyLinkConfig(), [np.inf, np.inf]

    def timeout(self, goal: PolicyGoal) -> float:
        """Return the time it may take [s]; see `Skill`."""
        return goal.seconds + 2.0 * self._config.timeout

    async def run(self, context: Context, goal: PolicyGoal) -> SkillResult:
        """Do what the policy says, as far as arms, legs and gate let it; see `Skill`."""
        live, (policy, c) = context.modules.worker is not None, open_policy(self._config)
        context.say("policy", f"The policy {c.file or f'at {c.host}:{c.port}'} moves the robot.")
        observer = Observer(context.bus, c.cameras, c.width, topics.rgbd_images)
        with closing(policy), closing(ActionStream(policy, c, goal.prompt)) as stream:
            end = context.t + goal.seconds
            try:
                while context.t < end:
                    action = stream.step(context.t, observer.observation, live)
                    if action is not None:
                        self._do(context, action)
                    await context.tick()
            except (ServiceUnavailable, ActionRefused) as fault:
                return SkillResult(False, "policy", "skill", f"{fault} The arms stay where they are.")
            finally:
                context.legs.drive(Twist())
        return SkillResult(True, "done", None, f"The policy moved the robot for {goal.seconds:g} s.")

    def _do(self, context: Context, action: Array) -> None:
        """Do one action. Raises ActionRefused: a hand cannot be meant to go there."""
        goals = [context.T_odom_base @ palm_pose(action[9 * k : 9 * k + 9]) for k in range(2)]
        for side, goal in zip(SIDES, goals, strict=True):
            check_near(goal, context.arms[side].pose, FAR)
        context.torso = float(action[TORSO])
        for k, side in enumerate(SIDES):
            context.arms[side].approach(goals[k], SPEED)
            gap, hand = float(np.clip(action[GRIPS][k], 0.0, MAX_GAP)), context.hands[side]
            if abs(gap - self._gaps[k]) > 1e-3 or (gap < SHUT) != (self._gaps[k] < SHUT):
                self._gaps[k] = gap
                hand.close(FORCE) if gap < SHUT else hand.open(gap)
        (vx, vy, wz), height = action[TWIST].tolist(), float(action[HEIGHT])
        context.legs.drive(Twist(vx, vy, wz, height if height > 0.0 else None))
