"""Who else may speak to the robot: processes that are none of ours and write what moves it."""

from __future__ import annotations

import threading

from golem.middleware.dds import discovery
from golem.middleware.dds.participant import CycloneParticipant
from golem.middleware.ros import names
from golem.runtime.live.exclusive_writers import owner

MOVING = ("/lowcmd", "/safety/lowcmd_in", "/cmd_vel", "/left/gripper/command", "/right/gripper/command")
"""Topics whose writers move the robot, or may."""
CALLS = ("/safety/", "/estop/", "/skill/", "/launch/", "/left/gripper/", "/right/gripper/", "/api/")
"""How names begin of services and actions whose callers do."""
PERIOD = 2.0
"""Time between two looks [s]."""


def commands(wire: str) -> str:
    """Return the ROS name of a topic on the wire if who writes it asks something of the robot; else an empty string."""
    kind, name = names.from_wire(wire)
    if kind == "topic":
        asks = name in MOVING or (name.startswith("/api/") and name.endswith("/request"))
        return name if asks else ""
    return name if kind == "request" and name.startswith(CALLS) else ""


def unknown_senders(participant: CycloneParticipant) -> list[str]:
    """Return a line for each process that is none of ours and writes what moves the robot: what, and who."""
    found: dict[str, set[str]] = {}
    for writer in discovery.writers(participant):
        name = commands(writer.topic)
        if not name or writer.participant == participant.guid:
            continue
        who = owner(participant, writer.guid)
        if not who.startswith("golem "):
            found.setdefault(who, set()).add(name)
    return [f"{who} ({', '.join(sorted(topics))})" for who, topics in sorted(found.items())]


class SenderWatch:
    """Looks for unknown senders on a thread of its own: a look takes longer than the gate has.

    Attributes:
        found: what the newest look found.
    """

    def __init__(self, participant: CycloneParticipant) -> None:
        """Look around the domain of `participant` until closed."""
        self.found: tuple[str, ...] = ()
        self._participant = participant
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="senders", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop looking."""
        self._over.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._over.wait(PERIOD):
            self.found = tuple(unknown_senders(self._participant))
