"""Every reason of the safety gate with its number, what is compared, and what to do: docs/reference/safety.md."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

from golem.hardware.safety.base import JOLT, SafetyLimits
from golem.hardware.safety.gate import STAND
from golem.hardware.safety.gate_balance import LEG, SUNK
from golem.interfaces.payloads import Reason

LIMITS = SafetyLimits.from_profile()
_L = LIMITS


@dataclass(frozen=True, slots=True)
class ReasonText:
    """One reason for a person.

    Attributes:
        number: what logs and this page call it; never used again for another.
        threshold: what is compared with what.
        fix: what to do.
    """

    number: int
    threshold: str
    fix: str


def _ms(seconds: float) -> str:
    return f"{1e3 * seconds:g} ms"


SWITCH = "Switch the robot off, look for the cause, and reset once it reports sound values."
REASONS: dict[Reason, ReasonText] = {
    Reason.CLOCK: ReasonText(101, "The gate's clock went back.", "Restart the gate; look for who sets the clock."),
    Reason.STALLED: ReasonText(
        102, f"The gate did not run for {_ms(_L.stall)}.", "Give the gate a core of its own; look for what held it up."
    ),
    Reason.REQUESTED: ReasonText(103, "An operator asked.", "`golem safety reset`, then `activate`."),
    Reason.ESTOP_MISSING: ReasonText(201, "No frame of the e-stop yet.", "Connect its board."),
    Reason.ESTOP_STALE: ReasonText(
        202, f"No new frame for {_ms(_L.estop_age)}.", "Look at the board's cable; `golem drivers estop PORT` tries it."
    ),
    Reason.ESTOP_TIME: ReasonText(
        203, f"A stamp more than {_ms(_L.future)} ahead.", "Frames are stamped on arrival: restart the gate."
    ),
    Reason.ESTOP_PRESSED: ReasonText(204, "The button is in, or its wire is cut.", "Pull it out, then reset."),
    Reason.STATE_MISSING: ReasonText(301, "No state yet.", "Is the robot on, and the domain and interface right?"),
    Reason.STATE_STALE: ReasonText(302, f"No new state for {_ms(_L.state_age)}.", "Look at the robot's cable."),
    Reason.STATE_TIME: ReasonText(303, f"A stamp more than {_ms(_L.future)} ahead.", "Restart the gate."),
    Reason.STATE_INVALID: ReasonText(304, "A number is not finite or above 1e6.", SWITCH),
    Reason.STATE_CLOCK: ReasonText(
        305, "The robot's time runs at another rate than ours, 0.9 to 1.1.", "Its tick is in another unit: see wire."
    ),
    Reason.STATE_JUMPED: ReasonText(
        306, "The robot's clock jumped back, or ahead by 0.1 s.", "It was restarted: reset and activate again."
    ),
    Reason.STATE_FROZEN: ReasonText(
        307,
        f"A limb's q, dq and torque, or the IMU, repeat for {_ms(_L.frozen)}.",
        "The bus of that limb has stopped: restart the robot. A simulation without noise: `--still`.",
    ),
    Reason.STATE_IMPLAUSIBLE: ReasonText(
        308,
        f"A joint jumps by {_L.jump:g} rad in three samples of one tick, or leaves its speed's integral "
        f"by {_L.drift:g} rad.",
        "An encoder slips or its cable is loose: calibrate it.",
    ),
    Reason.IMU_IMPLAUSIBLE: ReasonText(
        309,
        f"Orientation and rate differ by {_L.imu_drift:g} rad, at rest gravity is {_L.gravity_angle:g} rad off, "
        f"or the mean specific force is outside {_L.gravity_moving[0]:g} to {_L.gravity_moving[1]:g} m/s^2. At rest "
        f"the bounds are {_L.gravity[0]:g} to {_L.gravity[1]:g}. Or two flat feet stand {_L.lean:g} rad off its up for "
        "0.3 s.",
        "The gyro has an offset or the IMU is loose: let it start at rest.",
    ),
    Reason.POSITION: ReasonText(
        401, "A joint is 0.05 rad beyond its range for 3 samples, a leg's for 25.", "Move it back by hand, then reset."
    ),
    Reason.VELOCITY: ReasonText(
        402, "A joint is above 90 % of its speed for 3 samples, a leg's for 25.", "Slow the motion down."
    ),
    Reason.TORQUE: ReasonText(403, "A torque is above 90 % for 50 samples.", "Carry less; look for what it leans on."),
    Reason.BRAKING: ReasonText(
        404, "Braked now, a joint would leave its range, for 3 samples, a leg's for 25.", "Slow down near the ends."
    ),
    Reason.TILT: ReasonText(405, f"The torso leans {_L.tilt:g} rad for 3 samples.", "Lift the robot, then reset."),
    Reason.BASE_STALE: ReasonText(
        406, f"The stack's estimator has found no foot for {_ms(_L.base_age)}.", "Is the stack's estimator alive?"
    ),
    Reason.BALANCE: ReasonText(
        407,
        f"For 30 ms, by the gate's estimate: the capture point is {_L.capture[0]:g} m outside both soles, or "
        f"{_L.capture[1]:g} m while a foot is in the air or landing. Or a robot on its feet, its "
        f"base_link under {LEG - SUNK:.2f} m, sinks at {_L.sinking:g} m/s, or is under {_L.low:g} m.",
        "The legs' controller does not balance: look at its log, and at what pushed.",
    ),
    Reason.STANDING: ReasonText(
        408, "In stop2 the gate's own controller fails, or lets go of the legs.", "See the log of `golem safety`."
    ),
    Reason.WRITERS: ReasonText(501, "Two write what one alone may.", "End the one that the detail names."),
    Reason.HELD: ReasonText(502, "The robot's own controller has the motors.", "`golem safety take --hanging`."),
    Reason.UNHEARD: ReasonText(503, "Nobody receives the motors' commands.", "Wrong interface or domain."),
    Reason.NOT_IN_CONTROL: ReasonText(
        504,
        "Stopped, but another writer's commands reach the motors.",
        "**Alarm: press the hardware e-stop or cut the power**; then end that writer.",
    ),
    Reason.STATE_DAMAGED: ReasonText(
        601, "Three damaged states in a row, or more than 1 in 50.", "Look at the cable; is the firmware another?"
    ),
    Reason.MOTOR: ReasonText(602, "A motor reports an error for 50 ms.", SWITCH),
    Reason.MOTOR_DEAD: ReasonText(
        603,
        f"A motor has less than {_L.dead_share:.0%} of the torque it is asked for, for {_ms(_L.dead_time)}.",
        "Look at its fuse and cable.",
    ),
    Reason.MOTOR_MODE: ReasonText(604, "A motor switched itself off, or mode_machine changed.", SWITCH),
    Reason.MOTOR_HOT: ReasonText(
        605, f"Outside {_L.temperature[0]:g} to {_L.temperature[1]:g} degrees for 50 ms.", "Let it cool down."
    ),
    Reason.MOTOR_VOLTAGE: ReasonText(
        606, f"Outside {_L.voltage[0]:g} to {_L.voltage[1]:g} V for 50 ms.", "Charge or change the battery."
    ),
    Reason.COMMAND_DAMAGED: ReasonText(
        701, "Three damaged commands in a row, or more than 1 in 50.", "The sender sets no checksum, or a wrong type."
    ),
    Reason.COMMAND_MISSING: ReasonText(702, "No command yet.", "Start the stack: `golem up`."),
    Reason.COMMAND_STALE: ReasonText(
        703,
        f"The newest answers a state {_ms(_L.command_age)} old; or for so long all are over {_ms(_L.command_late)}.",
        "The stack is too slow, or has ended.",
    ),
    Reason.COMMAND_TIME: ReasonText(704, f"A stamp more than {_ms(_L.future)} ahead.", "Restart the gate."),
    Reason.COMMAND_INVALID: ReasonText(705, "A number is not finite or above 1e6.", "A bug in the stack: see its log."),
    Reason.COMMAND_UNSTAMPED: ReasonText(
        706, "reserve[0] is 0.", "Copy the tick of the state that the command answers into reserve[0]."
    ),
    Reason.COMMAND_GAINS: ReasonText(
        707,
        "Three commands let a held motor go (kd below 30 % of the servo's for legs, 10 % for the others; legs that "
        "carry with kp below a third and no feed-forward). Or a gain is negative.",
        "A bug in the stack.",
    ),
    Reason.COMMAND_JOLTS: ReasonText(
        709,
        f"A feed-forward torque, or what an arm's motor is asked for, jumps by {JOLT:.0%} of the motor's torque, or a "
        f"leg's by {_L.throw[0]:.0%}, three times within half a second. Or commands in a row throw the legs: three "
        f"by {_L.throw[0]:.0%} of a motor's constant torque, or all by {_L.throw[1]:g} motors'; or {_L.throws} by "
        f"{_L.throw[2]:g} motors' torques together.",
        "A controller that oscillates, or targets that jump.",
    ),
    Reason.COMMAND_BEYOND: ReasonText(
        710,
        "Three commands ask for 5 rad beyond a range, or ten times a speed, torque or gain.",
        "A bug in the stack, or other units than rad and N m.",
    ),
    Reason.COMMAND_HUNG: ReasonText(
        711,
        f"Legs that answered the state ask for the very same 12 targets for {_ms(_L.hung)}, on their feet.",
        "The legs' module hangs, or its answers are sent again.",
    ),
    Reason.COMMAND_AWAY: ReasonText(
        712,
        f"At the activation a motor is not held, or a stiff one's target is {_L.opening[0]:g} rad away. Or one of "
        f"torso and arms would get {_L.opening[1]:.0%} of its torque at once.",
        "The stack does not see where the robot is: start it again.",
    ),
}


def page() -> str:
    """Return the page, in Markdown."""
    lines = [
        "# Safety: every reason\n",
        "`python scripts/safety_page.py docs/reference/safety.md` writes this page from the gate's own",
        "numbers (profile `urdf`).\n",
        "| state | what the motors are told |",
        "| --- | --- |",
        "| init | nothing, or damping if the gate was armed before: something is missing |",
        "| armed | damping; waits for `golem safety activate` |",
        "| active | the stack's commands, limited |",
        "| stop2 | legs stand by a controller of the gate, arms damp; `stop` damps all, `reset`, `activate` go on |",
        "| stop1 | damping, for 3 s |",
        "| stop0 | limp |\n",
        "A stop whose reason leaves state and legs sound leads to stop2, if a foot carried the robot within the last",
        "0.3 s, by the gate's own estimate. Stop2 needs `golem safety --stand`, which `golem launch` gives where a",
        "robot stands. Every other reason leads to stop1. Of several at once the strictest counts.",
        "Of reasons marked *arms* that holds where the legs have no part in it.\n",
        f"A reset waits until {_L.reset_after:g} s after the stop, for a torso that turns at less than "
        f"{_L.at_rest[0]:g} rad/s and",
        f"joints that move at less than {_L.at_rest[1]:g} rad/s. In stop2 the checks of active go on.\n",
        "| number | reason | stop | threshold | what to do |",
        "| --- | --- | --- | --- | --- |",
    ]
    for reason, text in REASONS.items():
        kind = "2" if reason in STAND else "2 (arms)" if reason in ARMS else "1"
        lines.append(f"| {text.number} | `{reason}` | {kind} | {text.threshold} | {text.fix} |")
    return "\n".join(lines) + "\n"


ARMS = frozenset(
    {
        Reason.STATE_FROZEN,
        Reason.STATE_IMPLAUSIBLE,
        Reason.POSITION,
        Reason.VELOCITY,
        Reason.TORQUE,
        Reason.BRAKING,
        Reason.MOTOR_DEAD,
        Reason.WRITERS,
    }
)
"""Reasons that leave the legs sound where they are about the upper body, or about commands."""


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(page(), encoding="utf-8")
