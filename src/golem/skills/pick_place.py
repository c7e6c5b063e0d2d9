"""The end of a pick: pulling the object out, where to let go of it, and a look at whether it lies there."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from golem.capabilities.perception.box_search import find_box
from golem.capabilities.perception.open_box import EDGE_ROOM, OpenBox
from golem.capabilities.planning.base import Refusal
from golem.skills.base import StageFailed
from golem.skills.container import ROLLED, Container
from golem.skills.context import Context
from golem.skills.force_guard import ForceGuard, open_hand
from golem.skills.hand_offset import shift_of
from golem.skills.pick_config import PickConfig, PickFailed, PickOutcome, PickReport, Sight, refusal_of, slipped
from golem.skills.pick_targets import Attempt, HandReach, PickChoice, positions
from golem.skills.poses import lifted, moved, turned
from golem.skills.travel import Travel
from golem.skills.ware_sight import beyond_fingers
from golem.types import Array, Side

LEAD = 0.03
"""Way at first, far above anything, on which a hand that comes down learns the friction of its own arm [m]."""
DROPS = 6
"""Places in the container that are tried."""
HIGHER = 0.10
"""How much higher a hand looks that does not see the container from where it lets go [m]."""
INSIDE = 0.03
"""A hand this near to the container's middle lets go there [m]."""
FARTHEST = 0.2
"""What the palm camera takes for the container farther than this from where it should be is another one [m]."""
LEANS = (0.0, 0.35)
"""How far a hand leans outwards that lets go [rad]: leaning, the fingers get some centimetres further."""
SHARES = (1.0, 0.75, 0.5, 0.25)
"""Shares of the way to the middle that are tried."""
SAME = 0.035
"""Two looks of the head camera at one object differ by less [m]; screws stand 9 cm apart."""
APART, AGREE = 0.02, 2
"""What lies in the container is new if it is this far from all that lay there [m]; in so many frames."""
NEAR = 0.12
"""What vanished this near to where the hand took something is that: the palm camera may have seen its neighbour [m]."""


async def pull(
    context: Context, config: PickConfig, travel: Travel, attempt: Attempt, up: Array, heights: list[float]
) -> None:
    """Pull straight out against the approach direction, then lift; the grip must hold.

    The hand itself may stand askew in odom: a servo turns it to the ground it sees, by a wrist whose encoders are off.

    Args:
        up: (3,) against the direction of the approach, as the grasp was proposed, in odom.
        heights: at which the palm camera saw it before each pull [m].

    Raises:
        PickFailed: it resists, or slips out of the fingers.
    """
    arm, hand = context.arms[attempt.side], context.hands[attempt.side]
    # Off centre, one finger leans on its stop and the other pushes the object against its bore.
    # A hand that stands on its fingertips is off where it is sent; without that its force counts from zero.
    commanded = arm.commanded
    pressed = max(0.0, float((arm.pose - commanded)[:3, 3] @ up))
    await arm.move(moved(commanded, hand.status.offset * commanded[:3, 1] + pressed * up), config.pull_speed)
    context.say("extract", "Pulling straight out.")
    guard = await ForceGuard.at_rest(context, attempt.side, up, config.guard_force, config.guard_length)
    await travel.line(
        attempt.side,
        moved(arm.commanded, config.pull * up),
        config.pull_speed,
        "extract",
        stop=lambda: guard() or not hand.status.holding,
    )
    if guard.stuck:
        text = f"The {attempt.label} does not move at {guard.largest:.0f} N."
        raise PickFailed(slipped(heights), "extract", "grasp_method", text)
    await arm.move(
        lifted(arm.commanded, config.clearance - config.pull), config.travel_speed, stop=lambda: not hand.status.holding
    )
    if not hand.status.holding:
        text = f"The {attempt.label} slipped out of the fingers."
        raise PickFailed(slipped(heights), "extract", "grasp_method", text)


