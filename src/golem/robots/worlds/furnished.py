"""A hall with what a hall has, drawn from a seed, a corridor without any feature, and people who walk about.

The robot starts at the origin and heads along x. Nothing stands in the lane `LANE`, and nobody walks there.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import cv2
import mujoco
import numpy as np

from golem.robots.worlds import hall, parts
from golem.robots.worlds.layout import yaw_quat
from golem.robots.worlds.parts import BOX, CAPSULE, CYLINDER, SPHERE
from golem.types import Array

AREA = (1.8, 4.3, -2.4, 2.6)
"""x and y bounds of where obstacles stand [m]."""
WAY = 0.75
"""Distance from obstacles that a way from start to goal has everywhere [m]: the robot's half width and some more."""
START, GOAL = (0.0, 0.0), (6.0, 0.0)
"""Places between which there is a way [m]."""
TRIES = 400
CELL = 0.05


@dataclass(frozen=True, slots=True)
class CourseObstacle:
    """A box, or an upright cylinder, on the floor.

    Attributes:
        place: (2,) x, y of its middle [m].
        size: (3,) half sides of a box [m]; radius, radius and half height of a cylinder.
        yaw: heading of a box [rad].
        round: whether it is a cylinder.
    """

    place: Array
    size: Array
    yaw: float
    round: bool


def draw_course(rng: np.random.Generator, count: int) -> tuple[CourseObstacle, ...]:
    """Return `count` obstacles, fewer where no more fit with a way left between: walls, boxes and posts."""
    placed: list[CourseObstacle] = []
    for _ in range(TRIES):
        if len(placed) == count:
            break
        one = _draw(rng, wall=not placed)
        if passable([*placed, one]):
            placed.append(one)
    return tuple(placed)


def passable(obstacles: Sequence[CourseObstacle]) -> bool:
    """Return whether a way leads from `START` to `GOAL` that is `WAY` from every obstacle."""
    x0, x1, y0, y1 = -0.8, 7.0, -3.4, 3.6
    free = np.full((round((y1 - y0) / CELL), round((x1 - x0) / CELL)), 255, np.uint8)
    for one in obstacles:
        corners = (outline(one) - (x0, y0)) / CELL
        cv2.fillConvexPoly(free, np.round(corners).astype(np.int32), 0)
    clear = cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) * CELL >= WAY
    count, label = cv2.connectedComponents(clear.astype(np.uint8))
    start, goal = (label[round((y - y0) / CELL), round((x - x0) / CELL)] for x, y in (START, GOAL))
    return count > 1 and start != 0 and start == goal


def outline(one: CourseObstacle) -> Array:
    """Return the (n, 2) corners of an obstacle on the floor [m]."""
    if one.round:
        turns = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
        return one.place + one.size[0] * np.column_stack([np.cos(turns), np.sin(turns)])
    c, s = np.cos(one.yaw), np.sin(one.yaw)
    corners = one.size[:2] * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    return one.place + corners @ np.array([[c, s], [-s, c]])


def _draw(rng: np.random.Generator, wall: bool) -> CourseObstacle:
    """Draw one obstacle; the first is a wall across the lane, so that no straight line leads to the goal."""
    kind = 0 if wall else int(rng.integers(0, 4))
    x0, x1, y0, y1 = AREA
    place = rng.uniform((x0, y0), (x1, y1))
    if kind == 0:
        half = rng.uniform(0.5, 1.0)
        if wall:
            place = np.array([rng.uniform(2.4, 4.0), rng.uniform(-0.5, 0.5)])
        yaw = np.pi / 2 + rng.uniform(-0.4, 0.4)
        return CourseObstacle(place, np.array([half, 0.06, rng.uniform(0.5, 1.1)]), float(yaw), False)
    if kind == 1:
        size = rng.uniform((0.15, 0.15, 0.12), (0.4, 0.4, 0.6))
        return CourseObstacle(place, size, float(rng.uniform(0.0, np.pi)), False)
    if kind == 2:
        radius = rng.uniform(0.06, 0.2)
        return CourseObstacle(place, np.array([radius, radius, rng.uniform(0.4, 1.2)]), 0.0, True)
    # A workbench.
    size = np.array([rng.uniform(0.3, 0.6), rng.uniform(0.25, 0.4), 0.45])
    return CourseObstacle(place, size, float(rng.uniform(0.0, np.pi)), False)


LANE = (-1.2, 7.0, -1.0, 3.4)
"""x and y bounds of what is kept free for the robot [m]."""
CORRIDOR = (120.0, 2.3)
"""Length and width of the corridor [m]: its ends are out of a LiDAR's range."""
HEIGHT = 3.5
"""Height of the walls [m]."""
PERSON = (0.20, 1.75)
"""Radius and height of a person [m]."""
SPEED = (0.6, 1.3)
"""Range of a person's walking speed [m/s]."""

_WALL = 0.1


