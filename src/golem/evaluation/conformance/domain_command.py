"""`golem check robot --domain N`: the suite of robots for whatever robot is on a domain."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

import tyro
from tyro.conf import OmitArgPrefixes

from golem.errors import ConfigError
from golem.evaluation.conformance.base import Candidate
from golem.evaluation.conformance.check_command import Output, show
from golem.evaluation.conformance.domain_rig import DomainRig
from golem.evaluation.conformance.domain_suite import DomainSuite
from golem.evaluation.conformance.examine import run_suite
from golem.evaluation.rehearsal.scripted_person import ScriptedPerson
from golem.hardware.estop.estop_config import EstopConfig
from golem.middleware.dds.domain import DdsConfig
from golem.runtime.bringup.base import BringupConfig, Task, Workbench
from golem.runtime.bringup.bringup_command import Terminal
from golem.runtime.bringup.listening_checks import frozen_groups
from golem.runtime.bringup.robot_link import RobotLink
from golem.runtime.live.launch import Process
from golem.runtime.live.node_setup import log_line, member

FIRST = 20.0
"""How long a robot is waited for [s]."""


@dataclass(frozen=True)
class DomainCheckConfig(Output):
    """Check the robot on a domain against the promises of robots.

    It is listened to first. Then it is moved, through a safety gate that this starts, once somebody has typed that it
    hangs in its hoist. Exit code 0: all promises are kept. 1: one is broken.
    """

    slot: Annotated[str, tyro.conf.Positional] = "robot"
    """What is on the domain: robot."""
    yes: bool = False
    """Say that the robot hangs: it is moved without a further question."""
    without: tuple[str, ...] = ()
    """Devices that this robot does not have, e.g. "lidar" "left hand"."""
    estop: EstopConfig = field(default_factory=EstopConfig)
    """The emergency stop; a real robot has a serial one."""
    dds: OmitArgPrefixes[DdsConfig] = field(default_factory=DdsConfig)


class _Beside(Terminal):
    """Whoever is beside a robot: at a terminal; a virtual button is pressed for them."""

    def __init__(self, config: DomainCheckConfig) -> None:
        self._yes = config.yes
        self._button = ScriptedPerson(config.dds, "none") if config.estop.use == "virtual" else None

    def confirm(self, question: str, word: str) -> bool:
        """Ask, unless --yes has answered."""
        return self._yes or super().confirm(question, word)

    def act(self, task: Task) -> None:
        """Have it done."""
        (self._button or super()).act(task)


def run_domain_check(config: DomainCheckConfig) -> bool:
    """Check the robot and print the report; return whether it keeps all promises.

    Raises:
        ConfigError: an option is wrong.
        DdsError: the domain cannot be joined.
    """
    if config.slot != "robot":
        raise ConfigError(
            f"On a domain a robot is checked, not '{config.slot}': golem check robot --domain N."
        )
    bringup = BringupConfig(without=config.without, estop=config.estop, dds=config.dds)
    with member("check", config.dds) as (participant, node):
        link = RobotLink(participant, node, config.dds)
        link.spin(FIRST, lambda: len(link.states) > 200)
        still = not config.dds.robot and bool(frozen_groups([state for _, state in link.states]))
        words = ["safety", "--black-box", "None", *(["--still"] if still else [])]
        words += [*config.estop.words(), *config.dds.words()]
        bench = Workbench(link, _Beside(config), bringup, lambda: Process("safety", words))
        rig = DomainRig(bench, participant, lambda: Process("safety", [*words, "--strict"]))
        subject = Candidate("robot", str(config.dds), lambda: rig)
        try:
            report = run_suite(DomainSuite(rig), subject, lambda check: log_line(f"{check.promise}"))
        finally:
            rig.close()
    show([report], config, whole=True)
    return report.passed
