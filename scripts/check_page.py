"""Writes reports of `golem check --save` into a page, between its two marks, as one table.

    python scripts/check_page.py modules docs/how-to/check-a-module.md all.json
    python scripts/check_page.py engines docs/how-to/engines.md mujoco.json physx.json ...

`modules`: a row per module, with what it keeps, breaks, and is not asked. `engines`: robots side by side, with what
each promise measured, and how far their courses over time are apart.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from golem.evaluation.conformance.base import FAILED, PASSED
from golem.evaluation.conformance.examine import UNCHECKED

MARKS = {"modules": "golem check", "engines": "golem check --compare"}
Findings = dict[str, dict[str, Any]]


def module_table(reports: list[dict[str, Any]]) -> str:
    """Return the table of all modules."""
    rows = ["| slot | module | kept | broken | not asked |", "|---|---|---|---|---|"]
    for report in reports:
        kept = sum(finding["status"] == PASSED for finding in report["findings"])
        failed = [f["check"].replace("_", " ") for f in report["findings"] if f["status"] == FAILED]
        rest = len(report["findings"]) - kept - len(failed)
        lacks = report.get("lacks")
        row = (kept, ", ".join(failed) or "none", rest) if lacks is None else ("-", lacks, "-")
        rows.append(f"| `{report['slot']}` | `{report['use']}` | {row[0]} | {row[1]} | {row[2]} |")
    left_out = [(slot, use, why) for slot, each in UNCHECKED.items() for use, why in each.items()]
    rows += [f"| `{slot}` | `{use}` | - | not checked: {why} | - |" for slot, use, why in left_out]
    return "\n".join(rows)


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


def placed(page: str, table: str, mark: str) -> str:
    """Return the text of a page with a table between its marks."""
    begin, end = f"<!-- {mark}: begin -->", f"<!-- {mark}: end -->"
    before, found, rest = page.partition(begin)
    _, also, after = rest.partition(end)
    if not (found and also):
        raise SystemExit(f"The page lacks the lines '{begin}' and '{end}'.")
    return f"{before}{begin}\n{table}\n{end}{after}"


def main(kind: str, page: str, *files: str) -> None:
    """Write the table of a kind into a page."""
    reports = {Path(file).stem: json.loads(Path(file).read_text(encoding="utf-8")) for file in files}
    if kind == "modules":
        table = module_table([report for rows in reports.values() for report in rows])
    else:
        table = engine_table({name: {f["check"]: f for f in rows[0]["findings"]} for name, rows in reports.items()})
    path = Path(page)
    path.write_text(placed(path.read_text(encoding="utf-8"), table, MARKS[kind]), encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
