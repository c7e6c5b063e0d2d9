"""What a mapper promises: see `golem.capabilities.mapping.base`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from golem.capabilities.mapping.base import Mapper
from golem.capabilities.mapping.map_file import StoredMap
from golem.evaluation.conformance.base import Candidate, check
from golem.evaluation.conformance.room import ROOM, MadeWalk
from golem.evaluation.conformance.samples import with_nan
from golem.evaluation.conformance.suite import Suite
from golem.interfaces.nav_payloads import OccupancyGrid, Scan
from golem.runtime.contract_check import ContractCheck
from golem.types import PlanarPose

SCANS = 8
"""Scans of an empty room that it is given."""
TENTH = 0.1
"""Time of one input [s]."""
FREE, FULL = 20, 60
"""Values of cells up to which one counts as free, and from which on as occupied [own]."""
OFF = 0.25
"""How far from a wall it may be drawn [m] [own]."""


class MapAnswer(NamedTuple):
    """The map, and where it is in odom."""

    grid: OccupancyGrid | None
    place: PlanarPose | None


class MapperSuite(Suite):
    """Inputs are scans of an empty room, answers the map after each."""

    slot, contracts = "mapper", (Mapper,)
    takes = TENTH

    def declared(self, contract: ContractCheck, module: Any) -> None:
        contract.number("rate", module.rate, minimum=0.1)

    def inputs(self) -> Sequence[Scan]:
        """Return scans from the middle of a room."""
        return list(_scans())

    def edges(self) -> Mapping[str, Sequence[Scan]]:
        """Return scans without points, of another clock, repeated, and from far away."""
        scans = self.inputs()
        return {
            "a scan without points": [*scans[:2], replace(scans[2], points=scans[2].points[:0]), *scans[3:5]],
            "a scan of another clock": [*scans[:2], replace(scans[2], t=scans[2].t + 1e6), *scans[3:5]],
            "the same scan again and again": [scans[0]] * 4,
            "a scan from 10 km away": [
                *scans[:2],
                replace(scans[2], points=scans[2].points + 1e4, origin=scans[2].origin + 1e4),
                *scans[3:5],
            ],
        }

    def spoiled(self) -> Mapping[str, Scan]:
        scan = self.inputs()[3]
        return {
            "a point": replace(scan, points=with_nan(scan.points)),
            "the sensor's place": replace(scan, origin=with_nan(scan.origin)),
            "the floor": replace(scan, floor=with_nan(scan.floor)),
        }

    def begin(self, module: Mapper, first: Scan) -> None:
        module.reset()

    def call(self, module: Mapper, given: Scan) -> MapAnswer:
        """Return the map after one scan."""
        module.add_scan(given)
        return MapAnswer(module.grid(), module.T_odom_map)

    def judge(self, contract: ContractCheck, answer: Any) -> None:
        if answer.place is not None:
            contract.kind("T_odom_map", answer.place, PlanarPose)
            for name in ("x", "y", "yaw"):
                contract.number(f"T_odom_map.{name}", getattr(answer.place, name))
        if answer.grid is None:
            return
        grid = contract.kind("the grid", answer.grid, OccupancyGrid)
        contract.kind("origin", grid.origin, PlanarPose)
        for name in ("x", "y", "yaw"):
            contract.number(f"origin.{name}", getattr(grid.origin, name))
        contract.number("resolution", grid.resolution, minimum=1e-3)
        contract.number("t", grid.t)
        cells = contract.array("cells", grid.cells, None, None)
        if cells.dtype != np.int8 or cells.min(initial=0) < -1 or cells.max(initial=0) > 100:
            raise contract.fault("cells are int8 from -1 to 100")

    @check
    def sees_the_floor_and_the_walls(self, candidate: Candidate) -> None:
        """In an empty room cells near the robot are free, and cells next to the walls occupied."""
        answer = self.answers_of(candidate)[-1]
        if answer.grid is None:
            raise candidate.fault("it makes no map of an empty room")
        for x, y in ((1.5, 0.0), (1.5, 1.5), (2.0, -2.0)):
            if not 0 <= _near(answer.grid, x, y, OFF) <= FREE:
                raise candidate.fault(f"the floor at ({x:g}, {y:g}) is not free on its map")
        for x, y in ((ROOM[0, 0], 0.5), (0.5, ROOM[1, 0]), (0.5, ROOM[1, 1])):
            if _near(answer.grid, float(x), float(y), OFF) < FULL:
                raise candidate.fault(f"the wall at ({x:g}, {y:g}) is not on its map")

    @check
    def can_be_kept(self, candidate: Candidate) -> None:
        """What it stores is a map with the cells of its grid, in its own frame, and finite points."""
        module, contract = candidate.make(), candidate.contract
        self.run(candidate, self.inputs(), module)
        stored = contract.kind("what it stores", contract.call(module.stored), StoredMap)
        grid = contract.kind("the grid", contract.call(module.grid), OccupancyGrid).in_map
        contract.array("cloud", stored.cloud, None, 3)
        contract.array("walls", stored.walls, None, 2)
        off = stored.origin.to(grid.origin)
        if stored.cells.shape != grid.cells.shape or (stored.cells != grid.cells).any() or abs(off.x) > 1e-6:
            raise candidate.fault("what it stores is another map than the one it shows")

    @check
    def says_why_it_does_not_locate(self, candidate: Candidate) -> None:
        """Asked for the place in a map before it has seen anything, it says in a sentence why it finds none."""
        module = candidate.make()
        module.reset()
        why = candidate.contract.call(module.locate, PlanarPose(0.0, 0.0, 0.0))
        candidate.contract.kind("what locate returns", why, str)
        if not why:
            raise candidate.fault("it says that it found its place, and has seen nothing")


@lru_cache(maxsize=1)
def _scans() -> tuple[Scan, ...]:
    return tuple(MadeWalk(ROOM, still=100.0, every=4).base_scans(SCANS, np.random.default_rng(2)))


def _near(grid: OccupancyGrid, x: float, y: float, around: float) -> int:
    """Return the highest value of the cells within `around` [m] of a place; -1 beside the map."""
    at = grid.origin.to(PlanarPose(x, y, 0.0))
    n = round(around / grid.resolution)
    row, column = int(at.y // grid.resolution), int(at.x // grid.resolution)
    rows, columns = grid.cells.shape
    part = grid.cells[max(0, row - n) : min(rows, row + n + 1), max(0, column - n) : min(columns, column + n + 1)]
    return int(part.max(initial=-1))
