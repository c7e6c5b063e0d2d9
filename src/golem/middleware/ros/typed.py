"""Serialisation of messages whose type a topic, service or action prescribes."""

from __future__ import annotations

from typing import Any

from golem.middleware.ros import codec
from golem.middleware.ros.message import CodecError


def check(where: str, message: Any, kind: type[Any]) -> None:
    """Raise unless `message` is a `kind`. Raises CodecError: it is something else.

    Args:
        where: what prescribes it, e.g. `"Topic '/chatter'"`.
        kind: class of the messages that may be sent.
    """
    if not isinstance(message, kind):
        raise CodecError(f"{where} takes a {kind.__msgtype__} here, not {type(message).__name__}.")


def serialize(where: str, message: Any, kind: type[Any]) -> bytes:
    """Return the CDR of `message`, a `kind`; see `check`. Raises CodecError: it is none, or not as defined."""
    check(where, message, kind)
    return codec.serialize(message)
