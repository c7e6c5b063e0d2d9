"""Rows and columns of the paper's table of grasps, and which of them this machine cannot fill, and why."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from golem import registry
from golem.capabilities.grasping.base import Gripper
from golem.errors import GolemError
from golem.evaluation.metrics.published import GGX_F
from golem.types import Detection, LocalizedObject

SCREW, FRIDGE = "screw", "fridge"


@dataclass(frozen=True, slots=True)
class TableRow:
    """One task at one level of autonomy.

    Attributes:
        task, level: in words.
        rung: the rung that tries it.
        options: of the rung.
        after: level of the same task that this one adds a difficulty to, or takes one from; empty of the first.
        use: what else is replaced in its stacks, as `golem ladder --use` has it.
    """

    task: str
    level: str
    rung: str
    options: Mapping[str, Any] = field(default_factory=dict[str, Any])
    after: str = ""
    use: tuple[str, ...] = ()

    @property
    def key(self) -> str:
        """What a command calls it, and its folder."""
        return f"{self.rung}-truth" if self.use else self.rung

    @property
    def name(self) -> str:
        """What people call it."""
        return f"{self.task}, {self.level}"


@dataclass(frozen=True, slots=True)
class TableColumn:
    """One way to grasp.

    Attributes:
        head: in words.
        method: the grasp method.
        tasks: that it is for.
        paper: what the paper calls it; empty where it has none.
    """

    head: str
    method: str
    tasks: tuple[str, ...] = (SCREW, FRIDGE)
    paper: str = ""


TRUTH = ("localizer=truth",)
"""The simulator's masks in the localizer's place: so perception and grasping are told apart."""
VARIED: Mapping[str, Any] = {"layout": "varied"}
ROWS: tuple[TableRow, ...] = (
    TableRow(FRIDGE, "tether", "fridge-tether", VARIED),
    TableRow(FRIDGE, "stand", "fridge-stand", VARIED, "tether"),
    TableRow(FRIDGE, "stand, true masks", "fridge-stand", VARIED, "stand", TRUTH),
    TableRow(SCREW, "tether", "tether", VARIED),
    TableRow(SCREW, "stand", "stand", VARIED, "tether"),
    TableRow(SCREW, "stand, true masks", "stand", VARIED, "stand", TRUTH),
    TableRow(SCREW, "var. stand", "var-stand", {**VARIED, "start": ["placed"], "dock": ["no"]}, "stand"),
)
COLUMNS: tuple[TableColumn, ...] = (
    TableColumn("centroid", "centroid", paper="Cent."),
    TableColumn("antipodal", "antipodal", paper="Antip."),
    TableColumn("antipodal, reranked", "reranked"),
    TableColumn("scorer", "scorer"),
    TableColumn("GraspGen", "graspgen", paper="GGX"),
    TableColumn("GraspGen, reranked", GGX_F, paper="GGX-F"),
    TableColumn("look-and-move", "look_and_move", (SCREW,)),
    TableColumn("visual servo", "visual_servo", (SCREW,), paper="C-VS"),
)
WAIT = 2.0
"""Time that a GraspGen server gets to show that it is there [s]."""


def absence(column: TableColumn) -> str | None:
    """Return in a sentence why a column stays empty on this machine; None where it can be measured."""
    if "graspgen" not in column.method:
        return None
    # What its server answers to a ball tells whether it is there.
    points = np.random.default_rng(0).normal(size=(500, 3))
    points = 0.03 * points / np.linalg.norm(points, axis=1, keepdims=True)
    seen = Detection("ball", 1.0, np.zeros(4), np.zeros(2))
    ball = LocalizedObject(seen, 0.0, np.zeros(3), points)
    try:
        method: Any = registry.create("grasp_method", "graspgen", {"timeout": WAIT})
        method.propose(ball, points, Gripper("right", np.eye(4), 0.0))
    except GolemError as error:
        return f"{column.head}: {error}"
    return None
