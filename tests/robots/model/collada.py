"""Writes COLLADA files with one mesh."""

from __future__ import annotations

import numpy as np
import trimesh

HEAD = '<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">'


def collada(mesh: trimesh.Trimesh, unit: str = "1", up: str = "Z_UP", moved: float = 0.0) -> str:
    """Return a file of `mesh`, whose node is moved along x, in a unit [m] and with an up axis."""
    places = " ".join(f"{v:.9g}" for v in np.asarray(mesh.vertices).ravel())
    corners = " ".join(str(i) for i in np.asarray(mesh.faces).ravel())
    count = len(mesh.vertices)
    params = "".join(f'<param name="{axis}" type="float"/>' for axis in "XYZ")
    accessor = f'<accessor source="#a" count="{count}" stride="3">{params}</accessor>'
    source = (
        f'<source id="p"><float_array id="a" count="{3 * count}">{places}</float_array>'
        f"<technique_common>{accessor}</technique_common></source>"
    )
    geometry = (
        f'<geometry id="g"><mesh>{source}<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>'
        f'<triangles count="{len(mesh.faces)}"><input semantic="VERTEX" source="#v" offset="0"/><p>{corners}</p>'
        "</triangles></mesh></geometry>"
    )
    matrix = f"1 0 0 {moved} 0 1 0 0 0 0 1 0 0 0 0 1"
    node = f'<node id="n"><matrix>{matrix}</matrix><instance_geometry url="#g"/></node>'
    return (
        f'<?xml version="1.0"?>{HEAD}<asset><unit name="u" meter="{unit}"/><up_axis>{up}</up_axis></asset>'
        f"<library_geometries>{geometry}</library_geometries>"
        f'<library_visual_scenes><visual_scene id="s">{node}</visual_scene></library_visual_scenes>'
        '<scene><instance_visual_scene url="#s"/></scene></COLLADA>'
    )
