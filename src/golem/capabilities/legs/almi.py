"""The shipped legs: two networks, each trained against an adversary that moves the upper body (the game of ALMI).

One walks, the other stands: a network for both was worse at both (docs/how-to/train-legs.md).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from golem.capabilities.legs.description import SHIPPED
from golem.capabilities.legs.handover import Handover, HandoverConfig, HandoverPart
from golem.errors import ConfigError

WALK, STAND = "almi_walk", "almi_stand"
"""Their descriptions and networks in `SHIPPED`; `golem train legs` writes them."""
Ground = Literal["even", "rough"]
NETWORKS: dict[Ground, str] = {"even": f"{WALK}.onnx", "rough": f"{WALK}_rough.onnx"}
"""Walking networks in `SHIPPED`, for the same description."""

SHOVED = 0.55
"""Deviation from the twist beyond which a robot that walks is caught [m/s] [own: without a shove it is up to 0.45 at
the corners of the envelope; a shove of 40 N s makes 0.6]."""


@dataclass(frozen=True, slots=True)
class AlmiConfig:
    """Options of `Almi`.

    Attributes:
        ground: what the shipped walking network is for: `even` floors, on which it takes the larger shoves, or `rough`
            ones, with stones and steps of 5 cm.
        walk, stand: other networks for the same descriptions, as `golem train legs export` writes them.
    """

    ground: Ground = "even"
    walk: str | None = None
    stand: str | None = None


class Almi(Handover):
    """Walks as told with one shipped network, stands and takes shoves with the other; see `Handover`, `Policy`."""

    def __init__(self, config: AlmiConfig | None = None) -> None:
        """Load the shipped networks. Raises ConfigError: they are not there, or one given instead does not fit."""
        config = config or AlmiConfig()
        for name in (WALK, STAND):
            if not (SHIPPED / f"{name}.yaml").is_file():
                raise ConfigError(f"This installation has no trained legs ({SHIPPED / name}.yaml is absent).")
        walker = config.walk or str(SHIPPED / NETWORKS[config.ground])
        walk = HandoverPart("policy", {"file": WALK, "network": walker})
        stand = HandoverPart("policy", {"file": STAND, "network": config.stand})
        super().__init__(HandoverConfig(walk, stand, shoved=SHOVED))
