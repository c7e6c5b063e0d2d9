"""What each hand of a pick reaches: objects to take, and places to let go above."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from golem.capabilities.arms.reach_map import load_map
from golem.skills.context import Context
from golem.skills.pick_config import PickConfig
from golem.types import Array, Side

AROUND: Array = np.array([[0.0, 0.0, 0.0], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]], float)
"""Directions in which something may be elsewhere than the head camera says."""


class HandReach:
    """Asks the map of reach, or the box of the configuration, from where the base is now."""

    def __init__(self, context: Context, config: PickConfig) -> None:
        """Take the base from `context`, and slack, box and heights from `config`."""
        self._T, self._config = context.T_odom_base, config
        self._mapped = config.travel == "planned"

    def takes(self, side: Side, position: Array) -> bool:
        """Return whether a hand comes to an object at `position` (3,) in odom, as far as the head camera tells."""
        x, y, z = p = self._in_base(side, position)
        if self._mapped:
            return any(load_map().serves("right", p + d) for d in self._config.slack * AROUND)
        x0, x1, y0, y1, z0, z1 = self._config.workspace
        return x0 <= x <= x1 and y0 <= y <= y1 and z0 <= z <= z1

    def drops(self, side: Side, places: Array, slack: bool) -> NDArray[np.bool_]:
        """Return (n,) above which of `places` (n, 3) in odom a hand can let go.

        Args:
            side: which hand.
            places: in odom [m].
            slack: whether those count, too, that the head camera may show a little too far away.
        """
        over = self._in_base(side, places + (0.0, 0.0, self._config.drop_height))
        if not self._mapped:
            return over[:, 1] <= self._config.workspace[3]
        around = self._config.slack * AROUND if slack else AROUND[:1]
        return np.array([any(load_map().serves("right", p + d) for d in around) for p in over])

    def drop_order(self, side: Side, places: Array, most: int) -> Array:
        """Return up to `most` of `places` (n, 3) to try: half of them as they come, surely in reach, then near ones.

        Args:
            side: which hand.
            places: in odom [m].
            most: how many.
        """
        over = self._in_base(side, places + (0.0, 0.0, self._config.drop_height))
        surely = np.flatnonzero(self.drops(side, places, slack=False)).tolist()
        away = np.hypot(over[:, 0] - self._config.comfort[0], over[:, 1] - self._config.comfort[1])
        return places[list(dict.fromkeys([*surely[: most // 2], *np.argsort(away).tolist()]))[:most]]

    def discomfort(self, side: Side, position: Array) -> float:
        """Return how far an object at `position` (3,) in odom is from where the arm works best [m]."""
        x, y, _ = self._in_base(side, position)
        return float(np.hypot(x - self._config.comfort[0], y - self._config.comfort[1]))

    def _in_base(self, side: Side, position: Array) -> Array:
        """Return (3,) or (n, 3) `position` in base_link [m], mirrored for the left hand as if it were the right."""
        p = (position - self._T[:3, 3]) @ self._T[:3, :3]
        return p if side == "right" else p * (1.0, -1.0, 1.0)
