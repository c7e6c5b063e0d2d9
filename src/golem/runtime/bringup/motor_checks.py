"""The checks with the gate: the hoist, the emergency stop, who has the motors, and the first motion under power."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from golem.hardware.safety.base import SafetyLimits
from golem.hardware.servo.gains import default_gains
from golem.interfaces.payloads import GateState, Reason
from golem.robots.model.table import JOINT_NAMES
from golem.runtime.bringup.base import Act, StepFinding, Task, Workbench
from golem.types import NUM_JOINTS, Array

RISE = 3.0
"""Time in which the gains rise [s]."""
SWING = 0.1
"""How far each joint is sent and back in the first motion [rad]."""
SWINGS = 3
"""How often one that does not answer is sent again, each time `SWING` farther: low gains meet dry friction."""
PULSE = 0.5
"""How long it is sent there [s]."""
ANSWERS = 0.3
"""Share of `SWING` that the joint has to move."""
DRIFT = 0.35
"""How far any joint may move while the gains rise [rad]."""


def check_hoist(bench: Workbench) -> StepFinding:
    """A person says that the robot hangs, its feet clear of the floor, and holds its own stop."""
    ready = bench.person.confirm(
        "The robot hangs, its feet are clear of the floor, and you hold its own emergency stop. Type 'hanging'.",
        "hanging",
    )
    return StepFinding(ready, "a person said so" if ready else "nobody says that the robot hangs")


def check_estop(bench: Workbench) -> StepFinding:
    """The gate hears the button pressed, and released again."""
    bench.need_gate()
    link = bench.link
    patience = bench.config.patience

    def reason() -> Reason | None:
        return None if link.gate is None else link.gate.reason

    silent = (Reason.ESTOP_MISSING, Reason.ESTOP_STALE)
    if not link.spin(patience, lambda: link.gate is not None and reason() not in silent):
        why = "it says nothing" if link.gate is None else link.gate.why
        return StepFinding(False, f"the gate hears no emergency stop: {why}")
    bench.person.act(Task(Act.PRESS, "Press the emergency stop (a virtual one: golem safety press)."))
    asked = time.monotonic()
    if not link.spin(patience, lambda: reason() is Reason.ESTOP_PRESSED):
        return StepFinding(False, f"the button was to be pressed, and no press arrived within {patience:g} s")
    pressed = time.monotonic() - asked
    bench.person.act(Task(Act.RELEASE, "Release it again (golem safety release)."))
    if not link.spin(patience, lambda: link.gate is not None and reason() is not Reason.ESTOP_PRESSED):
        return StepFinding(False, "the button was to be released, and the gate still hears it pressed")
    return StepFinding(True, "pressed and released", {"from the request to the press [s]": round(pressed, 2)})


def check_release(bench: Workbench) -> StepFinding:
    """The robot's own controllers have let go of the motors, and the gate is armed."""
    bench.need_gate()
    link, person, switcher = bench.link, bench.person, bench.link.switcher()
    if not link.spin(10.0, lambda: switcher.known):
        return StepFinding(False, "the robot does not say which of its own controllers has the motors")
    owner = switcher.owner
    if owner:
        if not person.confirm(f"'{owner}' has the motors; released, the robot goes limp. Type 'limp'.", "limp"):
            return StepFinding(False, f"'{owner}' keeps the motors")
        switcher.release()
        if not link.spin(10.0, lambda: switcher.free):
            return StepFinding(False, f"'{owner}' still has the motors: switch to the debug mode by remote control")
    if not link.spin(20.0, lambda: link.gate is not None and link.gate.state is GateState.ARMED):
        why = "it is silent" if link.gate is None else link.gate.why
        return StepFinding(False, f"the gate is not armed: {why}")
    return StepFinding(True, f"released by '{owner}'" if owner else "nobody had them", {"before": owner or "none"})


class LowGainMotion:
    """Commands of the first motion: the posture found, with gains that rise; then one joint at a time, there and back.

    Attributes:
        target: (27,) where the joints are sent [rad].
        level: share of the gains now, 0 to 1.
    """

    def __init__(self, q: Array, share: float) -> None:
        """Hold `q` (27,) [rad] with `share` of the servo's stiffness."""
        gains, limits = default_gains(), SafetyLimits.from_profile()
        self._kp, self._kd = share * gains.kp, np.maximum(share * gains.kd, limits.damping)
        self._rest = np.clip(q, limits.lower, limits.upper)
        self._middle = 0.5 * (limits.lower + limits.upper)
        self.target = self._rest.copy()
        self.level = 0.0

    @property
    def gains(self) -> tuple[Array, Array]:
        """The stiffness and damping to command now, (27,) each."""
        return self.level * self._kp, self._kd

    def send(self, joint: int, swing: float) -> float:
        """Send one joint by `swing` [rad] from its rest towards the middle of its range; return by how much [rad]."""
        self.target = self._rest.copy()
        by = swing if self._rest[joint] < self._middle[joint] else -swing
        self.target[joint] += by
        return by

    def rest(self) -> None:
        """Send every joint back."""
        self.target = self._rest.copy()


