"""Runs the checks of a bring-up one after the other; see docs/how-to/real-robot.md."""

from __future__ import annotations

import json
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from golem import __version__
from golem.errors import ConfigError, GolemError, unknown_name
from golem.output_file import write_file
from golem.robots.model.pinocchio_model import Kinematics
from golem.robots.model.spatial import skew
from golem.robots.model.table import JOINT_NAMES, JOINTS
from golem.runtime.bringup import base
from golem.runtime.bringup.listening_checks import check_domain, check_sensors, check_state
from golem.runtime.bringup.motor_checks import check_estop, check_hoist, check_motion, check_release
from golem.runtime.bringup.robot_link import RobotLink
from golem.runtime.live.launch import Process
from golem.runtime.live.node_setup import log_line, member
from golem.types import NUM_JOINTS, Array, LowState

FILE, PAGE = "bringup.json", "report.md"


@dataclass(frozen=True, slots=True)
class Entry:
    """What was found, and when (ISO 8601, local time)."""

    at: str
    finding: base.StepFinding


class BringupReport:
    """The findings of one robot, kept in a folder."""

    def __init__(self, folder: Path, where: str) -> None:
        """Go on from what the folder holds of the robot at `where`. Raises ConfigError: no file of that robot."""
        self._folder, self._where = folder, where
        self._entries: dict[str, Entry] = {}
        path = folder / FILE
        if not path.is_file():
            return
        try:
            known: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
            old = str(known["where"])
            self._entries = {
                name: Entry(row["at"], base.StepFinding(row["passed"], row["text"], row["figures"]))
                for name, row in known["checks"].items()
            }
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise ConfigError(f"'{path}' is no file of a bring-up: {error!r}; move it away.") from error
        if old != where:
            raise ConfigError(f"'{path}' is about the robot on {old}, not on {where}: name another --report.")

    def passed(self, name: str) -> bool:
        """Return whether a check has passed before."""
        return name in self._entries and self._entries[name].finding.passed

    def last(self, names: Collection[str]) -> str:
        """Return when the newest of the checks called `names` passed; empty: none has."""
        return max((self._entries[name].at for name in names if self.passed(name)), default="")

    def forget(self, names: Collection[str]) -> None:
        """Forget what the checks called `names` found. Raises OutputError: the folder cannot be written to."""
        self._entries = {name: entry for name, entry in self._entries.items() if name not in names}
        self._write()

    def add(self, name: str, finding: base.StepFinding) -> None:
        """Keep what a check found. Raises OutputError: the folder cannot be written to."""
        self._entries[name] = Entry(datetime.now().astimezone().isoformat(timespec="seconds"), finding)
        self._write()

    def _write(self) -> None:
        rows = {
            name: {"at": e.at, "passed": e.finding.passed, "text": e.finding.text, "figures": e.finding.figures}
            for name, e in self._entries.items()
        }
        write_file(self._folder / FILE, json.dumps({"where": self._where, "checks": rows}, indent=1) + "\n")

    def page(self, checks: Sequence[base.BringupStep]) -> Path:
        """Write the report of all checks; return its path. Raises OutputError: it cannot be written."""
        lines = [f"# Bring-up of the robot on {self._where}", "", f"By GOLEM {__version__}.", ""]
        for check in checks:
            entry = self._entries.get(check.name)
            verdict = "not reached" if entry is None else "passed" if entry.finding.passed else "FAILED"
            lines += [f"## {check.title}: {verdict}", ""]
            if entry is not None:
                lines += [f"{entry.at}: {entry.finding.text}.", ""]
                if entry.finding.figures:
                    lines += ["| what | value |", "| --- | --- |"]
                    lines += [f"| {name} | {value} |" for name, value in entry.finding.figures.items()] + [""]
        return write_file(self._folder / PAGE, "\n".join(lines))


LEVER = 0.08
"""Distance from the axis from which a part visibly moves [m per rad]."""
_AHEAD = (np.array([1.0, 0.0, 0.0]), "forward", "backward")
_LEFT = (np.array([0.0, 1.0, 0.0]), "to the left", "to the right")
_UP = (np.array([0.0, 0.0, 1.0]), "up", "down")


