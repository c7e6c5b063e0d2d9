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


def blame(stage: str, slot: str | None, truth: GraspTruth | None) -> str | None:
    """Return the slot that lost a failed trial.

    Where the hand missed the screw, the larger of the two errors is to blame: where it was sent, or where it went (the
    arm and its calibration). Where it was sent is again the larger of two: the camera's calibration, or what was seen
    (perception). Where it did not miss, an off-axis pull is the arm's, and the rest is the grip's.
    """
    if truth is None or stage in ("detect", "servo", "safety", FAULT):
        return slot
    if truth.miss > PAD_REACH:
        if truth.aim < truth.reach:
            return "upper_body"
        return CALIBRATION if truth.calibration > truth.seen else "localizer"
    if stage == "extract" and truth.tilt > STRAIGHT:
        return "upper_body"
    return "localizer" if stage == "place" else "grasp_method"
