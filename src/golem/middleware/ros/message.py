"""What every message class has in common, and the errors of messages."""

from __future__ import annotations

from dataclasses import fields
from typing import ClassVar

import numpy as np

from golem.errors import GolemError

NANO = 1_000_000_000
"""Nanoseconds in a second: ROS counts time in both."""


class CodecError(GolemError):
    """A message cannot be written as its type says, or bytes are not a message of the type they should be of."""


class Message:
    """A ROS message: a dataclass whose fields are those of its definition, each with the default of ROS.

    Numbers are Python's; a sequence or array of numbers is a one-dimensional numpy array of the definition's very
    type, any other sequence a list. Two messages are equal if they have the same type and equal fields; NaN is not
    equal to NaN.

    Attributes:
        __msgtype__: name of the type, e.g. `"sensor_msgs/msg/Image"`.
    """

    __slots__ = ()
    __msgtype__: ClassVar[str]

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Message) or other.__msgtype__ != self.__msgtype__:
            return NotImplemented
        return all(_equal(getattr(self, f.name), getattr(other, f.name)) for f in fields(self))  # type: ignore[arg-type]

    __hash__ = None  # type: ignore[assignment]


def _equal(a: object, b: object) -> bool:
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return np.array_equal(np.asarray(a), np.asarray(b))
    return a == b
