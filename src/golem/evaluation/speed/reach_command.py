"""`golem reach`: where the hands can be, as table, picture and map."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from rich.console import Console
from rich.progress import track
from rich.table import Table

from golem.capabilities.arms.base import ARM_COLUMNS
from golem.capabilities.arms.goal_postures import GoalPostures
from golem.capabilities.arms.postures import downward, posture
from golem.capabilities.arms.reach_map import ReachMap, save_map
from golem.capabilities.planning.joint_space import JointSpace, PlanningRobot
from golem.errors import ConfigError
from golem.figures import blank_figure, pixels
from golem.skills.pick_config import PickConfig
from golem.types import SIDES, Side

LOWER, UPPER_CORNER = (0.24, -0.52, -0.20), (0.72, 0.28, 0.60)
"""Opposite corners of the grid in base_link, right hand [m]: more than the declared workspace on every side."""


@dataclass(frozen=True)
class ReachConfig:
    """Show where the hands can be, pointing straight down."""

    spacing: float = 0.04
    """Distance between the points of the grid [m]."""
    out: Path | None = None
    """JSON file for the map, which skills ask."""
    picture: Path | None = None
    """PNG file for a picture of it."""


def run_reach(config: ReachConfig) -> dict[Side, ReachMap]:
    """Measure, print, and write what was asked for; the map of the left hand is mirrored: both have the same points.

    Raises:
        ConfigError: the spacing is out of range, or a file cannot be written.
        MissingExtra: a picture is asked for, and matplotlib is not installed.
    """
    if not 0.01 <= config.spacing <= 0.2:
        raise ConfigError(f"--spacing is {config.spacing}; give 0.01 to 0.2 m.")
    found: dict[Side, ReachMap] = {side: reach_of(side, config.spacing) for side in SIDES}
    _print(found)
    if config.out is not None:
        save_map(found["right"], config.out)
        print(f"Wrote {config.out}")
    if config.picture is not None:
        try:
            Image.fromarray(picture(found)).save(config.picture)
        except OSError as error:
            raise ConfigError(f"Cannot write '{config.picture}': {error.strerror or error}.") from error
        print(f"Wrote {config.picture}")
    return found


def reach_of(side: Side, spacing: float) -> ReachMap:
    """Return where the hand on `side` can be."""
    robot, finder = PlanningRobot(), GoalPostures()
    home, ready = posture("home"), posture(f"ready_{side}")
    space = JointSpace(robot, home)
    shape = tuple(round((b - a) / spacing) + 1 for a, b in zip(LOWER, UPPER_CORNER, strict=True))
    yaw = PickConfig().yaw
    found = ReachMap(np.array(LOWER), spacing, yaw, np.full(shape, -1.0), np.zeros(shape))
    points, sign = found.points(), 1.0 if side == "right" else -1.0
    rest = space.centre_of_mass(home)
    columns = ARM_COLUMNS[side]
    for index in track(list(np.ndindex(shape)), f"{side} hand"):
        x, y, z = points[index]
        T = downward(x, sign * y, z, sign * yaw)
        targets = (T, None) if side == "left" else (None, T)
        goals = finder.find(*targets, ready, lambda a: space.verdict(a) == 0)
        if len(goals):
            room = np.minimum(goals - robot.lower, robot.upper - goals)[:, columns].min(axis=1)
            best = int(room.argmax())
            found.margin[index] = max(0.0, float(room[best]))
            found.com_shift[index] = float(np.linalg.norm((space.centre_of_mass(goals[best]) - rest)[:2]))
    return found


def declared(reach: ReachMap) -> NDArray[np.bool_]:
    """Return (x, y, z) which points lie in the box that `pick` declares as its workspace."""
    x0, x1, y0, y1, z0, z1 = PickConfig().workspace
    points = reach.points()
    low, high = np.array((x0, y0, z0)) - 1e-9, np.array((x1, y1, z1)) + 1e-9
    return np.all((points >= low) & (points <= high), axis=-1)


def _print(found: dict[Side, ReachMap]) -> None:
    table = Table("hand", "served", "margin, rad", "CoM shift, mm",
                  title="Share of pick's declared workspace in which a hand can stand straight down")  # fmt: skip
    for side, reach in found.items():
        inside = declared(reach)
        n, served = int(inside.sum()), reach.served() & inside
        margin, shift = np.median(reach.margin[served]), 1e3 * np.median(reach.com_shift[served])
        table.add_row(side, f"{100 * int(served.sum()) / n:.1f} %", f"{margin:.2f}", f"{shift:.0f}")
    Console().print(table)
    print(f"{n} points a hand; margin and shift are medians over those served.")


def picture(found: dict[Side, ReachMap]) -> NDArray[np.uint8]:
    """Return (height, width, 3) RGB, slices at several heights, of both hands. Raises MissingExtra: no matplotlib."""
    grid = found["right"]
    heights = [-0.12, -0.04, 0.04, 0.20, 0.40]
    figure = blank_figure(1300, 240, facecolor="white")
    axes = figure.subplots(1, len(heights), sharex=True, sharey=True)
    x0, x1, y0, y1, _, _ = PickConfig().workspace
    for ax, z in zip(axes, heights, strict=True):
        k = round((z - float(grid.origin[2])) / grid.spacing)
        for side, colour in zip(SIDES, ("Blues", "Oranges"), strict=True):
            reach, sign = found[side], 1.0 if side == "right" else -1.0
            points, margin = reach.points()[:, :, k], reach.margin[:, :, k]
            shown = margin >= 0.0
            ax.scatter(
                sign * points[..., 1][shown], points[..., 0][shown], c=margin[shown], cmap=colour,
                vmin=-0.1, vmax=0.35, s=22, marker="s" if side == "right" else "o", alpha=0.75,
            )  # fmt: skip
            a, b = sorted((sign * y0, sign * y1))
            ax.plot([a, b, b, a, a], [x0, x0, x1, x1, x0], lw=0.8, c="0.3")
        ax.set_title(f"z = {z:.2f} m", fontsize=9)
        ax.set_aspect("equal")
    axes[0].invert_xaxis()
    figure.supxlabel("y in base_link [m]; blue: left hand, orange: right hand, darker: more margin")
    figure.supylabel("x in base_link [m]")
    return pixels(figure)
