"""Robot hours under an open safety gate, and how often it stopped a robot that was not meant to be stopped."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from scipy.stats import chi2

HOUR = 3600.0
CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True)
class GateHours:
    """What the gates of some trials did.

    Attributes:
        trials: trials in which it was counted.
        active: robot time in which commands passed [s].
        stops: stops by reason, without those that were asked for.
    """

    trials: int = 0
    active: float = 0.0
    stops: Counter[str] = field(default_factory=Counter[str])

    @classmethod
    def of(cls, costs: Iterable[Mapping[str, Any]]) -> GateHours:
        """Return the sum of lines of `timings.jsonl`; those without a count are left out."""
        counted = [line for line in costs if "active" in line]
        stops = Counter[str]()
        for line in counted:
            stops.update(line["stops"])
        return cls(len(counted), sum(float(line["active"]) for line in counted), stops)

    def __add__(self, other: GateHours) -> GateHours:
        """Return both together."""
        return GateHours(self.trials + other.trials, self.active + other.active, self.stops + other.stops)

    @property
    def most_per_hour(self) -> float:
        """Upper bound of the stops per robot hour, one-sided, 95 % (exact, of a Poisson process); inf without time."""
        if self.active <= 0.0:
            return float("inf")
        return float(chi2.ppf(CONFIDENCE, 2 * (self.stops.total() + 1))) / 2.0 / (self.active / HOUR)

    def sentence(self) -> str:
        """Return it for a page."""
        n = self.stops.total()
        reasons = ", ".join(f"`{reason}` {k}" for reason, k in self.stops.most_common())
        return (
            f"Safety gate: {self.active / HOUR:.3g} robot hours open in {self.trials} trials, "
            f"{n} stop{'' if n == 1 else 's'}{f' ({reasons})' if reasons else ''}; "
            f"with 95 % confidence fewer than {self.most_per_hour:.3g} an hour."
        )