@dataclass(frozen=True, slots=True)
class Person:
    """Somebody who walks to and fro between two places.

    Attributes:
        name: of the mocap body.
        places: (2, 2) x, y of both [m].
        speed: mean speed [m/s].
        phase: where the person is at time 0, as a share of the way there and back.
    """

    name: str
    places: Array
    speed: float
    phase: float

    def position(self, t: float) -> Array:
        """Return the (3,) position of the person's feet at time `t` [s], in the world [m]."""
        there = float(np.linalg.norm(self.places[1] - self.places[0]))
        share = 0.5 - 0.5 * np.cos(2.0 * np.pi * (self.phase + self.speed * t / (2.0 * there)))
        return np.append(self.places[0] + share * (self.places[1] - self.places[0]), 0.0)


def add_furnished_hall(spec: mujoco.MjSpec, rng: np.random.Generator, *, bare: bool = False) -> None:
    """Add a hall with walls, shelves, pillars, a gantry, two packs on stands and boxes.

    Args:
        rng: draws sizes and places.
        bare: leave out the pack ahead and the lamps, for the one to work on.
    """
    _ground(spec, 14.0, lit=not bare)
    body = spec.worldbody.add_body(name="furniture")
    back, front = -rng.uniform(2.5, 4.0), rng.uniform(10.0, 12.5)
    right, left = -rng.uniform(4.0, 5.0), rng.uniform(5.5, 6.5)
    _walls(body, (back, front, right, left))
    for _ in range(rng.integers(3, 6)):
        length, deep = rng.uniform(1.2, 3.0), rng.uniform(0.4, 0.6)
        # Along the right or the left wall, beside the lane.
        y = right + deep / 2 if rng.random() < 0.5 else left - deep / 2
        _shelf(body, (float(rng.uniform(back + 2.0, front - 2.0)), y), (length, deep), rng)
    for x, y in _along_lane(rng, int(rng.integers(2, 5)), (back, front, right, left)):
        if rng.random() < 0.5:
            _solid(body, (0.2, 0.2, HEIGHT / 2), (x, y, HEIGHT / 2))
        else:
            _solid(body, (0.18, HEIGHT / 2), (x, y, HEIGHT / 2), kind=CYLINDER)
    for x, y in _along_lane(rng, int(rng.integers(3, 8)), (back, front, right, left)):
        size = rng.uniform((0.2, 0.2, 0.2), (0.5, 0.5, 0.7))
        turn = rng.uniform(0.0, np.pi)
        _solid(body, tuple(size), (x, y, size[2]), quat=yaw_quat(turn))
    ahead = float(rng.uniform(7.9, 8.6)), float(rng.uniform(-0.3, 0.3))
    if not bare:
        _pack(body, ahead)
    _pack(body, (float(rng.uniform(2.0, 5.0)), left - 1.3), across=True)
    _gantry(body, (float(rng.uniform(-0.1, 0.1)), float(rng.uniform(-0.1, 0.1))))


def add_corridor(spec: mujoco.MjSpec) -> None:
    """Add two parallel walls that tell a LiDAR nothing of how far along them it is; see `CORRIDOR`."""
    length, width = CORRIDOR
    _ground(spec, length / 2)
    body = spec.worldbody.add_body(name="corridor")
    for side in (-1, 1):
        size = (length / 2, _WALL / 2, HEIGHT / 2)
        _solid(body, size, (0.0, side * (width + _WALL) / 2, HEIGHT / 2))


def add_people(spec: mujoco.MjSpec, rng: np.random.Generator, count: int) -> tuple[Person, ...]:
    """Add `count` people who walk beside the lane of the furnished hall, and return them."""
    people: list[Person] = []
    radius, height = PERSON
    for i in range(count):
        name = f"person_{i}"
        body = spec.worldbody.add_body(name=name, mocap=True)
        trunk = height - 0.25 - radius
        _solid(body, (radius, (trunk - 0.7) / 2), (0.0, 0.0, (trunk + 0.7) / 2), kind=CAPSULE)
        for side in (-1, 1):
            _solid(body, (0.08, 0.35), (0.0, side * 0.1, 0.43), kind=CAPSULE)
        _solid(body, (0.11,), (0.0, 0.0, height - 0.11), kind=SPHERE)
        y = rng.uniform(-2.6, -1.5, size=2) if i % 2 == 0 else rng.uniform(3.6, 3.9, size=2)
        x = np.array([rng.uniform(-0.5, 1.5), rng.uniform(4.0, 7.0)])
        people.append(Person(name, np.column_stack([x, y]), rng.uniform(*SPEED), rng.random()))
    return tuple(people)


def add_course(spec: mujoco.MjSpec, rng: np.random.Generator, count: int) -> None:
    """Add `count` walls and obstacles to the lane of the furnished hall; a way is left between them."""
    body = spec.worldbody.add_body(name="course")
    for one in draw_course(rng, count):
        size = (float(one.size[0]), float(one.size[2])) if one.round else tuple(one.size.tolist())
        at = (float(one.place[0]), float(one.place[1]), float(one.size[2]))
        _solid(body, size, at, kind=CYLINDER if one.round else BOX, quat=yaw_quat(one.yaw))


