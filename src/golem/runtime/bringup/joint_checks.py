"""The check that a person makes with the robot: each joint moved by hand, and what reports it."""

from __future__ import annotations

from golem.robots.model.table import JOINT_NAMES, JOINTS
from golem.runtime.bringup.base import Act, StepFinding, Task, Workbench
from golem.runtime.bringup.hand_moves import HandMove, hand_move, wrong_with
from golem.runtime.bringup.joint_motion_words import motion_words


def check_joints(bench: Workbench) -> StepFinding:
    """Each joint, moved by hand, is the one that reports it, with the right sign."""
    bench.person.tell("The robot hangs in its own damping mode. Move one joint at a time, by about 0.2 rad.")
    angles: dict[str, float | str] = {}
    for joint, name in enumerate(JOINT_NAMES):
        wrong, angle = _move(bench, joint)
        if wrong:
            return StepFinding(False, wrong, angles)
        angles[name] = round(angle, 3)
    return StepFinding(True, f"{len(angles)} joints report what was done to them", angles)


def _move(bench: Workbench, joint: int) -> tuple[str, float]:
    """Have one joint moved; return what is wrong, empty if nothing is, and how far it moved [rad]."""
    link, person, name = bench.link, bench.person, JOINT_NAMES[joint]
    link.spin(bench.config.patience, link.calm)
    before = link.state
    if before is None:
        return "the robot fell silent", 0.0
    # Away from the nearer end of its range, where it may hang already.
    positive = bool(before.q[joint] < 0.5 * (JOINTS[joint].lower + JOINTS[joint].upper))
    words = motion_words(joint, before.q, positive)
    link.states.clear()
    move: HandMove | None = None

    def seen() -> bool:
        nonlocal move
        move = hand_move([s for _, s in link.states], before.q)
        return move is not None

    person.act(Task(Act.MOVE, f"Move {name}, so that {words}.", joint, positive))
    link.spin(bench.config.patience, seen)
    person.act(Task(Act.LET_GO, "Let go.", joint))
    if move is None:
        return f"{name} was to be moved, and no joint reports that it alone was", 0.0
    return wrong_with(move, joint, positive, JOINT_NAMES), move.angle
