"""A gripper, as a skill commands and reads it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from golem.interfaces import topics
from golem.interfaces.payloads import HandGoal, HandStatus
from golem.skills.base import StageFailed
from golem.types import Side

if TYPE_CHECKING:
    from golem.skills.context import Context


class HandInterface:
    """One gripper, as a skill commands and reads it."""

    def __init__(self, context: Context, side: Side) -> None:
        """Speak for the hand on `side`."""
        self._context = context
        self._side: Side = side

    @property
    def status(self) -> HandStatus:
        """What the hand's controller reports now.

        Raises:
            StageFailed: it has not reported yet.
        """
        status = self._context.bus.latest(topics.hand_status(self._side))
        if status is None:
            raise StageFailed("grasp", "hand", f"The {self._side} hand does not report.")
        return status

    def open(self, gap: float) -> None:
        """Move the fingers to an opening of `gap` [m]."""
        self._context.publish(topics.hand_goal(self._side), HandGoal(gap))

    def close(self, force: float) -> None:
        """Close until both fingers press with `force` [N]."""
        self._context.publish(topics.hand_goal(self._side), HandGoal(None, force))
