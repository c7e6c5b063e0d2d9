"""Labels from geometry: projected parts, and how much of each is seen according to the segmentation image."""

from __future__ import annotations

import cv2
import mujoco
import numpy as np
from numpy.typing import NDArray

from golem.robots.sensors.cameras import project
from golem.robots.worlds.pack import PackPart
from golem.training.detector.random_scene import RandomScene
from golem.types import Array, CameraInfo

PACK: tuple[str, ...] = ("screw", "screw_hole", "nut", "bus_bar", "tray")
"""Classes of a pack's parts."""
KITCHEN: tuple[str, ...] = ("handle", "mug", "bowl", "can", "bottle")
"""Classes of a kitchen: the bar of a fridge, and tableware."""
CLASSES: tuple[str, ...] = PACK + KITCHEN
"""All class names, those of the shipped weights, in the order of their heatmaps."""


MIN_SIDE = 3.0
"""A part whose box is narrower is neither asked for nor held against the detector [px]."""
MIN_VISIBLE = 0.35
"""Same for a part of which a smaller share is seen."""
CUT_SIDE = 60.0
"""Same for a part whose middle is outside of the image, if its box is narrower than this [px]. Wider ones, trays and
what is near, should not be reported there: nobody can tell where their middle is."""
COLUMNS = ("class", "x", "y", "x_min", "y_min", "x_max", "y_max", "ignore")


def label_image(scene: RandomScene, info: CameraInfo, segmentation: NDArray[np.int32]) -> Array:
    """Return (n, 8) labels, columns as in `COLUMNS`, boxes not clipped; see `within` for those at the border.

    Args:
        scene: the world at the moment of exposure.
        segmentation: (height, width) geom ids.
    """
    T_optical_world = np.linalg.inv(scene.camera_pose(info.name)).astype(np.float64)
    seen = np.bincount(segmentation[segmentation >= 0], minlength=scene.model.ngeom).astype(np.int64)
    rows: list[list[float]] = []
    for part in scene.parts:
        if part.label == "screw_hole":
            rows += _hole(scene, info, T_optical_world, part.position, 0.003, segmentation)
        else:
            rows += _solid(scene, info, T_optical_world, part, seen)
    for bore in scene.bores:
        at = scene.data.xpos[scene.model.body(bore.screw).id]
        if np.linalg.norm(at - bore.mouth) > 0.04:
            rows += _hole(scene, info, T_optical_world, bore.mouth, bore.radius, segmentation)
    return within(np.array(rows).reshape(-1, len(COLUMNS)), np.array([info.width, info.height]))


def within(labels: Array, size: Array) -> Array:
    """Return the labels (n, 8) that an image of `size` (2,) [px] has; small parts that its border cuts are ignored."""
    last = size - 1.0
    inside = ((labels[:, 1:3] >= 0.0) & (labels[:, 1:3] <= last)).all(axis=1)
    reaches_in = ((labels[:, 5:7] > 0.0) & (labels[:, 3:5] < last)).all(axis=1)
    small = (labels[:, 5:7] - labels[:, 3:5]).min(axis=1, initial=np.inf) < CUT_SIDE
    labels = labels.copy()
    labels[~inside, 7] = 1.0
    return labels[inside | (reaches_in & small)]


def _solid(
    scene: RandomScene, info: CameraInfo, T: Array, part: PackPart, seen: NDArray[np.int64]
) -> list[list[float]]:
    model, data = scene.model, scene.data
    names = [n for n in part.geoms if not n.endswith("_thread")]
    ids = [model.geom(n).id for n in names]
    points = np.concatenate([_outline(model, data, g) for g in ids])
    optical = points @ T[:3, :3].T + T[:3, 3]
    if optical[:, 2].min() < 0.02:
        return []
    pixels = project(info, optical)
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    centre_world, faces = part.position, True
    if part.body in scene.screw_tops:
        body = model.body(part.body).id
        axis = data.xmat[body].reshape(3, 3)[:, 2]
        faces = bool(axis @ T[2, :3] < -0.5)
        centre_world = data.xpos[body] + axis * scene.screw_tops[part.body]
    if part.label == "tray":
        centre_world = data.xpos[model.body(part.body).id]
    if part.label == "nut" or part.label in KITCHEN:
        # The tip of the stud moves across the nut with the view, and a crop does not show where the camera is.
        # Tableware stands, lies and is seen from everywhere: a crop can show the middle of its box.
        faces = False
    centre = project(info, T[:3, :3] @ centre_world + T[:3, 3]) if faces else (low + high) / 2
    hull = cv2.contourArea(cv2.convexHull(np.clip(pixels, 0, (info.width, info.height)).astype(np.float32)))
    visible = seen[ids].sum() / max(hull, 1.0)
    if visible <= 0:
        return []
    ignore = (high - low).min() < MIN_SIDE or visible < MIN_VISIBLE
    return [[CLASSES.index(part.label), *centre, *low, *high, float(ignore)]]


def _hole(
    scene: RandomScene, info: CameraInfo, T: Array, mouth: Array, radius: float, segmentation: NDArray[np.int32]
) -> list[list[float]]:
    angle = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    circle = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(12)])
    optical = (np.concatenate([[mouth], mouth + radius * circle, mouth + 1.4 * radius * circle])) @ T[:3, :3].T
    optical += T[:3, 3]
    if optical[:, 2].min() < 0.02:
        return []
    pixels = project(info, optical)
    low, high = pixels[1:13].min(axis=0), pixels[1:13].max(axis=0)
    index = np.clip(np.round(pixels).astype(int), 0, (info.width - 1, info.height - 1))
    geoms = segmentation[index[:, 1], index[:, 0]]
    pack = scene.model.body("pack").id
    free = (geoms >= 0) & (scene.model.geom_bodyid[geoms] == pack)
    if free.sum() < 3:
        return []
    ignore = (high - low).min() < MIN_SIDE or free.mean() < 0.75 or not free[0]
    return [[CLASSES.index("screw_hole"), *pixels[0], *low, *high, float(ignore)]]


def _outline(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> Array:
    """Return points in the world whose projection bounds the geom."""
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = model.geom_dataid[geom]
        first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        local = np.asarray(model.mesh_vert[first : first + count], float)
    else:
        centre, half = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
        corners = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
        local = centre + corners * half
    return data.geom_xpos[geom] + local @ data.geom_xmat[geom].reshape(3, 3).T
