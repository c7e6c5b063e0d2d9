"""The outer surface of a link: samples of what can be touched, and the signed distance from it.

Parts of a link overlap. So inside and outside come from voxels: what a flood from the border does not reach is inside.
Holes are capped before: spheres of an open link are those of the closed one, and a plate is one without an inside.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from golem.errors import ConfigError
from golem.robots.model.link_geometry import SurfacePart
from golem.types import Array

if TYPE_CHECKING:
    import trimesh

Mask = NDArray[np.bool_]

VOXELS = 110
"""Voxels along the longest side of a link."""
VOXEL_SIZE = (0.002, 0.006)
"""Smallest and largest voxel [m]."""
DENSITY = 6.0
"""Samples of the surface per face of a voxel."""
_CUBE = np.ones((3, 3, 3), bool)


@dataclass(frozen=True, slots=True)
class LinkSurface:
    """The outside of a link.

    Attributes:
        points: (n, 3) samples of the outer surface [m].
        step: size of a voxel [m]; a face of one has `DENSITY` samples.
        inside: (m, 3) centres of the voxels inside, those near the medial axis first [m].
        volume: of the inside [m^3].
    """

    points: Array
    step: float
    inside: Array
    volume: float
    _tree: KDTree
    _origin: Array
    _solid: Mask

    def height(self, points: Array) -> Array:
        """Return the signed distance (n,) of points (n, 3) from the surface, negative inside [m]."""
        away = np.asarray(self._tree.query(points)[0])
        cell = np.floor((points - self._origin) / self.step).astype(int)
        held = ((cell >= 0) & (cell < self._solid.shape)).all(axis=1)
        cell[~held] = 0
        return np.where(held & self._solid[tuple(cell.T)], -away, away)


def link_surface(name: str, parts: Sequence[SurfacePart], seed: int = 0) -> LinkSurface:
    """Return the outer surface of overlapping meshes, at least one with an area. Raises ConfigError: not finite."""
    import trimesh  # 27 MB, for packing only

    if not all(np.isfinite(p.vertices).all() for p in parts):
        raise ConfigError(f"Link '{name}' has a mesh with vertices that are not finite.")
    meshes = [_capped(trimesh.Trimesh(p.vertices, p.faces, process=True)) for p in parts]
    low = np.min([m.bounds[0] for m in meshes], axis=0)
    high = np.max([m.bounds[1] for m in meshes], axis=0)
    step = float(np.clip((high - low).max() / VOXELS, *VOXEL_SIZE))
    dense = np.concatenate(
        [np.asarray(trimesh.sample.sample_surface(m, _count(m, step), seed=seed)[0]) for m in meshes]
    )
    origin = low - 3.0 * step
    shell = np.zeros(tuple(np.ceil((high - low) / step).astype(int) + 6), bool)
    cell = tuple(((dense - origin) / step).astype(int).T)
    shell[cell] = True
    # The flood meets a wall of three voxels, which no face without a sample opens.
    rooms = np.zeros(shell.shape, np.int32)
    ndimage.label(~_grown(shell), output=rooms)
    outside = _grown(rooms == rooms[0, 0, 0]) & ~shell
    outer = dense[_grown(outside)[cell]]
    tree = KDTree(spread(outer, step))
    core = ~outside & ~shell
    inside = origin + (np.argwhere(core)[np.argsort(_slope(core)[core], kind="stable")] + 0.5) * step
    # Half of a voxel that the surface passes through is inside; so is its centre, in half of them.
    volume = float(core.sum() + 0.5 * (shell & _grown(outside)).sum()) * step**3
    return LinkSurface(outer, step, inside, volume, tree, origin, core)


def spread(points: Array, distance: float, seed: int = 0) -> Array:
    """Return one of the points (n, 3) per cube of side `distance` [m]."""
    shuffled = points[np.random.default_rng(seed).permutation(len(points))]
    cubes = np.floor((shuffled - shuffled.min(axis=0)) / distance).astype(np.int64)
    return shuffled[np.unique(cubes, axis=0, return_index=True)[1]]


def _grown(mask: Mask) -> Mask:
    return np.asarray(ndimage.binary_dilation(mask, _CUBE), bool)


def _slope(core: Mask) -> Array:
    """Return how much deeper the deepest neighbour of each voxel is [voxels]; little on the medial axis."""
    depth = np.asarray(ndimage.distance_transform_edt(core))
    return np.asarray(ndimage.maximum_filter(depth, footprint=ndimage.generate_binary_structure(3, 1)) - depth)


def _count(mesh: trimesh.Trimesh, step: float) -> int:
    return int(max(DENSITY * mesh.area / step**2, 200))


def open_edges(vertices: Array, faces: NDArray[np.int64]) -> int:
    """Return how many edges of a mesh belong to one face only: those of its holes."""
    import trimesh

    return len(_rim(trimesh.Trimesh(vertices, faces, process=True)))


def _rim(mesh: trimesh.Trimesh) -> NDArray[np.int64]:
    """Return the edges (n, 2) of a mesh that belong to one face only."""
    edges, count = np.unique(mesh.edges_sorted, axis=0, return_counts=True)
    return edges[count == 1]


def _capped(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Return a mesh whose holes are closed, each by triangles from its rim to the middle of that."""
    import trimesh

    rim = _rim(mesh)
    if not len(rim):
        return mesh
    graph = coo_matrix((np.ones(len(rim)), (rim[:, 0], rim[:, 1])), shape=(len(mesh.vertices),) * 2)
    hole = connected_components(graph, directed=False)[1][rim[:, 0]]
    number, hole = np.unique(hole, return_inverse=True)
    middles = np.array([mesh.vertices[np.unique(rim[hole == k])].mean(axis=0) for k in range(len(number))])
    caps = np.column_stack([rim, len(mesh.vertices) + hole])
    return trimesh.Trimesh(np.concatenate([mesh.vertices, middles]), np.concatenate([mesh.faces, caps]), process=False)
