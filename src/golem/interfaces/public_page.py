"""Writes docs/reference/topics.md from the table: `python -m golem.interfaces.public_page docs/reference/topics.md`."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

from golem.interfaces import public
from golem.interfaces.public import Role
from golem.middleware.dds.base import Qos

WHO: dict[Role, str] = {
    "robot": "robot: `golem twin`, or the H1-2 and its drivers",
    "safety": "`golem safety`",
    "stack": "`golem up`",
    "user": "you",
}
"""Heading of each role."""
SHORT: dict[Role, str] = {"robot": "robot", "safety": "safety", "stack": "up", "user": "you"}
INTRODUCTION = """# Interfaces

Written by `python -m golem.interfaces.public_page docs/reference/topics.md` from `golem.interfaces.public`, which is
what the processes create their endpoints from; tests compare this page with the table, and the table with what running
processes offer. Names are those of ROS 2. On the wire the topic `/x` is `rt/x`: `/lowstate` is
the vendor's `rt/lowstate`.

- Time: messages from robot and stack are stamped with robot time, which is `/clock` and the tick of `/lowstate`; the
  safety process stamps by a clock of its own, the time since boot. Goals of actions are stamped by the wall clock.
- Frames: REP-103 and REP-105. `odom` coincides with the levelled `base_link` at the start; the link `pelvis` coincides
  with `base_link`; optical frames have z forward.
- Units: SI. Quaternions on ROS topics are xyzw, in the vendor's messages wxyz.
- Images, /tf, /joint_states and whatever else is volatile and costs much is made only while somebody subscribes.
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
                ("topic", "type", "QoS", "Hz", "frame", "read by", "what"),
                (
                    (
                        f"`{row.name}`",
                        f"`{row.type}`",
                        _qos(row.qos),
                        "on event" if row.rate is None else f"{row.rate:g}",
                        f"`{row.frame}`" if row.frame else "",
                        ", ".join(SHORT[reader] for reader in row.to),
                        row.text,
                    )
                    for row in rows
                ),
            )
        )
    parts.append("## Services\n")
    served = ((f"`{s.name}`", f"`{s.type}`", SHORT[s.by], s.text) for s in public.SERVICES)
    parts.append(_table(("service", "type", "by", "what"), served))
    parts.append(
        "`golem launch` offers `/launch/restart_twin`, `/launch/restart_safety` and `/launch/restart_up` "
        f"(`{public.TRIGGER}`) beside these: they are about processes, not about the robot.\n"
    )
    parts.append("## Actions\n")
    acted = ((f"`{a.name}`", f"`{a.type}`", SHORT[a.by], a.text) for a in public.ACTIONS)
    parts.append(_table(("action", "type", "by", "what"), acted))
    parts.append("## Left out on purpose\n")
    parts.append("\n".join(f"- `{name}`: {why}" for name, why in public.ABSENT.items()) + "\n")
    return "\n".join(parts)


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def _qos(qos: Qos) -> str:
    words = ["reliable" if qos.reliable else "best effort"]
    if qos.transient_local:
        words.append("transient local")
    words.append("keep all" if qos.depth is None else f"keep {qos.depth}")
    return ", ".join(words)


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(page(), encoding="utf-8")
