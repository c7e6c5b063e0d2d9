"""What a trial may measure, and how it is called and shown."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from golem.package_data import load_data


@dataclass(frozen=True, slots=True)
class Metric:
    """How one scalar is shown.

    Attributes:
        label: its name in words.
        unit: the unit it is shown in.
        scale: that unit per SI unit.
        signed: whether it may be negative.
    """

    label: str
    unit: str = ""
    scale: float = 1.0
    signed: bool = False

    @property
    def share(self) -> bool:
        """Whether it is a share of what was asked, 0 to 1, in one trial."""
        return self.unit == "%"

    @property
    def bounds(self) -> tuple[float, float]:
        """Between what its values must lie, in SI units."""
        return (0.0, 1.0) if self.share else (-math.inf if self.signed else 0.0, math.inf)


SCALES = {"deg": math.degrees(1.0), "%": 100.0}
"""Unit in which a metric is shown -> that unit per SI unit, where `metrics.yaml` does not say."""


def _metrics() -> dict[str, Metric]:
    rows: dict[str, dict[str, Any]] = load_data(__package__, "metrics.yaml")
    for row in rows.values():
        row.setdefault("scale", SCALES.get(row.get("unit", ""), 1.0))
    return {name: Metric(**row) for name, row in rows.items()}


METRICS: dict[str, Metric] = _metrics()
"""Name -> how it is shown."""


def metric(name: str) -> Metric:
    """Return how the scalar `name` is shown; one that is not declared, as it is."""
    words = name.replace("_", " ")
    claim = Metric(words, "%", 100.0) if name.startswith("said_") else Metric(words, signed=True)
    return METRICS.get(name, claim)
