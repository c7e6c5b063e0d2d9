"""Places on the floor in a goal, which is plain numbers: x and y of each, one after the other."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from golem.errors import ConfigError
from golem.types import Array


def floor_places(what: str, numbers: Sequence[float]) -> Array:
    """Return (n, 2) the places that `numbers` name.

    Args:
        what: which goal has them, for the error.
        numbers: x, y of each [m].

    Raises:
        ConfigError: they are no pairs, or not finite.
    """
    if len(numbers) % 2 or not all(map(math.isfinite, numbers)):
        raise ConfigError(f"The places of {what} are pairs of finite numbers, x and y of each place.")
    return np.array(numbers, float).reshape(-1, 2)


def stands_at(position: Array, places: Array, within: float) -> bool:
    """Return whether `position` (2,) or (3,) is, over the floor, less than `within` [m] from one of `places` (n, 2)."""
    return bool((np.linalg.norm(places - position[:2], axis=1) < within).any())
