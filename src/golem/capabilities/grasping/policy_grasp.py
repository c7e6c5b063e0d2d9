"""A learned policy brings the hand down and says when the fingers close; the rest of a pick is as ever.

It sees what a data set holds (`golem.capabilities.policies.vectors`), and its actions are those of one. Of them
the palm and the opening of the hand at work count.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from golem.capabilities.grasping.base import Grasp, ServoLaw, ServoStatus, ServoStep
from golem.capabilities.grasping.centroid import Centroid
from golem.capabilities.policies.openpi import PolicyLinkConfig
from golem.capabilities.policies.stream import ActionPolicy, ActionStream, open_policy
from golem.capabilities.policies.vectors import GRIPS, ActionRefused, palm_pose
from golem.types import SIDES, Array, LocalizedObject, Side

FAR = 0.15
"""How far from the hand a palm target may be [m] [own]: further is a fault, not a wish."""
AGREED = 3
"""Steps of the policy in a row that ask for closed fingers before they close [own]."""


@dataclass(frozen=True)
class PolicyGraspConfig(PolicyLinkConfig):
    """The server, and how the hand goes by it.

    Attributes:
        prompt: what is to be done, for policies that listen.
        patience: time until the policy is given up [s].
        closing: share of the opening the hand arrives with, below which a commanded opening means: close.
    """

    prompt: str = "Take a loose screw and drop it in the tray."
    patience: float = 20.0
    closing: float = 0.5


class PolicyLaw:
    """A servo law that sees for itself; see `golem.capabilities.grasping.base.SeeingLaw`."""

    def __init__(self, policy: ActionPolicy, config: PolicyGraspConfig, target: LocalizedObject, gap: float) -> None:
        """Ask `policy`; the hand arrives with an opening of `gap` [m]."""
        self.label, self.patience = target.label, config.patience
        self.cameras, self.width, self.prompt = config.cameras, config.width, config.prompt
        self._stream, self._gap, self._closing = ActionStream(policy, config), gap, config.closing
        self._target: tuple[Array, float] | None = None
        self._shut = 0

    def see(
        self, t: float, side: Side, T_odom_base: Array, observe: Callable[[], dict[str, Any] | None], live: bool
    ) -> None:
        """Take the action that is due; see `SeeingLaw`.

        Raises:
            ServiceUnavailable, ActionRefused: see `ActionStream.step`.
        """
        action, k = self._stream.step(t, observe, live), SIDES.index(side)
        if action is not None:
            gap = float(action[GRIPS][k])
            self._target = T_odom_base @ palm_pose(action[9 * k : 9 * k + 9]), gap
            self._shut = self._shut + 1 if gap < self._closing * self._gap else 0

    def step(self, t: float, sightings: list[LocalizedObject] | None, T_odom_gripper: Array) -> ServoStep:
        """Go where the policy said last; see `ServoLaw`.

        Raises:
            ActionRefused: that is nowhere near the hand.
        """
        T = T_odom_gripper if self._target is None else self._target[0]
        far = float(np.linalg.norm(T[:3, 3] - T_odom_gripper[:3, 3]))
        if far > FAR:
            raise ActionRefused(f"The policy sends the hand {far:.2f} m away in one step; {FAR:g} m is the most.")
        status = ServoStatus.CONVERGED if self._shut >= AGREED else ServoStatus.TRACKING
        return ServoStep(T, T[:3, 3].copy(), 0.0, status)


class PolicyGrasp(Centroid):
    """The grasp above the object's centre, gone on from by a policy server; see `GraspMethod`.

    Attributes:
        config: its options.
    """

    def __init__(self, config: PolicyGraspConfig | None = None) -> None:
        """Take the options; the server is asked when the hand is above the object.

        Raises:
            ConfigError: its file is no policy.
            MissingExtra: the extra `policy` is not installed.
        """
        super().__init__()
        self._policy, self.options = open_policy(config or PolicyGraspConfig())

    def servo(self, target: LocalizedObject, grasp: Grasp, t: float) -> ServoLaw | None:
        """Return the law; see `GraspMethod`."""
        return PolicyLaw(self._policy, self.options, target, grasp.gap)
