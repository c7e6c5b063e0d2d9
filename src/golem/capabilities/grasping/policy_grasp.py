"""A learned policy brings the hand down and says when the fingers close; the rest of a pick is as ever.

It sees what a data set holds (`golem.capabilities.policies.vectors`), and its actions are those of one. Of them the
palm and the opening of the hand at work count.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from golem.capabilities.grasping.base import Grasp, ServoLaw, ServoStatus, ServoStep
from golem.capabilities.grasping.centroid import Centroid
from golem.capabilities.policies.openpi import PolicyLinkConfig
from golem.capabilities.policies.stream import ActionPolicy, ActionStream, check_near, open_policy
from golem.capabilities.policies.vectors import GRIPS, palm_pose
from golem.types import SIDES, Array, LocalizedObject, Side

FAR, AGREED = 0.15, 3
"""How far from the hand a palm target may be [m], and steps in a row that ask for closed fingers before they close
[own]."""


@dataclass(frozen=True)
class PolicyGraspConfig(PolicyLinkConfig):
    """The server, and how the hand goes by it.

    Attributes:
        prompt: what is to be done, for policies that listen.
        patience: time until the policy is given up [s].
        closing: share of the opening the hand arrives with, below which a commanded opening means: close. A policy that
            has learned from few demonstrations says 0.65 to 0.75 of it at the screw, the mean of open and closed.
    """

    prompt: str = "Take a loose screw and drop it in the tray."
    patience: float = 20.0
    closing: float = 0.75


class PolicyLaw:
    """A servo law that sees for itself; see `golem.capabilities.grasping.base.SeeingLaw`."""

    def __init__(self, policy: ActionPolicy, config: PolicyGraspConfig, target: LocalizedObject, gap: float) -> None:
        """Ask `policy`; the hand arrives with an opening of `gap` [m]."""
        self.label, self.patience, self.cameras, self.width = (
            target.label, config.patience, config.cameras, config.width,
        )  # fmt: skip
        self._stream, self._shut_below = ActionStream(policy, config, config.prompt), config.closing * gap
        self._goal: Array | None = None
        self._shut = 0

    def see(
        self, t: float, side: Side, T_odom_base: Array, observe: Callable[[], dict[str, Any] | None], live: bool
    ) -> None:
        """Take the action that is due; see `SeeingLaw`. Errors as for `ActionStream.step`."""
        action, k = self._stream.step(t, observe, live), SIDES.index(side)
        if action is not None:
            self._goal = T_odom_base @ palm_pose(action[9 * k : 9 * k + 9])
            self._shut = self._shut + 1 if action[GRIPS][k] < self._shut_below else 0

    def step(self, t: float, sightings: list[LocalizedObject] | None, T_odom_gripper: Array) -> ServoStep:
        """Go where the policy said last; see `ServoLaw`. Raises ActionRefused: that is nowhere near the hand."""
        T = T_odom_gripper if self._goal is None else self._goal
        check_near(T, T_odom_gripper, FAR)
        status = ServoStatus.CONVERGED if self._shut >= AGREED else ServoStatus.TRACKING
        return ServoStep(T, T[:3, 3].copy(), 0.0, status)


class PolicyGrasp(Centroid):
    """The grasp above the object's centre, gone on from by a policy; see `GraspMethod`."""

    def __init__(self, config: PolicyGraspConfig | None = None) -> None:
        """Take the options; the policy is asked when the hand is above the object.

        Raises ConfigError: its file is no policy; MissingExtra: the extra `policy` is not installed.
        """
        super().__init__()
        self._policy, self._options = open_policy(config or PolicyGraspConfig())

    def servo(self, target: LocalizedObject, grasp: Grasp, t: float) -> ServoLaw | None:
        return PolicyLaw(self._policy, self._options, target, grasp.gap)
