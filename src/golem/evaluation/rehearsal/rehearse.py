"""`golem bringup --rehearse`: the whole bring-up with a twin in a process of its own, and a fault it has to find."""

from __future__ import annotations

import json
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

from golem.errors import ConfigError, unknown_name
from golem.evaluation.rehearsal.miswired_twin import FAULTS
from golem.evaluation.rehearsal.scripted_person import ScriptedPerson
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.ros.future import RosError
from golem.runtime.bringup.base import BringupConfig
from golem.runtime.bringup.bringup_command import CHECKS, run_bringup
from golem.runtime.bringup.bringup_report import FILE
from golem.runtime.bringup.robot_link import RobotLink
from golem.runtime.live.launch import Process
from golem.runtime.live.node_setup import log_line, member

START = 180.0
"""How long the twin's start is waited for [s]."""
STACK = """
robot: {{use: 'golem.evaluation.rehearsal.miswired_twin:MiswiredTwin', world: open, fault: {fault}}}
profile: bench
"""


@dataclass(frozen=True)
class BringupCommandConfig(BringupConfig):
    """Bring a robot up step by step: each step is checked, and nothing goes on where one fails.

    A report is written at the end. What passed before is not repeated, but for what has to hold each time.
    """

    rehearse: bool = False
    """Do it with a twin on the domain, which is started, and a scripted person."""
    fault: str = "none"
    """What is wrong with the twin: none, swapped_joints, wrong_sign, silent_estop, missing_camera or tilted_imu."""


def run_bringup_command(config: BringupCommandConfig) -> bool:
    """Bring up the robot on the domain, or rehearse it; return whether all checks passed, or found the fault.

    Raises:
        ConfigError: an option is wrong.
        DdsError, OutputError: see `run_bringup`.
    """
    if config.fault not in FAULTS:
        raise unknown_name("fault of a bring-up", config.fault, FAULTS)
    if not config.rehearse:
        if config.fault != "none":
            raise ConfigError("A fault is built into a twin only: add --rehearse.")
        return run_bringup(config)
    if config.dds.robot:
        raise ConfigError("A rehearsal needs no robot: leave out --robot, or --rehearse.")
    return rehearse(config, config.fault)


def rehearse(config: BringupConfig, fault: str) -> bool:
    """Do the bring-up with a twin that has `fault`; return whether it passed, or failed at the check that finds it."""
    again = [c.name for c in CHECKS if c.lasting and c.name == FAULTS[fault]]
    with tempfile.TemporaryDirectory() as folder:
        stack = Path(folder) / "miswired.yaml"
        stack.write_text(STACK.format(fault=fault), encoding="utf-8")
        person = ScriptedPerson(config.dds, fault)
        twin = Process("twin", ["twin", str(stack), *config.dds.words()])
        try:
            _wait_for_robot(config.dds)
            run_bringup(replace(config, again=(*config.again, *again)), person)
        finally:
            person.leave()
            twin.end()
    rows = json.loads((Path(config.report) / FILE).read_text(encoding="utf-8"))["checks"]
    failed = next((name for name, row in rows.items() if not row["passed"]), "")
    found = failed == FAULTS[fault]
    what = f"'{failed}' failed" if failed else "everything passed"
    log_line(f"Rehearsal with fault '{fault}': {what}; {'right' if found else 'WRONG'}.")
    return found


def _wait_for_robot(dds: DdsConfig) -> None:
    """Wait until the twin is there; a busy machine takes its time to start one.

    Raises:
        RosError: it never came.
    """
    with member("rehearsal", dds) as (participant, node):
        link = RobotLink(participant, node, dds)
        if not link.spin(START, lambda: len(link.states) > 100):
            raise RosError(f"The twin did not start within {START:g} s.")
