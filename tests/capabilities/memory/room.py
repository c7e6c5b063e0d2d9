"""Looks at boxes in front of a wall, made of rays and spheres instead of a renderer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from golem.capabilities.memory.base import Observation
from golem.robots.sensors.cameras import HEAD, project, rays
from golem.types import Array, Detection, LocalizedObject, RgbdImage

RADIUS = 0.06
"""Of every object [m]."""
WALL = 2.5
"""Distance of the wall from the eye [m]."""
KINDS = ("mug", "can", "bowl")

T_LOOK: Array = np.array([[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 1.2], [0.0, 0.0, 0.0, 1.0]])
"""The eye at 1.2 m height, looking along x."""


def look(
    t: float,
    things: Mapping[str, Sequence[float]],
    seen: Sequence[str] | None = None,
    hiding: Sequence[float] | None = None,
    labels: Sequence[str] = KINDS,
    pose: Array = T_LOOK,
    believed: Array | None = None,
    pose_sigma: float = 0.02,
) -> Observation:
    """Return a look.

    Args:
        t: when [s].
        things: name -> position (3,); the label is the name up to the first digit.
        seen: names that the localizer finds; all that are there, if None.
        hiding: centre of a large ball that is in the way.
        labels: what the localizer is asked for.
        pose: where the eye is.
        believed: where it takes itself to be.
        pose_sigma: as the observation says it.
    """
    believed = pose if believed is None else believed
    depth = np.full((HEAD.height, HEAD.width), WALL, np.float32)
    found: list[LocalizedObject] = []
    inverse = np.linalg.inv(pose)
    balls = [(name, np.array(at), RADIUS) for name, at in things.items()]
    balls += [] if hiding is None else [("", np.array(hiding), 0.3)]
    for name, at, radius in balls:
        centre = inverse[:3, :3] @ at + inverse[:3, 3]
        _draw(depth, centre, radius)
        if name and (seen is None or name in seen):
            points = centre + radius * _half_ball(-centre)
            pixel = project(HEAD, centre)
            detection = Detection(name.rstrip("0123456789"), 0.9, np.array([*pixel - 10, *pixel + 10]), pixel)
            out = [believed[:3, :3] @ p + believed[:3, 3] for p in (centre, *points)]
            found.append(LocalizedObject(detection, t, out[0], np.array(out[1:])))
    rgb = np.zeros((HEAD.height, HEAD.width, 3), np.uint8)
    return Observation(RgbdImage(t, HEAD, rgb, depth, believed), found, labels, pose_sigma)


def _half_ball(towards: Array) -> Array:
    """Return (n, 3) points of the unit ball's half that is `towards` (3,)."""
    directions = np.random.default_rng(0).standard_normal((800, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return directions * np.sign(directions @ towards)[:, None]


def _draw(depth: np.ndarray, centre: Array, radius: float) -> None:
    """Put a ball into the depth image."""
    directions = rays(HEAD).reshape(-1, 3)
    along = directions @ centre / np.sum(directions**2, axis=1)
    distance = np.linalg.norm(along[:, None] * directions - centre, axis=1)
    inside = (distance < radius) & (along > 0.1)
    flat = depth.reshape(-1)
    flat[inside] = np.minimum(flat[inside], along[inside])
