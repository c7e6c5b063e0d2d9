"""A rung without a robot, whose trials are lost by known modules."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from golem.errors import ConfigError
from golem.evaluation.base import Rung, TrialOutcome, TrialSpec
from golem.evaluation.blame.oracles import ORACLES, NotHere

NEEDED: dict[str, tuple[frozenset[str], ...]] = {
    # By index modulo 6: a trial is won where one of these sets is exchanged; an empty set is won at once.
    "one": (frozenset(["arms"]), frozenset(["arms"]), frozenset(), frozenset(), frozenset(), frozenset(["task"])),
    "both": (frozenset(["arms", "head"]),) * 2 + (frozenset(),) * 4,
    "sound": (frozenset(),) * 5 + (frozenset(["task"]),),
}


class Blamed(Rung[Any]):
    """Lose what is known; `hand` harms the third of six trials."""

    name = "blamed"
    profiles = ("field",)
    default_methods = ("one",)

    def methods(self) -> tuple[str, ...]:
        return tuple(NEEDED)

    def config(self, method: str, profile: str, overrides: Mapping[str, str]) -> Mapping[str, Any]:
        for slot, use in overrides.items():
            if slot != "oracle":
                raise ConfigError(f"Unknown slot '{slot}'.")
            for name in use.split("+"):
                if name not in ("arms", "head", "hand"):
                    assert name in ORACLES
                    raise NotHere(f"The oracle '{name}' would exchange nothing here.")
        return dict(overrides)

    def run(self, spec: TrialSpec, artefacts: Path | None) -> TrialOutcome:
        exchanged = set(spec.overrides.get("oracle", "").split("+"))
        needed = NEEDED[spec.method][spec.index % 6]
        if needed - exchanged or (spec.index % 6 == 2 and "hand" in exchanged):
            return TrialOutcome(False, "reach", "upper_body: diff_ik")
        return TrialOutcome(True, "done")
