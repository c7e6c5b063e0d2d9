"""The pull of a pick: straight out, felt in its first millimetres."""

from __future__ import annotations

from golem.skills.context import Context
from golem.skills.force_guard import ForceGuard
from golem.skills.pick_config import PickConfig
from golem.skills.pick_report import PickFailed, slipped
from golem.skills.pick_targets import Attempt
from golem.skills.poses import lifted, moved, retracted
from golem.skills.travel import Travel


async def pull(
    context: Context, config: PickConfig, travel: Travel, attempt: Attempt, heights: list[float]
) -> None:
    """Pull straight out against the approach direction, then lift; the grip must hold.

    Args:
        context: whose hand.
        config: distances, speeds and forces.
        travel: moves it.
        attempt: what is held.
        heights: at which the palm camera saw it before each pull [m].

    Raises:
        PickFailed: it resists, or slips out of the fingers.
    """
    arm, hand = context.arms[attempt.side], context.hands[attempt.side]
    # Off centre, one finger leans on its stop and the other pushes the object against its bore.
    commanded = arm.commanded
    await arm.move(moved(commanded, hand.status.offset * commanded[:3, 1]), config.pull_speed)
    context.say("extract", "Pulling straight out.")
    guard = await ForceGuard.at_rest(
        context, attempt.side, -arm.commanded[:3, 2], config.guard_force, config.guard_length
    )
    await travel.line(
        attempt.side,
        retracted(arm.commanded, config.pull),
        config.pull_speed,
        "extract",
        stop=lambda: guard() or not hand.status.holding,
    )
    if guard.stuck:
        text = f"The {attempt.label} does not move at {guard.largest:.0f} N."
        raise PickFailed(slipped(heights), "extract", "grasp_method", text)
    await arm.move(
        lifted(arm.commanded, config.clearance - config.pull),
        config.travel_speed,
        stop=lambda: not hand.status.holding,
    )
    if not hand.status.holding:
        text = f"The {attempt.label} slipped out of the fingers."
        raise PickFailed(slipped(heights), "extract", "grasp_method", text)
