"""Writes docs/reference/interop.md: `python -m tests.interop.table docs/reference/interop.md`."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from tests.domains import free_domain
from tests.interop.peers import SETUPS, CannotError, Ros, Setup, environment, joined
from tests.interop.rows import Verdict, from_us, to_us, unique

INTRODUCTION = """# Tried against ROS 2

Written by `python -m tests.interop.table docs/reference/interop.md`, which runs every row of
[Interfaces](topics.md) against rclpy, in both directions: ROS 2 {distros}, over Fast DDS and over Cyclone DDS.

A topic is published by one side with the row's QoS and read by the other. A service is called. An action is given a
goal, and sends feedback and a result. All fields hold random values, and what arrives has to be equal to what was sent.
Of what we publish, the QoS and the hash of the type that ROS sees have to be right, too.
In each cell the first word is for what ROS gets of us, the second for what we get of ROS.

- **passed**: as it should be.
- **failed**: not so; why is below.
- **cannot**: it says so at once; why is below.
- **not run**: there was no such ROS 2 on the machine that wrote this page.

Kilted over Cyclone DDS is not a release: rmw_cyclonedds 3.2.0 of the rolling distribution was compiled against Kilted,
with an empty function for the security call that Kilted lacks.
"""


def page() -> str:
    """Return the text of the page; this takes some minutes."""
    verdicts = {setup: _verdicts(setup) for setup in SETUPS}
    heads = ["", *(f"{setup.distro.title()}, {_vendor(setup)}" for setup in SETUPS)]
    lines = [
        INTRODUCTION.format(distros=" and ".join(dict.fromkeys(setup.distro.title() for setup in SETUPS))),
        _row(heads),
        _row(["---"] * len(heads)),
    ]
    for row in unique():
        cells = [" / ".join(v.result for v in verdicts[setup].get(row.name, ())) or "not run" for setup in SETUPS]
        lines.append(_row([f"`{row.name}`", *cells]))
    reasons: dict[str, set[str]] = {}
    for setup, found in verdicts.items():
        for both in found.values():
            for verdict in both:
                if verdict.why:
                    reasons.setdefault(f"{verdict.result}: {verdict.why}", set()).add(str(setup))
    if reasons:
        lines += ["", *(f"- {why} ({', '.join(sorted(where))})." for why, where in reasons.items())]
    return "\n".join(lines) + "\n"


def _verdicts(setup: Setup) -> dict[str, tuple[Verdict, Verdict]]:
    with free_domain() as domain:
        try:
            environment(setup, domain)
        except CannotError as reason:
            print(f"{setup}: {reason}", file=sys.stderr)
            return {}
        with joined(domain) as node:
            ros = Ros(setup, domain)
            try:
                return {row.name: (from_us(row, node, ros), to_us(row, node, ros)) for row in unique()}
            finally:
                ros.close()


def _vendor(setup: Setup) -> str:
    return {"fastdds": "Fast DDS", "cyclonedds": "Cyclone DDS"}[setup.vendor]


def _row(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def main(arguments: Sequence[str]) -> None:
    """Write the page to the file that is named."""
    (path,) = arguments
    Path(path).write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
