"""A table of what common things are like: it needs no network, and answers at once."""

from __future__ import annotations

from dataclasses import dataclass, field

from golem.capabilities.properties.base import Properties
from golem.errors import ConfigError, unknown_name
from golem.package_data import load_data

KNOWN: dict[str, list[float]] = load_data(__package__, "things.yaml")
"""Mass [kg], friction on rubber, stiffness [N/m] of full or whole things as they are sold: estimates, not measured."""


@dataclass(frozen=True)
class PropertyTableConfig:
    """Options of `PropertyTable`.

    Attributes:
        things: mass [kg], friction, stiffness [N/m] by label; they replace and extend what it knows.
    """

    things: dict[str, tuple[float, float, float]] = field(default_factory=dict[str, tuple[float, float, float]])


class PropertyTable:
    """Mass, friction and stiffness by name, from a table; see `PropertySource`."""

    latency = 0.0

    def __init__(self, config: PropertyTableConfig | None = None) -> None:
        """Take the table. Raises ConfigError: a number in it is none that a thing can have."""
        self._things: dict[str, Properties] = {}
        for label, row in {**KNOWN, **(config or PropertyTableConfig()).things}.items():
            try:
                self._things[label] = Properties(*row)
            except ValueError as error:
                raise ConfigError(f"The properties of {label}: {error}.") from error

    def properties(self, label: str) -> Properties:
        if label not in self._things:
            raise unknown_name("thing", label, self._things)
        return self._things[label]