def _ground(spec: mujoco.MjSpec, half: float, *, lit: bool = True) -> None:
    """Add floor, lights and materials, without the walls of `hall.add_hall`, which are seen only."""
    hall.add_materials(spec)
    hall.add_floor(spec, half, "").rgba = [0.56, 0.57, 0.58, 1.0]
    world = spec.worldbody
    for x, y in ((0.0, 2.0), (6.0, -2.0)) if lit else ():
        world.add_light(pos=[x, y, HEIGHT], dir=[0, 0, -1], diffuse=[0.5] * 3, ambient=[0.15] * 3, castshadow=False)


def _walls(body: mujoco.MjsBody, bounds: tuple[float, float, float, float]) -> None:
    x0, x1, y0, y1 = bounds
    middle, half = ((x0 + x1) / 2, (y0 + y1) / 2), ((x1 - x0) / 2, (y1 - y0) / 2)
    for x in (x0 - _WALL / 2, x1 + _WALL / 2):
        _solid(body, (_WALL / 2, half[1] + _WALL, HEIGHT / 2), (x, middle[1], HEIGHT / 2))
    for y in (y0 - _WALL / 2, y1 + _WALL / 2):
        _solid(body, (half[0], _WALL / 2, HEIGHT / 2), (middle[0], y, HEIGHT / 2))


def _along_lane(
    rng: np.random.Generator, count: int, bounds: tuple[float, float, float, float]
) -> Iterator[tuple[float, float]]:
    """Yield `count` places that are in the hall, 0.8 m beside the lane and not among the people [m]."""
    x0, x1, y0, y1 = bounds
    while count:
        x, y = rng.uniform((x0 + 0.6, y0 + 0.4), (x1 - 0.6, y1 - 0.4))
        among = LANE[0] - 0.8 < x < LANE[1] + 1.0 and -3.0 < y < LANE[3] + 1.2
        if not among:
            count -= 1
            yield float(x), float(y)


def _shelf(body: mujoco.MjsBody, at: tuple[float, float], size: tuple[float, float], rng: np.random.Generator) -> None:
    """Add a shelf of four boards with boxes on them, its long side along x."""
    (x, y), (length, deep) = at, size
    for side in (-1, 1):
        _solid(body, (0.02, deep / 2, 1.0), (x + side * length / 2, y, 1.0))
    for z in (0.15, 0.75, 1.35, 1.95):
        _solid(body, (length / 2, deep / 2, 0.02), (x, y, z))
        for _ in range(rng.integers(1, 4)):
            half = rng.uniform((0.10, 0.10, 0.08), (0.25, deep / 2, 0.22))
            shift = rng.uniform(-length / 2 + half[0], length / 2 - half[0])
            _solid(body, tuple(half), (x + shift, y, z + 0.02 + half[2]))


def _pack(body: mujoco.MjsBody, at: tuple[float, float], across: bool = False) -> None:
    """Add a battery pack of 1.2 x 2.0 m on its stand; `at` is the middle of the edge next to the robot.

    Args:
        at: x, y [m].
        across: the robot comes along y instead of x.
    """
    frame = body.add_frame(pos=[*at, 0.0], quat=[0.70710678, 0.0, 0.0, 0.70710678] if across else [1.0, 0.0, 0.0, 0.0])
    blocks = [((0.6, 1.0, 0.075), (0.6, 0.0, 0.975)), ((0.25, 0.34, 0.02), (0.38, 0.0, 1.07))]
    blocks += [((0.03, 0.03, 0.45), (x, y, 0.45)) for x in (0.12, 1.08) for y in (-0.7, 0.7)]
    for size, pos in blocks:
        _solid(body, size, pos).set_frame(frame)


def _gantry(body: mujoco.MjsBody, at: tuple[float, float]) -> None:
    """Add the frame whose band holds the robot at the start: two portals beside it and a beam across."""
    x, y = at
    for dx in (-0.9, 0.9):
        for dy in (-1.25, 1.25):
            _solid(body, (0.04, 0.04, 1.25), (x + dx, y + dy, 1.25))
    for dy in (-1.25, 1.25):
        _solid(body, (0.94, 0.04, 0.04), (x, y + dy, 2.5))
    _solid(body, (0.04, 1.25, 0.06), (x, y, 2.54))


def _solid(
    body: mujoco.MjsBody,
    size: tuple[float, ...],
    pos: tuple[float, float, float],
    *,
    kind: mujoco.mjtGeom = BOX,
    quat: Sequence[float] = (1.0, 0.0, 0.0, 0.0),
) -> mujoco.MjsGeom:
    geom = parts.collider(body, kind, size, pos, quat=quat)
    geom.rgba = [0.66, 0.67, 0.70, 1.0]
    geom.group = parts.VISUAL_GROUP
    return geom
