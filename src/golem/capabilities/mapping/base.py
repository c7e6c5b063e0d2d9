"""The contract of a mapper: posed scans in, an occupancy grid of the floor out, and where the map is in odom."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from golem.capabilities.mapping.map_file import StoredMap
from golem.interfaces.nav_payloads import OccupancyGrid, Scan
from golem.types import PlanarPose


@runtime_checkable
class Mapper(Protocol):
    """Remembers what scans saw.

    A point that is not finite, and a scan of another clock, is left out.

    Attributes:
        rate: grids per second that are asked of it [Hz].
    """

    rate: float

    @property
    def T_odom_map(self) -> PlanarPose | None:
        """Where the map's frame is in odom: at its origin, unless the map was made before; None while not known."""
        ...

    def reset(self) -> None:
        """Forget what was seen in this run."""

    def add_scan(self, scan: Scan) -> None:
        """Take one scan, at 10 Hz."""

    def grid(self) -> OccupancyGrid | None:
        """Return the map of the floor as it is now, its origin in odom; None while there is none."""
        ...

    def stored(self) -> StoredMap | None:
        """Return what there is, to be kept in a file; None before anything was seen."""
        ...

    def locate(self, guess: PlanarPose) -> str:
        """Look for the robot's place in the map it was given, by the newest scan.

        Args:
            guess: where base_link roughly is in the map's frame.

        Returns:
            One sentence why it is not found; empty where it is, and `T_odom_map` has changed.
        """
        ...
