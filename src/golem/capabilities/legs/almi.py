"""The shipped leg policy, trained against an adversary that moves the upper body (the game of ALMI)."""

from __future__ import annotations

from dataclasses import dataclass

from golem.capabilities.legs.description import SHIPPED
from golem.capabilities.legs.policy import Policy, PolicyConfig
from golem.errors import ConfigError

NAME = "almi"
"""Its description and network in `SHIPPED`; `golem train legs` writes them."""


@dataclass(frozen=True, slots=True)
class AlmiConfig:
    """Options of `Almi`.

    Attributes:
        network: another network for the same description, such as a checkpoint of a training run.
    """

    network: str | None = None


class Almi(Policy):
    """Stands, walks and takes pushes with the shipped network; see `Policy`."""

    def __init__(self, config: AlmiConfig | None = None) -> None:
        """Load the shipped description and its network.

        Raises:
            ConfigError: this installation lacks them, or the network given instead does not fit.
        """
        if not (SHIPPED / f"{NAME}.yaml").is_file():
            raise ConfigError(f"This installation has no trained legs ({SHIPPED / NAME}.yaml is absent).")
        super().__init__(PolicyConfig(NAME, (config or AlmiConfig()).network))
