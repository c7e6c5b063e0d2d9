"""Writes docs/reference/topics.md from the table: `python scripts/topics_page.py docs/reference/topics.md`."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from textwrap import fill

from golem.interfaces import public
from golem.interfaces.rows import Role, TopicRow
from golem.middleware.dds.base import Qos

WHO: dict[Role, str] = {
    "robot": "robot: `golem twin`, or the H1-2 and its drivers",
    "safety": "`golem safety`",
    "stack": "`golem up`",
    "user": "you",
}
"""Heading of each role."""
SHORT: dict[Role, str] = {"robot": "robot", "safety": "safety", "stack": "up", "user": "you"}
# fmt: off
ABSENT: dict[str, str] = {
    "/sportmodestate":
        "The vendor's simulator publishes the true position and velocity of the robot on it. No module of GOLEM reads "
        "ground truth, and the robot has none to publish; the estimate is on /odom.",
    "/secondary_imu": "Published for the G1 only; the H1-2's torso IMU is in /lowstate.",
    "/lf/bmsstate": "The twin has no battery; invented figures would be worse than none.",
}
"""Topics of the vendor's own simulators that are left out on purpose, and why."""
# fmt: on
INTRODUCTION = """# Interfaces

`python scripts/topics_page.py docs/reference/topics.md` writes this page from `golem.interfaces.public`.
The processes create their endpoints from the same table, and tests compare the table with running processes. Names are
those of ROS 2. On the wire the topic `/x` is `rt/x`: `/lowstate` is the vendor's `rt/lowstate`.

- Time: messages from robot and stack are stamped with robot time, which is `/clock` and the tick of `/lowstate`. The
  safety process stamps with its own clock, the time since boot. Goals of actions are stamped with the wall clock.
- Frames: REP-103 and REP-105. `odom` coincides with the levelled `base_link` at the start; the link `pelvis` coincides
  with `base_link`; optical frames have z forward.
- Units: SI. Quaternions on ROS topics are xyzw, in the vendor's messages wxyz.
- What is sent "on demand" is made only while somebody subscribes.
- QoS is what the writer offers. What you send is read best effort, so that you may offer either.
- Types `golem_interfaces/...` are in `ros/golem_interfaces`, with units and frames in their comments.
- `SafetyStatus.reason` is a value of `Reason` in `golem.hardware.safety.base`.
- A goal that cannot be pursued is accepted and aborted at once: `SkillResult.stage` is "refused", `reason` a sentence.
"""


def page() -> str:
    """Return the text of docs/reference/topics.md."""
    parts = [INTRODUCTION]
    for role, who in WHO.items():
        rows = [row for row in public.TOPICS if row.by == role]
        parts.append(f"## Topics from {who}\n")
        parts.append(
            _table(
                ("topic", "what", "type", "QoS", "Hz", "frame", "read by"),
                (
                    (
                        f"`{row.name}`",
                        row.text,
                        f"`{row.type}`",
                        _qos(row.qos),
                        _rate(row),
                        f"`{row.frame}`" if row.frame else "",
                        ", ".join(SHORT[reader] for reader in row.to),
                    )
                    for row in rows
                ),
            )
        )
    parts.append("## Services\n")
    served = ((f"`{s.name}`", f"`{s.type}`", SHORT[s.by], s.text) for s in public.SERVICES)
    parts.append(_table(("service", "type", "by", "what"), served))
    parts.append(
        "`golem launch` also offers `/launch/restart_twin`, `/launch/restart_safety` and `/launch/restart_up`\n"
        f"(`{public.TRIGGER}`). They restart processes and do not command the robot.\n"
    )
    parts.append("## Actions\n")
    acted = ((f"`{a.name}`", f"`{a.type}`", SHORT[a.by], a.text) for a in public.ACTIONS)
    parts.append(_table(("action", "type", "by", "what"), acted))
    parts.append("## Left out on purpose\n")
    absent = (f"- `{name}`: {why}" for name, why in ABSENT.items())
    parts.append("\n".join(fill(line, 120, subsequent_indent="  ") for line in absent) + "\n")
    return "\n".join(parts)


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def _rate(row: TopicRow) -> str:
    rate = "on event" if row.rate is None else f"{row.rate:g}"
    return f"{rate}, on demand" if row.on_demand else rate


def _qos(qos: Qos) -> str:
    words = ["reliable" if qos.reliable else "best effort"]
    if qos.transient_local:
        words.append("transient local")
    words.append("keep all" if qos.depth is None else f"keep {qos.depth}")
    return ", ".join(words)


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(page(), encoding="utf-8")