async def place(
    context: Context, config: PickConfig, travel: Travel, attempt: Attempt, seen: Array, choice: PickChoice, off: Array
) -> tuple[float, ...]:
    """Carry what a hand holds over the container and let go.

    Returns: where, x and y in odom as the head camera shows it [m]; () where the palm camera did not see the container
    below.

    Args:
        seen: (3,) where the palm camera saw what the head camera had chosen, in odom [m].
        off: (3,) by how much it was known to see things elsewhere [m].

    Raises:
        StageFailed: no place above the container is reached, or the object was lost.
    """
    container, arm, hand = choice.container, context.arms[attempt.side], context.hands[attempt.side]
    shift = off + shift_of(seen - off, attempt.target.position, choice.seen)
    travel.displace(shift)
    spots = container.places(config.drop_margin) + shift
    goals: list[Array] = []
    spots = HandReach(context, config).drop_order(attempt.side, spots, DROPS)
    for lean, turn, spot in product(LEANS, config.turns, spots):
        T = turned(arm.commanded, turn)
        T[:3, :3] = _leaning(spot - context.T_odom_base[:3, 3], lean) @ T[:3, :3]
        T[:3, 3] = spot + (0.0, 0.0, config.drop_height)
        goals.append(T)
    context.say("place", f"Carrying it to the {attempt.container}.", target=container.sighting.position.tolist())
    try:
        await travel.carry(attempt.side, goals, config.travel_speed)
    except StageFailed as failure:
        if refusal_of(failure) is Refusal.UNREACHABLE:
            raise PickFailed(PickOutcome.TRAY_OUT_OF_REACH, failure.stage, failure.slot, str(failure)) from failure
        raise
    below = await _nearer(context, config, travel, attempt, container, shift)
    if not hand.status.holding:
        raise PickFailed(PickOutcome.SLIPPED, "place", "grasp_method", f"The {attempt.label} was lost on the way.")
    at = arm.commanded[None, :3, 3]
    await open_hand(context, attempt.side, config.release_gap, "place")
    if container.box is None or below is None or not below.contains(at, EDGE_ROOM).all():
        return ()
    return tuple((at[0, :2] - below.center + container.box.center).tolist())


def _leaning(out: Array, lean: float) -> Array:
    """Return the (3, 3) turn by `lean` [rad] that brings the palm back and leaves the fingers, `out` (3,) ahead."""
    axis = np.cross((0.0, 0.0, -1.0), (*out[:2], 0.0))
    return Rotation.from_rotvec(lean * axis / np.linalg.norm(axis)).as_matrix()


async def set_back(context: Context, config: PickConfig, travel: Travel, side: Side, T: Array, gap: float) -> None:
    """Bring what a hand holds, and cannot bring away, as far back as it goes to `T`, where it was gripped.

    Args:
        T: (4, 4) of the gripper in odom.
        gap: between the fingers as they came, which there is room for [m].
    """
    context.say("place", "Setting it back where it was taken.")
    arm = context.arms[side]
    with suppress(StageFailed):
        await travel.carry(side, [lifted(T, config.clearance)], config.travel_speed)
        stop = await ForceGuard.at_rest(context, side, T[:3, 2], config.press_force, lead=LEAD)
        try:
            await travel.line(side, T, config.descend_speed, "place", stop=stop)
        except StageFailed:  # askew is better than to let it fall on the pack
            await arm.move(T, config.descend_speed, stop=stop)
        await open_hand(context, side, gap, "place")
        await arm.move(lifted(arm.commanded, config.clearance), config.travel_speed)


async def _nearer(
    context: Context, config: PickConfig, travel: Travel, attempt: Attempt, container: Container, shift: Array
) -> OpenBox | None:
    """Look down at the container with the palm camera, and go further inside if the hand is near its rim or beside it.

    Where too little of the container is in view, it looks from higher up. Returns the container as that camera sees it.

    Args:
        shift: (3,) from where the head camera sees things to where the palm camera does, in odom [m].
    """
    if container.box is None:
        return None
    box = replace(container.box, center=container.box.center + shift[:2], rim=container.box.rim + shift[2])
    arm, raised = context.arms[attempt.side], False
    hand = arm.commanded
    found = await _below(context, config, attempt, box)
    if found is None:
        with suppress(StageFailed):
            await travel.carry(attempt.side, [lifted(hand, HIGHER)], config.travel_speed)
            raised = True
            found = await _below(context, config, attempt, box)
    goals = list[Array]()
    away = np.zeros(3) if found is None else np.append(found.center - arm.pose[:2, 3], 0.0)
    if np.linalg.norm(away) > INSIDE:
        inside = [moved(hand, share * away) for share in SHARES]
        goals = [turned(T, turn) for T in inside for turn in config.turns]
    if raised:
        goals.append(hand)
    if goals:
        with suppress(StageFailed):  # then it is no nearer than it is
            await travel.carry(attempt.side, goals, config.travel_speed)
    return found