def motion_words(joint: int, q: Array, positive: bool = True) -> str:
    """Return what a person sees when a joint turns, as seen by the robot.

    Args:
        joint: its index in motor order.
        q: (27,) joints of the robot now [rad].
        positive: whether it turns in its positive direction.

    Returns:
        E.g. "the left foot goes backward": of the parts that it moves the first that visibly does.
    """
    kinematics = Kinematics()
    kinematics.update(q)
    row = JOINTS[joint]
    T = kinematics.pose(row.child)
    axis = T[:3, :3] @ row.axis
    moves = [(name, skew(axis) @ (point - T[:3, 3])) for name, point in _parts(joint, kinematics)]
    name, move = next(
        (m for m in moves if np.linalg.norm(m[1]) >= LEVER), max(moves, key=lambda m: np.linalg.norm(m[1]))
    )
    axis, towards, away = max((_AHEAD, _LEFT, _UP), key=lambda d: abs(move @ d[0]))
    return f"{name} goes {towards if (move @ axis > 0.0) == positive else away}"


def _parts(joint: int, kinematics: Kinematics) -> list[tuple[str, Array]]:
    """Return points at the far end of the joint's limb, in base_link [m]."""
    name = JOINT_NAMES[joint]
    side = name.partition("_")[0]
    if name.startswith("torso"):
        return [("the chest", kinematics.pose("torso_link")[:3, 3] + (0.2, 0.0, 0.3))]
    leg = any(part in name for part in ("hip", "knee", "ankle"))
    if leg:
        end = kinematics.pose(f"{side}_ankle_roll_link")[:3, 3]
        return [
            (f"the {side} foot", end),
            (f"the toes of the {side} foot", end + (0.15, 0.0, -0.05)),
            (f"the left edge of the {side} foot", end + (0.0, 0.08, -0.05)),
        ]
    end = kinematics.pose(f"{side}_gripper")[:3, 3]
    return [
        (f"the {side} hand", end),
        (f"the front of the {side} hand", end + (0.1, 0.0, 0.0)),
        (f"the left of the {side} hand", end + (0.0, 0.1, 0.0)),
        (f"the top of the {side} hand", end + (0.0, 0.0, 0.1)),
    ]


ENOUGH = 0.12
"""Angle from which a joint counts as moved by hand [rad]: half the range of the ankle's roll."""
ALONE = 2.0
"""How many times as far as any other it has to have moved."""


@dataclass(frozen=True, slots=True)
class HandMove:
    """A joint that was moved by `angle`, and by `integral` of its speed [rad]."""

    joint: int
    angle: float
    integral: float


def hand_move(states: Sequence[LowState], start: Array) -> HandMove | None:
    """Return the joint that has moved from `start` (27,) [rad] alone, once one has, by `states` since, oldest first.

    None while none has moved by `ENOUGH`, or another more than half as far.
    """
    if len(states) < 2:
        return None
    moved = states[-1].q - start
    order = np.argsort(np.abs(moved))
    first, second = int(order[-1]), int(order[-2])
    if abs(moved[first]) < max(ENOUGH, ALONE * abs(moved[second])):
        return None
    t = np.array([s.t for s in states])
    speed = np.array([s.dq[first] for s in states])
    return HandMove(first, float(moved[first]), float(np.trapezoid(speed, t)))


def wrong_with(move: HandMove, wanted: int, positive: bool, names: Sequence[str]) -> str:
    """Return what is wrong with what was reported of a joint that a person moved; empty if nothing is.

    The person moved the joint `wanted`, an index of the `NUM_JOINTS` names.
    """
    assert len(names) == NUM_JOINTS
    if move.joint != wanted:
        return f"{names[wanted]} was moved, and {names[move.joint]} reports it: the joint order is another"
    if (move.angle > 0.0) != positive:
        direction = "positive" if positive else "negative"
        return f"{names[wanted]} was moved in its {direction} direction and reports {move.angle:+.2f} rad: wrong sign"
    if abs(move.integral - move.angle) > 0.5 * abs(move.angle):
        return f"{names[wanted]} moved by {move.angle:.2f} rad, and its speed says {move.integral:+.2f} rad"
    return ""


