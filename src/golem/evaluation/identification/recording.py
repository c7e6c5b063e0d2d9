"""What a bag tells about a robot's motion: states and commands on one clock."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from golem.errors import GolemError
from golem.middleware.bags.reader import Bag
from golem.middleware.ros.message import NANO
from golem.middleware.wire.convert import decode_low_command, decode_low_state, mode_machine
from golem.middleware.wire.struct_layout import WireError
from golem.types import COMMAND_AGE, NUM_JOINTS, TICK, Array

STATE, COMMAND = "/lowstate", "/lowcmd"
SHORTEST, LONGEST = 20.0, 600.0
"""Least time under command that something can be identified from, and most that is looked at [s]."""


class IdentificationError(GolemError):
    """A bag does not tell what a robot is like."""


class RecordedMotion(NamedTuple):
    """One stretch of motion under command, a row per tick.

    q, dq, tau (n, 27) as the motors report them [rad], [rad/s], [N m]; gyro, acc (n, 3) as the torso IMU reports them
    [rad/s], [m/s^2]; command (n, 5, 27), the newest one: q, dq, tau, kp, kd.
    """

    q: Array
    dq: Array
    tau: Array
    gyro: Array
    acc: Array
    command: Array


def read_motion(path: Path) -> RecordedMotion:
    """Read the longest stretch in which all motors were stiff and commands came.

    Args:
        path: folder of a bag, or an MCAP file, with /lowstate and /lowcmd.

    Raises:
        BagError: there is none, or it is damaged.
        IdentificationError: it lacks a topic, has a damaged message, or is shorter than `SHORTEST`.
    """
    bag, machine = Bag(path), 0
    rows: dict[str, list[Array]] = {STATE: [], COMMAND: []}
    if missing := [name for name in rows if name not in bag.topics]:
        raise IdentificationError(f"The bag {path} has no {missing[0]}: it takes {STATE} and {COMMAND}.")
    for message in bag.messages(rows):
        name, t = message.topic.name, message.log_time / NANO
        try:
            if name == STATE:
                machine, s = mode_machine(message.payload), decode_low_state(message.payload)
                rows[name].append(np.concatenate([[t], s.q, s.dq, s.tau, s.imu.gyro, s.imu.acc]))
            else:
                c = decode_low_command(message.payload, t, machine)
                rows[name].append(np.concatenate([[t], c.q, c.dq, c.tau, c.kp, c.kd]))
        except WireError as error:
            raise IdentificationError(f"The bag {path} has a damaged message on {name}: {error}") from error
    states, commands = (np.array(sorted(rows[name], key=lambda row: row[0]) or [[0.0]]) for name in rows)
    seen, told, n = states[:, 0], commands[:, 0], NUM_JOINTS
    begin, end = max(seen[0], told[0]), min(seen[-1], told[-1])
    t = begin + TICK * np.arange(max(0, int(min(end - begin, LONGEST) / TICK)))
    at, newest = (np.searchsorted(times, t + TICK / 4, side="right") - 1 for times in (seen, told))
    good = (t - seen[at] < COMMAND_AGE) & (t - told[newest] < COMMAND_AGE)
    good &= (commands[newest, 1 + 3 * n : 1 + 4 * n] > 0.0).all(axis=1)
    edges = np.flatnonzero(np.diff(np.pad(good, 1))).reshape(-1, 2).tolist()
    first, last = max(edges, key=lambda edge: edge[1] - edge[0], default=(0, 0))
    if (last - first) * TICK < SHORTEST:
        raise IdentificationError(
            f"The bag {path} has {(last - first) * TICK:.1f} s of stiff motors in a row; identification takes "
            f"{SHORTEST:g} s or more, as 'golem identify NEW_BAG --motion' records."
        )
    state = np.column_stack([np.interp(t[first:last], seen, column) for column in states[:, 1:].T])
    q, dq, tau, gyro, acc = np.split(state, [n, 2 * n, 3 * n, 3 * n + 3], axis=1)
    return RecordedMotion(q, dq, tau, gyro, acc, commands[newest[first:last], 1:].reshape(-1, 5, n))
