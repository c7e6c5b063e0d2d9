"""What has passed, in a file that the next session goes on from, and the report for people."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from golem import __version__
from golem.errors import ConfigError
from golem.output_file import write_file
from golem.runtime.bringup.base import BringupStep, StepFinding

FILE, PAGE = "bringup.json", "report.md"


@dataclass(frozen=True, slots=True)
class Entry:
    """What was found, and when (ISO 8601, local time)."""

    at: str
    finding: StepFinding


class BringupReport:
    """The findings of one robot, kept in a folder."""

    def __init__(self, folder: Path, where: str) -> None:
        """Go on from what the folder holds of the robot at `where`, if anything.

        Raises:
            ConfigError: its file cannot be read, or is about another robot.
        """
        self._folder, self._where = folder, where
        self._entries: dict[str, Entry] = {}
        path = folder / FILE
        if not path.is_file():
            return
        try:
            known: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
            old = str(known["where"])
            self._entries = {
                name: Entry(row["at"], StepFinding(row["passed"], row["text"], row["figures"]))
                for name, row in known["checks"].items()
            }
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise ConfigError(f"'{path}' is no file of a bring-up: {error!r}; move it away.") from error
        if old != where:
            raise ConfigError(f"'{path}' is about the robot on {old}, not on {where}: name another --report.")

    def passed(self, name: str) -> bool:
        """Return whether a check has passed before."""
        return name in self._entries and self._entries[name].finding.passed

    def add(self, name: str, finding: StepFinding) -> None:
        """Keep what a check found.

        Raises:
            OutputError: the folder cannot be written to.
        """
        self._entries[name] = Entry(datetime.now().astimezone().isoformat(timespec="seconds"), finding)
        rows = {
            name: {"at": e.at, "passed": e.finding.passed, "text": e.finding.text, "figures": e.finding.figures}
            for name, e in self._entries.items()
        }
        write_file(self._folder / FILE, json.dumps({"where": self._where, "checks": rows}, indent=1) + "\n")

    def page(self, checks: Sequence[BringupStep]) -> Path:
        """Write the report of all checks; return its path.

        Raises:
            OutputError: it cannot be written.
        """
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
