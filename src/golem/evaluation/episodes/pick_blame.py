"""Which module lost a pick."""

from __future__ import annotations

from golem.evaluation.episodes.oracle import GraspTruth
from golem.skills.base import FAULT

PAD_REACH = 0.008
"""Half width of a finger pad [m]: a hand further off than this cannot hold the screw."""
STRAIGHT = 0.087
"""Tilt beyond which an extraction counts as off axis [rad]: 5 deg."""
CALIBRATION = "calibration"
"""Who is to blame where a camera is not where the robot's calibration has it: no module."""


def blame(stage: str, slot: str | None, truth: GraspTruth | None, drop_inside: float | None = None) -> str | None:
    """Return the slot that lost a failed trial.

    Where the hand missed the screw, the larger of the two errors is to blame: where the camera had the screw, or what
    was left from there to the hand (the arm and its calibration). The first is again the larger of two: the camera's
    calibration, or what was seen (perception). Where it did not miss, an off-axis pull is the arm's; a hand that lets
    go beside the tray, `drop_inside` [m] within its rim, was sent there by perception; and the rest is the grip's.
    """
    if truth is None or stage in ("detect", "servo", "safety", FAULT):
        return slot
    if truth.miss > PAD_REACH:
        if truth.told < truth.left:
            return "upper_body"
        return CALIBRATION if truth.calibration > truth.seen else "localizer"
    if stage == "extract" and truth.tilt > STRAIGHT:
        return "upper_body"
    return "localizer" if stage == "place" and drop_inside is not None and drop_inside < 0.0 else "grasp_method"
