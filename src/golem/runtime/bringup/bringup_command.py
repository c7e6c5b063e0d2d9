"""Runs the checks of a bring-up one after the other; see docs/how-to/real-robot.md."""

from __future__ import annotations

from collections.abc import Callable, Collection
from pathlib import Path

from golem.errors import unknown_name
from golem.runtime.bringup.base import (
    BringupConfig,
    BringupPerson,
    BringupStep,
    StepFinding,
    StepRefused,
    Task,
    Workbench,
)
from golem.runtime.bringup.bringup_report import BringupReport
from golem.runtime.bringup.joint_checks import check_joints
from golem.runtime.bringup.listening_checks import check_domain, check_state
from golem.runtime.bringup.motor_checks import check_estop, check_hoist, check_motion, check_release
from golem.runtime.bringup.robot_link import RobotLink
from golem.runtime.bringup.sensor_checks import check_sensors
from golem.runtime.live.launch import Process
from golem.runtime.live.node_setup import log_line, member

CHECKS: tuple[BringupStep, ...] = (
    BringupStep("domain", "The robot alone on its domain", check_domain),
    BringupStep("hoist", "Hung up", check_hoist),
    BringupStep("state", "What it reports", check_state),
    BringupStep("joints", "Joint order and signs, by hand", check_joints, lasting=True),
    BringupStep("estop", "The emergency stop, pressed", check_estop),
    BringupStep("release", "Its own controllers let go", check_release),
    BringupStep("motion", "First motion, with low gains", check_motion, lasting=True),
    BringupStep("sensors", "Cameras, LiDAR, hands", check_sensors, lasting=True),
)
"""In this order; each needs those before it."""


class Terminal:
    """A person at a terminal."""

    def tell(self, text: str) -> None:
        """Print."""
        log_line(text)

    def confirm(self, question: str, word: str) -> bool:
        """Ask; the end of the input is a no."""
        try:
            return input(f"{question}\n> ").strip() == word
        except EOFError:
            return False

    def act(self, task: Task) -> None:
        """Print what is to be done."""
        log_line(f"  -> {task.text}")


def run_bringup(config: BringupConfig, person: BringupPerson | None = None) -> bool:
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
        bench = Workbench(link, person, config, lambda: Process("safety", words))
        try:
            done = run_checks(bench, report, CHECKS, config.again)
        finally:
            if bench.gate is not None:
                bench.gate.end()
    person.tell(f"Report: {report.page(CHECKS)}")
    return done


def run_checks(
    bench: Workbench,
    report: BringupReport,
    checks: tuple[BringupStep, ...],
    again: Collection[str],
    tell: Callable[[str], None] | None = None,
) -> bool:
    """Do the checks in order, those left out that last and have passed; return whether none failed."""
    tell = tell or bench.person.tell
    for number, check in enumerate(checks, 1):
        head = f"{number}/{len(checks)} {check.title}"
        if check.lasting and report.passed(check.name) and check.name not in again:
            tell(f"{head}: has passed before.")
            continue
        tell(f"{head} ...")
        try:
            finding = check.run(bench)
        except StepRefused as refusal:
            finding = StepFinding(False, str(refusal))
        report.add(check.name, finding)
        tell(f"{head}: {'passed' if finding.passed else 'FAILED'}: {finding.text}.")
        if not finding.passed:
            tell("It goes no further until this passes; start 'golem bringup' again then.")
            return False
    return True
