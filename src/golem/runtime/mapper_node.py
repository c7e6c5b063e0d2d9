"""The node of the mapper: scans in, the map of the floor and its place in odom out."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from golem.capabilities.mapping.base import Mapper
from golem.capabilities.mapping.map_file import StoredMap, save_map
from golem.errors import OutputError
from golem.interfaces import topics
from golem.interfaces.nav_payloads import HERE, MapFile, MapPlace, OccupancyGrid
from golem.middleware.bus import Bus, News
from golem.runtime.contract_check import ContractCheck
from golem.types import PlanarPose


class MapperNode:
    """Runs a mapper: every scan at once, a grid when one is due and something new was seen."""

    period = math.inf
    wakes = topics.SCAN, topics.MAP_SAVE

    def __init__(self, bus: Bus, mapper: Mapper, contract: ContractCheck) -> None:
        """Run `mapper`."""
        self._bus, self._mapper, self._contract = bus, mapper, contract
        self._every = 1.0 / contract.number("rate", mapper.rate, minimum=0.1)
        self._scans = News(bus, topics.SCAN)
        self._wanted = News(bus, topics.MAP_SAVE)
        self._due = 0.0

    def step(self, t: float) -> None:
        """Pass a new scan on, publish the map if it is due, and keep it if a skill wants that."""
        wanted = self._wanted.read()
        if wanted is not None:
            self._bus.publish(topics.MAP_SAVED, self._kept(wanted.path), t)
        scan = self._scans.read()
        if scan is None:
            return
        call = self._contract.call
        call(self._mapper.add_scan, scan)
        place = call(lambda: self._mapper.T_odom_map)
        if place is not None:
            self._contract.kind("T_odom_map", place, PlanarPose)
            for name in ("x", "y", "yaw"):
                self._contract.number(f"T_odom_map.{name}", getattr(place, name))
            self._bus.publish(topics.MAP_POSE, MapPlace(t, place, self._estimate_in_map(place)), t)
        if t < self._due - 1e-9:
            return
        self._due = t + self._every
        grid = call(self._mapper.grid)
        if grid is not None:
            self._contract.kind("the grid", grid, OccupancyGrid)
            cells = self._contract.array("cells", grid.cells, None, None)
            if cells.dtype != np.int8:
                raise self._contract.fault(f"cells are {cells.dtype}, the contract asks for int8")
            self._contract.number("resolution", grid.resolution, minimum=1e-3)
            self._bus.publish(topics.MAP, grid, t)

    def _kept(self, path: str) -> MapFile:
        """Write the map, and say how that went."""
        stored = self._contract.call(self._mapper.stored)
        if stored is None:
            return MapFile(path, "There is no map yet.")
        self._contract.kind("what it stores", stored, StoredMap)
        try:
            save_map(Path(path), stored)
        except OutputError as problem:
            return MapFile(path, str(problem))
        return MapFile(path)

    def _estimate_in_map(self, T_odom_map: PlanarPose) -> PlanarPose:
        """Return where odom of the base estimate is in the map: /tf has base_link in that odom."""
        odometry, base = self._bus.latest(topics.ODOMETRY), self._bus.latest(topics.BASE)
        if odometry is None or base is None:
            return T_odom_map.to(HERE)
        T_map_base = T_odom_map.to(PlanarPose.of(odometry.T_odom_base))
        return T_map_base @ PlanarPose.of(base.T_odom_base).to(HERE)