async def _below(context: Context, config: PickConfig, attempt: Attempt, box: OpenBox) -> OpenBox | None:
    """Return `box` where the palm camera shows it, in odom.

    It is looked for around each thing that the camera takes for the container, mostly one half of it, and around their
    mean; where it takes nothing for it, around where it should be.
    """
    side = attempt.side
    with context.watch(f"{side}_hand", attempt.container, doubtful=(attempt.container,)) as eye:
        sightings = await eye.look(config.look_timeout)
    if sightings is None:
        return None
    there = [o.position[:2] for o in sightings.objects if o.label == attempt.container]
    there = [at for at in there if np.linalg.norm(at - box.center) < FARTHEST] or [box.center]
    return find_box(box, beyond_fingers(context, side), [*there, np.mean(there, axis=0)])


async def look_after(
    context: Context, config: PickConfig, attempt: Attempt, choice: PickChoice, names: Sequence[str], report: PickReport
) -> None:
    """Look with the head camera at container and bore for `names`, and write into the report what it saw.

    The object is in the container if something rises there now, or more such objects are seen there than before, or one
    where the hand let go. Its place is empty if one of those that were seen around it before is seen no more. Where the
    hand let go above the container and a wall hides what lies there, the camera says nothing of that.
    """
    frames: list[Array] = []
    clouds: list[Array] = []
    with context.watch("head", *names, attempt.container, doubtful=(attempt.container,)) as eye:
        end = context.t + config.look_timeout
        while len(frames) < config.looks_after:
            sightings = await eye.look(end - context.t)
            if sightings is None:
                break
            frames.append(positions(sightings, names))
            clouds += [o.points for o in sightings.objects if o.label == attempt.container]
    if not frames:
        return
    inside = choice.container.holds(choice.seen)
    if clouds:
        more = [int(choice.container.holds(points).sum()) > int(inside.sum()) for points in frames]
        gained = choice.container.gained(np.concatenate(clouds), report.let_go)
        seen, absent = gained or 2 * sum(more) > len(more), gained is False
        if report.let_go:  # a frame shows about half of what lies there, and a nut is too flat to rise
            near = [points[_away(points, report.let_go) < ROLLED] for points in frames]
            new = [any(_away(choice.seen, place).min(initial=1.0) > APART for place in points) for points in near]
            seen, absent = seen or sum(new) >= AGREE, absent and not any(map(len, near))
        report.in_tray = (Sight.YES if seen else Sight.NO if absent else Sight.UNKNOWN).value
    taken = report.tried[-1]
    stood = choice.seen[~inside]
    around = _away(stood, (taken.x, taken.y)) < NEAR
    if around.any():
        # In single frames a bore looks like a screw, or a screw is overlooked.
        shown = np.sum([_shown(points, stood) for points in frames], axis=0)[around]
        report.bore_empty = (Sight.YES if 2 * shown.min() < len(frames) else Sight.NO).value


def _away(points: Array, place: Sequence[float] | Array) -> Array:
    """Return (n,) how far `points` (n, 3) are from a place, x and y first, in the plane [m]."""
    return np.hypot(points[:, 0] - place[0], points[:, 1] - place[1])


def _shown(points: Array, stood: Array) -> NDArray[np.bool_]:
    """Return (n,) which of what `stood` (n, 3) is among those (m, 3) of a frame; each of these is the nearest one."""
    away = np.linalg.norm(points[:, None] - stood, axis=2)
    nearest = away == away.min(axis=1, keepdims=True)
    return (nearest & (away < SAME)).any(axis=0)