def check_joints(bench: base.Workbench) -> base.StepFinding:
    """Each joint, moved by hand, is the one that reports it, with the right sign."""
    bench.person.tell("The robot hangs in its own damping mode. Move one joint at a time, by about 0.2 rad.")
    angles: dict[str, float | str] = {}
    for joint, name in enumerate(JOINT_NAMES):
        wrong, angle = _move(bench, joint)
        if wrong:
            return base.StepFinding(False, wrong, angles)
        angles[name] = round(angle, 3)
    return base.StepFinding(True, f"{len(angles)} joints report what was done to them", angles)


def _move(bench: base.Workbench, joint: int) -> tuple[str, float]:
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

    person.act(base.Task(base.Act.MOVE, f"Move {name}, so that {words}.", joint, positive))
    link.spin(bench.config.patience, seen)
    person.act(base.Task(base.Act.LET_GO, "Let go.", joint))
    if move is None:
        return f"{name} was to be moved, and no joint reports that it alone was", 0.0
    return wrong_with(move, joint, positive, JOINT_NAMES), move.angle


CHECKS: tuple[base.BringupStep, ...] = (
    base.BringupStep("domain", "The robot alone on its domain", check_domain),
    base.BringupStep("hoist", "Hung up", check_hoist),
    base.BringupStep("state", "What it reports", check_state),
    base.BringupStep("joints", "Joint order and signs, by hand", check_joints, lasting=True),
    base.BringupStep("estop", "The emergency stop, pressed", check_estop),
    base.BringupStep("release", "Its own controllers let go", check_release),
    base.BringupStep("motion", "First motion, with low gains", check_motion, lasting=True),
    base.BringupStep("sensors", "Cameras, LiDAR, hands", check_sensors, lasting=True),
)
"""In this order; each needs those before it."""


class Terminal:
    """A person at a terminal; see `BringupPerson`."""

    def tell(self, text: str) -> None:
        log_line(text)

    def confirm(self, question: str, word: str) -> bool:
        """Ask; the end of the input is a no."""
        try:
            return input(f"{question}\n> ").strip() == word
        except EOFError:
            return False

    def act(self, task: base.Task) -> None:
        log_line(f"  -> {task.text}")


def run_bringup(config: base.BringupConfig, person: base.BringupPerson | None = None) -> bool:
    """Do what has not passed yet; return whether everything has by the end.

    Raises:
        ConfigError: an option is wrong, or the report is another robot's.
        DdsError: the domain cannot be joined.
        OutputError: the report cannot be written.
    """
    person = person or Terminal()
    lasting = [check.name for check in CHECKS if check.lasting]
    for name in config.again:
        if name not in lasting:
            raise unknown_name("check that lasts", name, lasting)
    report = BringupReport(Path(config.report), str(config.dds))
    stops = ["--black-box", f"{config.report}/stops"]
    words = ["safety", *stops, *config.estop.words(), *config.dds.words()]
    with member("bringup", config.dds) as (participant, node):
        link = RobotLink(participant, node, config.dds)
        bench = base.Workbench(link, person, config, lambda: Process("safety", words))
        try:
            done = run_checks(bench, report, CHECKS, config.again)
        finally:
            if bench.gate is not None:
                bench.gate.end()
            person.tell(f"Report: {report.page(CHECKS)}")
    return done


def run_checks(
    bench: base.Workbench, report: BringupReport, checks: tuple[base.BringupStep, ...], again: Collection[str]
) -> bool:
    """Do the checks in order, those left out that last and have passed; return whether none failed."""
    tell = bench.person.tell
    lasting = [check.name for check in checks if check.lasting]
    if at := report.last(lasting):
        text = f"Checks passed before, on {at}. It is the same robot, and nothing was rewired since: type 'same'."
        report.forget(again if bench.person.confirm(text, "same") else lasting)
    for number, check in enumerate(checks, 1):
        head = f"{number}/{len(checks)} {check.title}"
        if check.lasting and report.passed(check.name):
            tell(f"{head}: has passed before.")
            continue
        tell(f"{head} ...")
        try:
            finding = check.run(bench)
        except GolemError as error:
            finding = base.StepFinding(False, str(error))
        report.add(check.name, finding)
        tell(f"{head}: {'passed' if finding.passed else 'FAILED'}: {finding.text}.")
        if not finding.passed:
            tell("It goes no further until this passes; start 'golem bringup' again then. Keep the robot hung: once")
            tell("its own controllers have let go of the motors, nobody holds them when this ends.")
            return False
    return True
