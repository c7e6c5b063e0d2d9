"""Close a hand, and wait until it knows whether it holds something."""

from __future__ import annotations

from golem.interfaces.payloads import GripState
from golem.skills.context import Context
from golem.types import Side

CLOSED = (GripState.HOLDING, GripState.EMPTY)
"""States of a hand whose fingers have closed, on something or on nothing."""
HEARD = 0.06
"""Time in which a hand begins what it was told [s]."""
PATIENCE = 2.5
"""Time the fingers may take [s]."""


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
