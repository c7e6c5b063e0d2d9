"""Mesh files of robots: where a URDF's names for them lead, and their triangles."""

from __future__ import annotations

import os
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from golem.errors import ConfigError
from golem.types import Array

_SCHEME = re.compile(r"^(package|model)://+([^/]+)/(.*)$|^\$\(find (\S+)\)/(.*)$")
_PLAIN = (".stl", ".obj", ".ply", ".off")
"""What trimesh reads by itself, and fast."""
_LFS = b"version https://git-lfs"


def find_mesh(name: str, file: Path, packages: Mapping[str, Path], folder: str = "") -> Path | None:
    """Return where the mesh that the robot's `file` calls `name` is; None where it is nowhere.

    Of `package://NAME/PATH` (`model://`, `$(find NAME)`), in this order: PATH in the folder that `packages` has for
    NAME; beside the file; in a folder called NAME above the file, or beside one above it; in NAME below the folders of
    ROS_PACKAGE_PATH and in `share` of those of AMENT_PREFIX_PATH; in any folder above the file. Of a plain name and of
    `file://`: as it is, beside the file, in `folder`.

    Args:
        name: as it stands in the file.
        packages: folders of packages by name.
        folder: MuJoCo's `meshdir`.
    """
    name = unquote(name.strip()).replace("\\", "/").removeprefix("file://")
    match = _SCHEME.match(name)
    if match is None:
        base = file.parent / folder
        tries: Iterator[Path] = iter((file.parent / name, base / name, base / Path(name).name))
    else:
        package, path = match[2] or match[4], match[3] or match[5]
        tries = _in_package(package, path, file.resolve(), packages)
    return next((path for path in tries if path.is_file()), None)


def _in_package(package: str, path: str, file: Path, packages: Mapping[str, Path]) -> Iterator[Path]:
    if package in packages:
        yield packages[package] / path
    yield file.parent / path
    for above in file.parents:
        if above.name == package:
            yield above / path
        yield above / package / path
    for variable, below in (("ROS_PACKAGE_PATH", ""), ("AMENT_PREFIX_PATH", "share")):
        for root in filter(None, os.environ.get(variable, "").split(os.pathsep)):
            yield Path(root, below, package, path)
            if Path(root).name == package:
                yield Path(root, path)
    for above in file.parents:
        yield above / path


def package_folders(options: tuple[str, ...]) -> dict[str, Path]:
    """Return the folders of packages by name, of options such as `my_robot=/path/to/my_robot`.

    Raises ConfigError: one is not of that form, or there is no such folder.
    """
    found: dict[str, Path] = {}
    for option in options:
        name, sign, folder = option.partition("=")
        if not (name and sign and Path(folder).expanduser().is_dir()):
            raise ConfigError(f"--package takes NAME=FOLDER, the folder of a package that exists, not '{option}'.")
        found[name] = Path(folder).expanduser()
    return found


@lru_cache(maxsize=64)
def read_mesh(path: Path) -> tuple[Array, NDArray[np.int64]]:
    """Return vertices (n, 3) [m] and faces (m, 3) of a mesh file in a format of trimesh or Assimp, in one piece.

    A COLLADA file's unit counts and its up axis does not, as in RViz. Raises ConfigError: it holds no mesh, or Git LFS
    has not fetched it.
    """
    import trimesh  # 40 MB, which a robot that only runs does without

    with path.open("rb") as stream:
        if stream.read(len(_LFS)) == _LFS:
            raise ConfigError(f"{path} is a pointer of Git LFS; `git lfs pull` fetches the mesh")
    try:
        if path.suffix.lower() in _PLAIN:
            mesh = trimesh.load_mesh(path, process=False, skip_materials=True)
            vertices, faces = np.asarray(mesh.vertices, float), np.asarray(mesh.faces, np.int64)
        else:
            vertices, faces = _assimp(path)
    except Exception as error:  # what the readers raise on bytes that are no mesh has no common base
        raise ConfigError(f"{path} holds no mesh that can be read (STL, OBJ, PLY, DAE, GLB)") from error
    if not len(faces) or not np.isfinite(vertices).all():
        raise ConfigError(f"{path} holds no triangles, or places that are not finite")
    return vertices, faces


def _assimp(path: Path) -> tuple[Array, NDArray[np.int64]]:
    import coal

    library: Any = coal  # its types do not name the loader
    mesh = library.MeshLoader().load(str(path), np.ones(3))
    triangles = (mesh.tri_indices(i) for i in range(mesh.num_tris))
    faces = np.array([(t[0], t[1], t[2]) for t in triangles], np.int64)
    unit = _unit(path) if path.suffix.lower() == ".dae" else 1.0
    return unit * np.array(mesh.vertices(), float).reshape(-1, 3), faces


def _unit(path: Path) -> float:
    """Return the length that a COLLADA file counts in [m]."""
    for _, element in ET.iterparse(path):
        if element.tag.endswith("}unit") or element.tag == "unit":
            return float(element.get("meter", 1.0))
        if element.tag.endswith("}asset"):
            break
    return 1.0