def check_motion(bench: Workbench) -> StepFinding:
    """With a share of the gains every motor moves its own joint, in its direction; then the gate stops the robot."""
    bench.need_gate()
    link = bench.link
    seconds = RISE + 2.0 * PULSE * NUM_JOINTS
    text = (
        f"All {NUM_JOINTS} joints move now, one after the other, by {SWING:g} to {SWINGS * SWING:g} rad, for about "
        f"{seconds:.0f} s. Nobody touches the robot or is within its reach. Type 'move'."
    )
    if not bench.person.confirm(text, "move"):
        return StepFinding(False, "nobody says that the robot may move")
    link.states.clear()  # those of before the question, which may have taken long
    if not link.spin(bench.config.patience, link.calm):
        return StepFinding(False, "the robot does not come to rest")
    start = link.states[-1][1].q.copy()
    motion = LowGainMotion(start, bench.config.share)

    def send() -> None:
        link.command(motion.target, *motion.gains)

    link.pass_time(0.5, send)
    answer = link.ask("activate", send)
    if link.gate is None or not link.spin(2.0, _is(bench, GateState.ACTIVE), send):
        return StepFinding(False, f"the gate does not open: {answer}")
    began = link.states[-1][1].t

    drift = 0.0

    def rise() -> None:
        nonlocal drift
        drift = max(drift, float(np.abs(link.states[-1][1].q - start).max()))
        rising = (link.states[-1][1].t - began) / RISE
        motion.level = min(1.0, rising) if drift <= DRIFT else 0.0  # a motor that runs away is let go at once
        send()

    link.pass_time(RISE + 0.5, rise)
    figures: dict[str, float | str] = {}
    wrong = _stopped(bench)
    figures["drift while the gains rise [rad]"] = round(drift, 3)
    if not wrong and drift > DRIFT:
        wrong = f"a joint moved by {drift:.2f} rad while the gains rose"
    worst = 1.0
    for joint in range(NUM_JOINTS):
        if wrong:
            break
        for swing in range(1, SWINGS + 1):
            before = link.states[-1][1].q.copy()
            by = motion.send(joint, swing * SWING)
            link.pass_time(PULSE, send)
            moved = link.states[-1][1].q - before
            motion.rest()
            link.pass_time(PULSE, send)
            if _stopped(bench) or float(np.abs(moved).max()) >= ANSWERS * SWING:
                break
        wrong = _stopped(bench) or answer_problem(joint, moved, by)
        worst = min(worst, float(moved[joint] / by))
    figures["least answer of a joint [1]"] = round(worst, 2)
    asked = time.monotonic()
    link.ask("stop", send)
    if not link.spin(2.0, lambda: link.gate is not None and link.gate.stopped):
        wrong = wrong or "the gate was asked to stop and did not"
    figures["from the request to the stop [s]"] = round(time.monotonic() - asked, 3)
    return StepFinding(not wrong, wrong or f"{NUM_JOINTS} motors move their joints; stopped on request", figures)


def _is(bench: Workbench, state: GateState) -> Callable[[], bool]:
    return lambda: bench.link.gate is not None and bench.link.gate.state is state


def _stopped(bench: Workbench) -> str:
    gate = bench.link.gate
    return "" if gate is None or gate.state is GateState.ACTIVE else f"the gate stopped the robot: {gate.why}"


def answer_problem(joint: int, moved: Array, by: float) -> str:
    """Return what is wrong with the answer to a command that sent one joint by `by` [rad]; empty if nothing is."""
    most = int(np.argmax(np.abs(moved)))
    if moved[joint] * by < 0.0 and abs(moved[joint]) > 0.02:
        return f"{JOINT_NAMES[joint]} was sent by {by:+.2f} rad and moved by {moved[joint]:+.2f}: wrong sign"
    if abs(moved[joint]) < ANSWERS * SWING:
        other = f"; {JOINT_NAMES[most]} moved instead" if abs(moved[most]) > ANSWERS * SWING else ""
        return f"{JOINT_NAMES[joint]} was sent by {by:+.2f} rad and moved by {moved[joint]:+.3f}{other}"
    if most != joint:
        return (
            f"{JOINT_NAMES[joint]} was sent by {by:+.2f} rad, and {JOINT_NAMES[most]} moved further: {moved[most]:+.2f}"
        )
    return ""
