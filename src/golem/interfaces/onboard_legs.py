"""What the on-board controller tells the legs, as the vendor's motor command and back."""

from __future__ import annotations

import numpy as np

from golem.interfaces.payloads import LegCommand
from golem.middleware.dds.base import Payload
from golem.middleware.wire import hg
from golem.middleware.wire.convert import decode_low_command, encode_low_command
from golem.types import LEGS, NUM_JOINTS, LowCommand

_TO_SERVO = 1
"""Index in `reserve` of the word that says whether the feed-forward torque is left to the servo."""


def encode_legs(command: LegCommand) -> bytes:
    """Return leg targets as a `LowCmd_` whose other motors get zero gains and zero torque.

    Raises:
        WireError: a value is not finite in single precision.
    """
    whole = {name: np.zeros(NUM_JOINTS) for name in ("q", "dq", "tau", "kp", "kd")}
    for name in ("q", "kp", "kd"):
        whole[name][LEGS] = getattr(command, name)
    if command.tau is not None:
        whole["tau"][LEGS] = command.tau
    payload = bytearray(encode_low_command(LowCommand(0.0, **whole), 0))
    hg.LOW_CMD.read(payload)["reserve"][_TO_SERVO] = command.tau is None
    hg.COMMAND_CHECKSUM.seal(payload)
    return bytes(payload)


def decode_legs(payload: Payload) -> LegCommand:
    """Return the leg targets in a `LowCmd_`.

    Raises:
        WireError: see `decode_low_command`.
    """
    whole = decode_low_command(payload, 0.0)
    to_servo = bool(hg.LOW_CMD.read(payload)["reserve"][_TO_SERVO])
    return LegCommand(whole.q[LEGS], whole.kp[LEGS], whole.kd[LEGS], None if to_servo else whole.tau[LEGS])
