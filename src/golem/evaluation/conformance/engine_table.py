"""Kept reports of robots side by side: what each promise measured, and how far the courses over time are apart."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from golem.errors import ConfigError
from golem.evaluation.conformance.base import FAILED, PASSED

BEGIN, END = "<!-- golem check --compare: begin -->", "<!-- golem check --compare: end -->"
"""Between these lines of a page stands the table."""
Findings = dict[str, dict[str, Any]]


def read_reports(files: Sequence[Path]) -> dict[str, Findings]:
    """Return the findings of the one report in each file, by check, by the file's name without its ending.

    Raises:
        ConfigError: a file is no report of one module, or two have one name.
    """
    reports: dict[str, Findings] = {}
    for path in files:
        try:
            (report,) = json.loads(path.read_text(encoding="utf-8"))
            findings = {finding["check"]: finding for finding in report["findings"]}
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise ConfigError(
                f"'{path}' is no report of one module; write one with: golem check robot NAME --save {path}."
            ) from error
        if path.stem in reports:
            raise ConfigError(f"Two reports are called '{path.stem}': rename one of the files.")
        reports[path.stem] = findings
    return reports


def engine_table(reports: dict[str, Findings]) -> str:
    """Return a table: a row per promise that measures something or is broken, and per number."""
    first, *others = reports
    checks = list(dict.fromkeys(name for report in reports.values() for name in report))
    shown = [
        check
        for check in checks
        if any(report.get(check, {}).get("figures") for report in reports.values())
        or any(report.get(check, {}).get("status") == FAILED for report in reports.values())
    ]
    rows = [f"| promise | {' | '.join(f'`{name}`' for name in reports)} |", "|---" * (1 + len(reports)) + "|"]
    for check in shown:
        cells = [_cell(report.get(check)) for report in reports.values()]
        rows.append(f"| **{check.replace('_', ' ')}** | {' | '.join(cells)} |")
        rows += _figures(check, reports)
    for check in shown:
        for name, course in (reports[first].get(check, {}).get("figures") or {}).items():
            if isinstance(course, list):
                cells = [_apart(course, reports[other].get(check), name) for other in others]
                rows.append(f"| {name.partition(' [')[0]}, off `{first}` | - | {' | '.join(cells)} |")
    kept = [sum(f["status"] == PASSED for f in report.values()) for report in reports.values()]
    broken = [sum(f["status"] == FAILED for f in report.values()) for report in reports.values()]
    totals = " | ".join(f"{k} kept, {b} broken" for k, b in zip(kept, broken, strict=True))
    return "\n".join([*rows, f"| all | {totals} |"])


def _cell(finding: dict[str, Any] | None) -> str:
    if finding is None:
        return "-"
    if finding["status"] == FAILED:
        return f"**broken**: {finding['reason']}"
    if finding["status"] != PASSED:
        return f"not asked: {finding['reason']}"
    return "kept"


def _figures(check: str, reports: dict[str, Findings]) -> list[str]:
    """Return a row for each number that a check measured in any report."""
    measured = [(report.get(check) or {}).get("figures") or {} for report in reports.values()]
    names = dict.fromkeys(n for figures in measured for n, value in figures.items() if isinstance(value, float))
    return [f"| {name} | {' | '.join(f'{f[name]:.3g}' if name in f else '-' for f in measured)} |" for name in names]


def _apart(course: list[float], finding: dict[str, Any] | None, name: str) -> str:
    """Return the largest distance of two courses, by the largest value of the first."""
    other = ((finding or {}).get("figures") or {}).get(name)
    if not isinstance(other, list) or len(other) != len(course):  # pyright: ignore[reportUnknownArgumentType]
        return "-"
    a, b = np.array(course), np.array(other, float)
    return f"{100.0 * float(np.abs(a - b).max() / np.abs(a).max()):.2g} %"
