"""Close a hand, and wait until it knows whether it holds something."""

from __future__ import annotations

from golem.interfaces.payloads import GripState
from golem.skills.base import StageFailed
from golem.skills.context import Context
from golem.types import Side

CLOSED = (GripState.HOLDING, GripState.EMPTY)
"""States of a hand whose fingers have closed, on something or on nothing."""
HEARD = 0.06
"""Time in which a hand begins what it was told [s]."""
PATIENCE = 2.5
"""Time the fingers may take [s]."""


class KeptGrip:
    """Minds what a hand carries, as `Context.minding` calls it: closes again on what slides, and ends what was lost."""

    def __init__(self, context: Context, side: Side, force: float, thing: str) -> None:
        """Mind `thing` in the hand of a `side`, held with `force` [N]."""
        self._context, self._force, self._thing = context, force, thing
        self._side: Side = side
        self._since: float | None = None

    def __call__(self) -> None:
        """Look at the hand.

        Raises:
            StageFailed: it has closed again, and holds nothing.
        """
        hand, now = self._context.hands[self._side], self._context.t
        if hand.status.holding:
            self._since = None
        elif self._since is None:
            self._since = now
            self._context.say("carry", f"The {self._thing} slides in the fingers. Gripping again.")
            hand.close(self._force)
        elif now - self._since > (HEARD if hand.status.state is GripState.EMPTY else PATIENCE):
            x, y = self._context.arms[self._side].pose[:2, 3]
            raise StageFailed(
                "carry", "grasp_method", f"The {self._thing} was lost on the way, near ({x:.2f}, {y:.2f}) in odom."
            )


async def close_hand(context: Context, side: Side, force: float, patience: float = PATIENCE) -> bool:
    """Close a hand; return whether it holds something.

    A hand that noticed a slip keeps pressing, and no longer says that it holds: what slid between its fingers and is
    still there is found by closing again.

    Args:
        context: whose hand.
        side: which.
        force: of each finger [N].
        patience: time the fingers may take [s].
    """
    hand = context.hands[side]
    hand.close(force)
    await context.sleep(HEARD)
    await context.until(lambda: hand.status.state in CLOSED, patience)
    return hand.status.holding
