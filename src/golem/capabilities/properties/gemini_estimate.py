"""Gemini as a source of properties: DeliGrasp's question for mass, friction and stiffness, asked once for each name."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, cast

from golem.capabilities.perception.gemini_service import GeminiService, GeminiServiceConfig, read_json
from golem.capabilities.properties.base import BOUNDS, Properties
from golem.errors import ServiceUnavailable, shorten


@dataclass(frozen=True)
class GeminiEstimateConfig(GeminiServiceConfig):
    """Options of `GeminiEstimate`; see `GeminiServiceConfig`, and this.

    Attributes:
        latency: declared time of an answer [s].
    """

    model: str = "gemini-2.5-flash"
    latency: float = 2.0


class GeminiEstimate:
    """Mass, friction and stiffness as a language model estimates them; see `PropertySource`."""

    def __init__(self, config: GeminiEstimateConfig | None = None, sleep: Callable[[float], None] = time.sleep) -> None:
        """Take the key from the environment. Raises ConfigError: there is none."""
        self.config = config or GeminiEstimateConfig()
        self.latency = self.config.latency
        self._service = GeminiService(
            self.config, "The source of properties gemini", "take the table: properties: {use: table}", sleep
        )
        self._known: dict[str, Properties] = {}

    @property
    def asked(self) -> int:
        """Questions asked so far."""
        return self._service.asked

    def properties(self, label: str) -> Properties:
        """Return the model's estimate; see `PropertySource`.

        Raises ServiceUnavailable: no answer in time, a refusal, nonsense, or the budget of questions is used up.
        """
        if label not in self._known:
            self._known[label] = read_properties(self._service.ask(({"text": _question(label)},)), label)
        return self._known[label]


def _question(label: str) -> str:
    return (
        f"A robot's hand with two flat rubber pads is to pick up one {label.replace('_', ' ')} as it is in a home. "
        "Estimate its mass in kilograms with what is usually in it, the coefficient of friction between it and rubber, "
        "and its stiffness in newtons per metre when the pads press it together. Answer with JSON and nothing else: "
        '{"mass": NUMBER, "friction": NUMBER, "stiffness": NUMBER}.'
    )


def read_properties(text: str, label: str) -> Properties:
    """Return the properties that the model's words hold: JSON, bare or fenced.

    Raises ServiceUnavailable: they hold none, or numbers that no thing for a hand has.
    """
    said = read_json(text)
    fields = cast("Mapping[str, Any]", said) if isinstance(said, Mapping) else {}
    values = [fields.get(name) for name in BOUNDS]
    if not all(isinstance(value, int | float) and not isinstance(value, bool) for value in values):
        raise ServiceUnavailable(f"Gemini gave no {', '.join(BOUNDS)} of the {label}: '{shorten(text.strip(), 60)}'.")
    try:
        return Properties(*(float(cast("float", value)) for value in values))
    except ValueError as error:
        raise ServiceUnavailable(f"Gemini's estimate of the {label} cannot be meant: {error}.") from error
