"""Turns the visual geoms of a compiled MuJoCo model into one glTF mesh per moving body."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np
import trimesh
from numpy.typing import NDArray
from trimesh.visual.material import PBRMaterial
from trimesh.visual.texture import TextureVisuals

from golem.robots.mujoco.camera import SHOWN_GROUPS
from golem.robots.mujoco.geom_mesh import geom_mesh, pose_matrix

SMOOTH = np.radians(35.0)
"""Edges flatter than this are shaded smooth [rad]."""
UNSET = (0.5, 0.5, 0.5, 1.0)
"""MuJoCo's default colour of a geom: with it, the material's colour counts."""

Look = tuple[tuple[float, ...], float]
"""Colour (rgba, 0 to 1) and roughness (0 to 1) of a surface."""


COLLISION: Look = ((0.1, 0.75, 0.35, 0.45), 0.8)
"""How shapes that collide are shown."""


def visual_geoms(model: mujoco.MjModel) -> dict[int, list[int]]:
    """Return the geoms a camera can see, by the body that moves them; those that cannot move are at body 0."""
    return _by_mover(model, lambda geom: int(model.geom_group[geom]) in SHOWN_GROUPS and look(model, geom)[0][3] > 0.0)


def collision_geoms(model: mujoco.MjModel) -> dict[int, list[int]]:
    """Return the geoms of moving bodies that meet others, by the body that moves them."""
    meets = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    found = _by_mover(model, lambda geom: bool(meets[geom]))
    return {body: geoms for body, geoms in found.items() if body}


def _by_mover(model: mujoco.MjModel, wanted: Callable[[int], bool]) -> dict[int, list[int]]:
    shown: dict[int, list[int]] = {}
    for geom in range(model.ngeom):
        if wanted(geom):
            body = int(model.geom_bodyid[geom])
            mover = body if model.body_weldid[body] else 0
            shown.setdefault(mover, []).append(geom)
    return shown


def look(model: mujoco.MjModel, geom: int) -> Look:
    """Return how the surface of a geom looks, by MuJoCo's rules."""
    rgba = tuple(float(c) for c in model.geom_rgba[geom])
    material = int(model.geom_matid[geom])
    if material < 0:
        return rgba, 0.6
    if rgba == UNSET:
        rgba = tuple(float(c) for c in model.mat_rgba[material])
        texture = int(model.mat_texid[material, mujoco.mjtTextureRole.mjTEXROLE_RGB])
        if texture >= 0:
            rgba = (*mean_colour(model, texture), rgba[3])
    return rgba, float(np.clip(0.9 - 0.6 * model.mat_shininess[material], 0.25, 0.9))


def mean_colour(model: mujoco.MjModel, texture: int) -> tuple[float, float, float]:
    """Return the average colour of a texture: its pattern is not carried over."""
    start, channels = int(model.tex_adr[texture]), int(model.tex_nchannel[texture])
    count = int(model.tex_height[texture] * model.tex_width[texture])
    pixels = model.tex_data[start : start + count * channels].reshape(count, channels)[:, :3]
    red, green, blue = (float(c) for c in pixels.mean(axis=0) / 255.0)
    return red, green, blue


def body_meshes(model: mujoco.MjModel, data: mujoco.MjData, *, collision: bool = False) -> dict[int, trimesh.Scene]:
    """Return per moving body its visual geoms in the body's frame, joined where they look the same.

    Args:
        data: its kinematics place what cannot move (body 0, world frame).
        collision: whether what collides is returned instead, in one colour.
    """
    meshes: dict[int, trimesh.Scene] = {}
    for body, geoms in (collision_geoms if collision else visual_geoms)(model).items():
        parts: dict[Look, list[trimesh.Trimesh]] = {}
        for geom in geoms:
            T = pose_matrix(model.geom_pos[geom], model.geom_quat[geom])
            if body == 0:
                T[:3, :3] = data.geom_xmat[geom].reshape(3, 3)
                T[:3, 3] = data.geom_xpos[geom]
            parts.setdefault(COLLISION if collision else look(model, geom), []).append(
                geom_mesh(model, geom).apply_transform(T)
            )
        meshes[body] = trimesh.Scene({f"part{i}": _surface(*item) for i, item in enumerate(parts.items())})
    return meshes


def _surface(surface: Look, pieces: list[trimesh.Trimesh]) -> trimesh.Trimesh:
    rgba, roughness = surface
    joined = trimesh.util.concatenate([trimesh.graph.smooth_shade(piece, angle=SMOOTH) for piece in pieces])
    assert isinstance(joined, trimesh.Trimesh)
    normals: NDArray[np.float64] = joined.vertex_normals
    colour, mode = [*linear(rgba[:3]), rgba[3]], "OPAQUE" if rgba[3] >= 1.0 else "BLEND"
    material = PBRMaterial(baseColorFactor=colour, metallicFactor=0.0, roughnessFactor=roughness, alphaMode=mode)
    return trimesh.Trimesh(
        joined.vertices, joined.faces, vertex_normals=normals, visual=TextureVisuals(material=material), process=False
    )


def linear(colour: tuple[float, ...]) -> list[float]:
    """Return the linear-light values, which glTF wants, of sRGB values 0 to 1."""
    return [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in colour]
