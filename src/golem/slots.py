"""What a stack is made of: slots with the implementations that come with this package, and the keys of a stack file.

The rows are in `slots.yaml`, beside this file: a new implementation is one line there. A new slot is a row of `slots`,
one of `keys`, and its node in `golem.runtime.node_groups`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from golem.package_data import load_data


@dataclass(frozen=True, slots=True)
class Slot:
    """One kind of module.

    Attributes:
        contract: the protocol that its modules satisfy, `package.module:Class`.
        shipped: implementations of this package by name, each `package.module:Class`.
        supplied: parameters of a constructor that the stack fills in; they are no options.
        files: endings of files that can be used themselves, without a class: which implementation takes them, by its
            option `file`.
    """

    contract: str
    shipped: Mapping[str, str]
    supplied: tuple[str, ...] = ()
    files: Mapping[str, str] = field(default_factory=dict[str, str])


@dataclass(frozen=True, slots=True)
class StackKey:
    """A key of the stack file under which one implementation is chosen.

    Attributes:
        slot: of which slot.
        default: the implementation where the file does not have the key.
        standing: the same for a robot that stands on its feet; None: no other.
    """

    slot: str
    default: str
    standing: str | None = None


_DATA = load_data(__package__, "slots.yaml")
SLOTS: dict[str, Slot] = {
    name: Slot(row["contract"], row["shipped"], tuple(row.get("supplied", ())), row.get("files", {}))
    for name, row in _DATA["slots"].items()
}
"""Every slot by name."""
KEYS: dict[str, StackKey] = {name: StackKey(**row) for name, row in _DATA["keys"].items()}
"""Where a stack has one module each, by key of the stack file. Skills, of which it has any number, are no key."""
PARTS: dict[str, str] = _DATA["parts"]
"""What has options in a stack file and no alternatives: key -> its dataclass, `package.module:Class`."""
