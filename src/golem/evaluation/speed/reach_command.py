"""`golem reach`: where the hands can be, before and after the limits were the gate's, as table, picture and map."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from rich.console import Console
from rich.progress import track
from rich.table import Table

from golem.capabilities.arms.base import ARM_COLUMNS
from golem.capabilities.arms.diff_ik import DiffIK
from golem.capabilities.arms.goal_postures import GoalPostures
from golem.capabilities.arms.postures import posture
from golem.capabilities.arms.reach_map import ReachMap, save_map
from golem.capabilities.arms.solve import downward
from golem.capabilities.arms.task_space import TaskSpaceConfig
from golem.capabilities.planning.joint_space import JointSpace, PlanningRobot
from golem.errors import ConfigError
from golem.figures import blank_figure, pixels
from golem.skills.pick_config import PickConfig
from golem.types import NUM_JOINTS, SIDES, UPPER, Array, Side

NEAR = 0.002
"""Distance from a point within which it counts as served [m]."""
LOWER, UPPER_CORNER = (0.24, -0.52, -0.20), (0.72, 0.28, 0.60)
"""Opposite corners of the grid in base_link, right hand [m]: more than the declared workspace on every side."""
OLD_MARGIN = 0.02
"""What inverse kinematics kept from the model's full range before it took the gate's [rad]."""
STEPS = 80


@dataclass(frozen=True)
class ReachConfig:
    """Show where the hands can be, pointing straight down."""

    spacing: float = 0.04
    """Distance between the points of the grid [m]."""
    out: Path | None = None
    """JSON file for the map, which skills ask."""
    picture: Path | None = None
    """PNG file for a picture of it."""


@dataclass(frozen=True, slots=True)
class Reached:
    """What was found of one hand.

    Attributes:
        map: the grid; of the left hand mirrored, so that both have the same points.
        before: (x, y, z) whether the hand is within `NEAR` when inverse kinematics plans in the model's full range and
            the gate clips, as it did.
        touching: (x, y, z) whether the robot touches itself in that posture.
    """

    map: ReachMap
    before: NDArray[np.bool_]
    touching: NDArray[np.bool_]


def run_reach(config: ReachConfig) -> dict[Side, Reached]:
    """Measure, print, and write what was asked for.

    Raises:
        ConfigError: the spacing is out of range, or a file cannot be written.
        MissingExtra: a picture is asked for, and matplotlib is not installed.
    """
    if not 0.01 <= config.spacing <= 0.2:
        raise ConfigError(f"--spacing is {config.spacing}; give 0.01 to 0.2 m.")
    found: dict[Side, Reached] = {side: reach_of(side, config.spacing) for side in SIDES}
    _print(found)
    if config.out is not None:
        save_map(found["right"].map, config.out)
        print(f"Wrote {config.out}")
    if config.picture is not None:
        try:
            Image.fromarray(picture(found)).save(config.picture)
        except OSError as error:
            raise ConfigError(f"Cannot write '{config.picture}': {error.strerror or error}.") from error
        print(f"Wrote {config.picture}")
    return found


def reach_of(side: Side, spacing: float) -> Reached:
    """Return where the hand on `side` can be."""
    robot, finder, old = PlanningRobot(), GoalPostures(), _old_arm()
    home, ready = posture("home"), posture(f"ready_{side}")
    space = JointSpace(robot, home)
    shape = tuple(round((b - a) / spacing) + 1 for a, b in zip(LOWER, UPPER_CORNER, strict=True))
    yaw = PickConfig().yaw
    empty = ReachMap(np.array(LOWER), spacing, yaw, np.full(shape, -1.0), np.zeros(shape))
    before, touching = np.zeros(shape, bool), np.zeros(shape, bool)
    points, sign = empty.points(), 1.0 if side == "right" else -1.0
    rest = space.centre_of_mass(home)
    columns = ARM_COLUMNS[side]
    for index in track(list(np.ndindex(shape)), f"{side} hand"):
        x, y, z = points[index]
        T = downward(x, sign * y, z, sign * yaw)
        targets = (T, None) if side == "left" else (None, T)
        q = _settled(old, targets, ready)
        clipped = np.clip(q, robot.lower, robot.upper)
        away = float(np.linalg.norm(old.kinematics.pose(side, clipped)[:3, 3] - T[:3, 3]))
        before[index] = away <= NEAR
        touching[index] = before[index] and space.verdict(clipped) != 0
        goals = finder.find(*targets, ready, lambda a: space.verdict(a) == 0)
        if len(goals):
            room = np.minimum(goals - robot.lower, robot.upper - goals)[:, columns].min(axis=1)
            best = int(room.argmax())
            empty.margin[index] = max(0.0, float(room[best]))
            empty.com_shift[index] = float(np.linalg.norm((space.centre_of_mass(goals[best]) - rest)[:2]))
    return Reached(empty, before, touching)


def declared(reach: ReachMap) -> NDArray[np.bool_]:
    """Return (x, y, z) which points lie in the box that `pick` declares as its workspace."""
    x0, x1, y0, y1, z0, z1 = PickConfig().workspace
    points = reach.points()
    low, high = np.array((x0, y0, z0)) - 1e-9, np.array((x1, y1, z1)) + 1e-9
    return np.all((points >= low) & (points <= high), axis=-1)


def _old_arm() -> DiffIK:
    ik = DiffIK(
        replace(TaskSpaceConfig(), arm_speed=0.5, torso_speed=0.2, palm_speed=0.2, palm_turn=1.0, collision_rows=0)
    )
    lower, upper = ik.kinematics.stops
    ik.lower[1:], ik.upper[1:] = lower[1:] + OLD_MARGIN, upper[1:] - OLD_MARGIN
    return ik


def _settled(ik: DiffIK, targets: tuple[Array | None, Array | None], start: Array) -> Array:
    """Return the joints (15,) that inverse kinematics ends at from `start`."""
    q = np.zeros(NUM_JOINTS)
    q[UPPER] = start
    ik.reset(q)
    for _ in range(STEPS):
        if ik.step(*targets, q, 1.0).error_position.max() < 1e-4:
            break
    return ik.q.copy()


def _print(found: dict[Side, Reached]) -> None:
    table = Table("hand", "before", "before, and free of itself", "now", "margin, rad", "CoM shift, mm",
                  title="Share of pick's declared workspace that is served within 2 mm")  # fmt: skip
    for side, one in found.items():
        inside = declared(one.map)
        n, served = int(inside.sum()), one.map.served() & inside
        free = one.before & ~one.touching & inside
        table.add_row(
            side,
            *(f"{100 * int(part.sum()) / n:.1f} %" for part in (one.before & inside, free, served)),
            f"{np.median(one.map.margin[served]):.2f}",
            f"{1e3 * np.median(one.map.com_shift[served]):.0f}",
        )
    Console().print(table)
    print(f"{n} points a hand, hand straight down; margin and shift are medians over the points now served.")


def picture(found: dict[Side, Reached]) -> NDArray[np.uint8]:
    """Return (height, width, 3) RGB: slices at several heights, before above, now below, both hands in one plane.

    Raises:
        MissingExtra: matplotlib is not installed.
    """
    grid = found["right"].map
    heights = [-0.12, -0.04, 0.04, 0.20, 0.40]
    figure = blank_figure(1300, 400, facecolor="white")
    axes = figure.subplots(2, len(heights), sharex=True, sharey=True)
    x0, x1, y0, y1, _, _ = PickConfig().workspace
    for column, z in enumerate(heights):
        k = round((z - float(grid.origin[2])) / grid.spacing)
        for row, name in enumerate(("before", "now")):
            ax = axes[row][column]
            for side, colour in zip(SIDES, ("Blues", "Oranges"), strict=True):
                one, sign = found[side], 1.0 if side == "right" else -1.0
                points = one.map.points()[:, :, k]
                value = one.map.margin[:, :, k] if row else np.where(one.before[:, :, k], 0.15, -1.0)
                shown = value >= 0.0
                ax.scatter(
                    sign * points[..., 1][shown], points[..., 0][shown], c=value[shown], cmap=colour,
                    vmin=-0.1, vmax=0.35, s=22, marker="s" if side == "right" else "o", alpha=0.75,
                )  # fmt: skip
                touch = one.touching[:, :, k] if not row else np.zeros_like(shown)
                ax.scatter(sign * points[..., 1][touch], points[..., 0][touch], c="black", s=5, marker="x")
                a, b = sorted((sign * y0, sign * y1))
                ax.plot([a, b, b, a, a], [x0, x0, x1, x1, x0], lw=0.8, c="0.3")
            ax.set_title(f"{name}, z = {z:.2f} m", fontsize=9)
            ax.set_aspect("equal")
            if row == column == 0:
                ax.invert_xaxis()
    figure.supxlabel("y in base_link [m]; blue: left hand, orange: right hand, darker: more margin, x: touches itself")
    figure.supylabel("x in base_link [m]")
    return pixels(figure)
