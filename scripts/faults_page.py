"""The page of the faults that were tried, from a run of `golem faults`: `python scripts/faults_page.py`."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import tyro

from golem.evaluation.faults.catalogue import FAULTS
from golem.evaluation.faults.rig import FaultSource
from golem.evaluation.harness.records import TrialRecord, read_records
from golem.evaluation.metrics.text_table import TextTable


@dataclass(frozen=True)
class PageConfig:
    """Write the page of the faults that were tried."""

    run: tuple[Path, ...] = (Path("runs/faults"),)
    """Folders that `golem faults` wrote; of a fault that was tried in two the later counts."""
    out: Path = Path("docs/reference/faults.md")
    """The page."""


def page(records: Sequence[TrialRecord]) -> str:
    """Return the page of the trials of one run, in Markdown."""
    by_fault: dict[str, dict[str, TrialRecord]] = defaultdict(dict)
    for record in records:
        by_fault[str(record.case["fault"])][str(record.case["posture"])] = record
    records = [record for row in by_fault.values() for record in row.values()]
    postures = sorted({str(record.case["posture"]) for record in records})
    first = records[0]
    parts = [
        "# Safety: faults tried\n",
        f"`golem faults --profile {first.profile} --seed {first.seed}` tries {len(by_fault)} faults on a robot that "
        f"is {', '.join(postures)}, one trial each.\n"
        f"{_missing(len(records), len(by_fault) * len(postures))}"
        f"{_commits(records)}"
        "`python scripts/faults_page.py` writes this page from its records.\n",
        CRITERIA,
        _summary(records, postures).markdown() + "\n",
    ]
    for source in FaultSource:
        rows = tuple(
            (name, *(_cell(by_fault[name].get(posture)) for posture in postures))
            for name in FAULTS
            if name in by_fault and FAULTS[name].source is source
        )
        if rows:
            parts.append(f"## {HEADS[source]}\n")
            parts.append(TextTable("", ("fault", *postures), rows).markdown() + "\n")
    return "\n".join((*parts, LIVE))


def _missing(tried: int, all_: int) -> str:
    return "" if tried == all_ else f"With this version {tried} of {all_} were tried; the rest is left open.\n"


def _commits(records: Sequence[TrialRecord]) -> str:
    """Say how many trials each version of the code has, where there are several."""
    counts = Counter(record.commit for record in records).most_common()
    said = ", ".join(str(n) for _, n in counts)
    return f"The trials are of {len(counts)} versions of the code: {said}.\n" if len(counts) > 1 else ""


CRITERIA = """\
A judge that shares nothing with the gate looks at every command that reached the motors, and at what the robot really
did. This is what it wants:

- The right reason, in time. One wrong frame has 2 ms of robot time, what is a fault from the third frame on has 6 ms.
  Lost or frozen data has 52 ms. Damaged frames stop from the third in a row on, after 4 ms. One is what every cable
  has now and then, and a stop for it could drop the robot. Meanwhile the last sound command, 6 ms old, holds.
- No command beyond the motors.
- After a fault of commands no joint is 5 % above its speed, or 0.05 rad beyond its range.
- A fault that leaves legs and state sound leaves a robot standing that stood.
- A fault that is to be borne stops nothing.

A cell says where the robot was in the end: active, or the kind of stop. Then follow the reason, and the robot time from
the begin of the fault to the stop. In bold is what the judge did not accept.
"""
LIVE = """\
## With real processes

`golem faults --live --domain 91` launches a hanging twin and tries a few faults on a real domain. One run, on a machine
with a load of 8; times are those of the wall clock, from the fault to the word on `/safety/status`. The gate of a
simulation waits 2 s for commands and states, that of a robot 0.1 and 0.05 s.

| fault | the gate says | after |
|---|---|---|
| operator asks for a stop | `stop_requested` | 0.12 s |
| e-stop pressed | `estop_pressed` | 0.07 s |
| a stranger writes /lowcmd | `not_in_control` | 0.12 s |
| a stranger writes /safety/lowcmd_in | `two_writers` | 0.06 s |
| random bytes as /lowstate | `two_writers` | 0.07 s |
| stack stopped | `command_stale` | 2.03 s |
| stack killed | `command_stale` | 2.01 s |
| twin killed | `state_stale` | 2.04 s |
| gate killed | nothing: no joint moves faster than 1.5 rad/s | |
"""
"""Measured once, by hand."""
HEADS = {
    FaultSource.COMMAND: "Of commands",
    FaultSource.DATA: "Of what the robot says",
    FaultSource.DEVICE: "Of devices and processes",
}


def _summary(records: Sequence[TrialRecord], postures: Sequence[str]) -> TextTable:
    rows = list[tuple[str, ...]]()
    for source in FaultSource:
        for posture in postures:
            mine = [
                r for r in records if r.case["posture"] == posture and FAULTS[str(r.case["fault"])].source is source
            ]
            if not mine:
                continue
            lost: dict[str, int] = defaultdict(int)
            for record in mine:
                if not record.success:
                    lost[record.stage] += 1
            others = ", ".join(f"{stage} {n}" for stage, n in sorted(lost.items())) or "none"
            rows.append((source, posture, f"{sum(r.success for r in mine)} of {len(mine)}", others))
    return TextTable("", ("source", "robot", "accepted", "others"), tuple(rows))


def _cell(record: TrialRecord | None) -> str:
    if record is None:
        return "not tried"
    state = "stop" if "reaction" in record.timings else "active"
    for word in ("stop2", "stop1", "stop0"):
        if word in record.detail:
            state = word
            break
    reason = record.detail.partition(f"{state}, ")[2].partition(":")[0]
    after = f" {reason}, {1e3 * record.timings['reaction']:.0f} ms" if "reaction" in record.timings else ""
    return f"{state}{after}" if record.success else f"{state}{after} **{record.stage}**"


def main() -> None:
    """Write it."""
    config = tyro.cli(PageConfig)
    records = [record for run in config.run for record in read_records(run / "trials.jsonl")]
    config.out.write_text(page(records), encoding="utf-8")


if __name__ == "__main__":
    main()
