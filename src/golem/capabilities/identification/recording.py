"""What a bag tells about a robot's motion: states and commands on one clock."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from golem.errors import GolemError
from golem.middleware.bags.reader import Bag
from golem.middleware.ros.message import NANO
from golem.middleware.wire.convert import decode_low_command, decode_low_state, mode_machine
from golem.middleware.wire.struct_layout import WireError
from golem.types import COMMAND_AGE, NUM_JOINTS, TICK, Array

STATE, COMMAND = "/lowstate", "/lowcmd"
SHORTEST = 20.0
"""Least time under command that something can be identified from [s]."""
LONGEST = 600.0
"""Most of a bag that is looked at [s]."""


class IdentificationError(GolemError):
    """A bag does not tell what a robot is like."""


@dataclass(frozen=True, slots=True)
class Motion:
    """One stretch of motion under command, a row per tick.

    Attributes:
        q, dq, tau: (n, 27) as the motors report them [rad], [rad/s], [N m].
        gyro, acc: (n, 3) as the torso IMU reports them [rad/s], [m/s^2].
        command: (n, 5, 27) newest command: q, dq, tau, kp, kd.
    """

    q: Array
    dq: Array
    tau: Array
    gyro: Array
    acc: Array
    command: Array

    def part(self, rows: slice) -> Motion:
        """Return the ticks `rows` of it."""
        return Motion(*(getattr(self, name)[rows] for name in ("q", "dq", "tau", "gyro", "acc", "command")))


def read_motion(path: Path) -> Motion:
    """Read the longest stretch in which all motors were stiff and commands came.

    Args:
        path: folder of a bag, or an MCAP file, with /lowstate and /lowcmd.

    Raises:
        BagError: there is none, or it is damaged.
        IdentificationError: it lacks a topic, or is shorter than `SHORTEST`.
    """
    bag = Bag(path)
    if missing := [name for name in (STATE, COMMAND) if name not in bag.topics]:
        raise IdentificationError(
            f"The bag {path} has no {' and no '.join(missing)}: it takes {STATE} and {COMMAND}, recorded while the "
            "gate commands the robot."
        )
    rows: dict[str, list[Array]] = {STATE: [], COMMAND: []}
    machine = 0
    for message in bag.messages((STATE, COMMAND)):
        name, t = message.topic.name, message.log_time / NANO
        try:
            if name == STATE:
                machine, state = mode_machine(message.payload), decode_low_state(message.payload)
                row = np.concatenate([[t], state.q, state.dq, state.tau, state.imu.gyro, state.imu.acc])
            else:
                told = decode_low_command(message.payload, t, machine)
                row = np.concatenate([[t], told.q, told.dq, told.tau, told.kp, told.kd])
        except WireError as error:
            raise IdentificationError(f"The bag {path} has a damaged message on {name}: {error}") from error
        rows[name].append(row)
    motion = _stretch(*(_sorted(rows[name]) for name in (STATE, COMMAND)))
    if (seconds := len(motion.q) * TICK) < SHORTEST:
        raise IdentificationError(
            f"The bag {path} has {seconds:.1f} s of stiff motors in a row; identification takes {SHORTEST:g} s or "
            "more, as 'golem identify NEW_BAG --motion' records."
        )
    return motion


def _sorted(rows: list[Array]) -> Array:
    table = np.array(rows or [np.zeros(1)])
    return table[np.argsort(table[:, 0], kind="stable")]


def _stretch(states: Array, commands: Array) -> Motion:
    """Return the longest run of ticks with fresh states and stiff commands; times are the first column of both."""
    seen, told, n = states[:, 0], commands[:, 0], NUM_JOINTS
    begin, end = max(seen[0], told[0]), min(seen[-1], told[-1])
    t = begin + TICK * np.arange(max(0, int(min(end - begin, LONGEST) / TICK)))
    at, newest = (np.searchsorted(times, t + TICK / 4, side="right") - 1 for times in (seen, told))
    fresh = (t - seen[at] < COMMAND_AGE) & (t - told[newest] < COMMAND_AGE)
    good = np.concatenate([[False], fresh & (commands[newest, 1 + 3 * n : 1 + 4 * n] > 0.0).all(axis=1), [False]])
    edges = np.flatnonzero(np.diff(good)).reshape(-1, 2)
    first, last = max(edges.tolist(), key=lambda edge: edge[1] - edge[0], default=[0, 0])
    t = t[first:last]
    columns = [np.interp(t, seen, column) for column in states[:, 1:].T] if len(t) else [t] * (3 * n + 6)
    state = np.column_stack(columns)
    parts = np.split(state, [n, 2 * n, 3 * n, 3 * n + 3], axis=1)
    return Motion(*parts, commands[newest[first:last], 1:].reshape(-1, 5, n))
