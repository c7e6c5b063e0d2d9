"""Names of the streams on the bus and the small messages that only coordinate modules."""

from __future__ import annotations

from dataclasses import dataclass

from golem.types import Side

LOW_STATE = "lowstate"
"""`LowState` at 500 Hz, from the robot."""
LOW_CMD_REQUEST = "safety/lowcmd_in"
"""`LowCommand` at 500 Hz, from the servo to the safety gate."""
LOW_CMD = "lowcmd"
"""`LowCommand` at 500 Hz, from the safety gate to the robot; nobody else writes it."""
BASE = "base_estimate"
"""`BaseEstimate` at 500 Hz."""
ESTOP = "estop"
"""`EstopFrame` at 100 Hz."""
SAFETY = "safety/status"
"""`GateResult` whenever the safety gate ran."""
PALM_TARGETS = "palm_targets"
"""`PalmTargets` in odom, from the running skill."""
ARM_COMMAND = "arm_command"
"""`ArmCommand`, from the upper-body controller."""
LEG_COMMAND = "leg_command"
"""`LegCommand`, from the lower-body controller."""
TWIST = "cmd_vel"
"""`Twist` for the lower body."""
FEEDBACK = "skill/feedback"
"""`Feedback` of the running skill."""


def hand_state(side: Side) -> str:
    """Return the topic of `HandState` of one hand."""
    return f"{side}/gripper/state"


def hand_command(side: Side) -> str:
    """Return the topic of `HandCommand` of one hand."""
    return f"{side}/gripper/command"


def hand_goal(side: Side) -> str:
    """Return the topic on which a skill tells one hand what to do (`HandGoal`)."""
    return f"{side}/gripper/goal"


def hand_status(side: Side) -> str:
    """Return the topic of the hand controller's `HandStatus`."""
    return f"{side}/gripper/status"


def frames(camera: str) -> str:
    """Return the topic of `Frame` of one camera."""
    return f"realsense/{camera}"


def look(camera: str) -> str:
    """Return the topic of `LookRequest` for one camera."""
    return f"look/{camera}"


def sightings(camera: str) -> str:
    """Return the topic of `Sightings` from one camera."""
    return f"objects/{camera}"


@dataclass(frozen=True, slots=True)
class LookRequest:
    """Ask a camera and the localizer behind it to stream.

    Attributes:
        labels: what to look for; empty stops the stream, so that nothing is rendered or inferred unasked.
    """

    labels: tuple[str, ...] = ()
