#!/usr/bin/env bash
# coal 3.0.3, pin 4.1.0, trimesh 5.2.0, pycollada 0.9.3, CPython 3.11: a COLLADA mesh in millimetres is read in metres.
#
# A .dae file names its unit, `<unit meter="0.001"/>`, and RViz and Gazebo scale by it. A URDF whose meshes look right
# there is a thousand times too large for coal, and so for Pinocchio's collisions. Nothing is said, and links collide
# that are metres apart. trimesh reads the unit, keeps it in `units`, and does not apply it. yourdfpy loads with trimesh
# and has the same giant. A `scale` in the URDF is no remedy, as RViz would apply both. Remedy: read `<unit>` oneself,
# or convert the meshes once; with trimesh by `convert_units("meters")`.
#
# Seen: a part of 100 x 200 x 300 mm. Longest side: Pinocchio 300 m, coal 300 m, trimesh 300 ("0.001 * meters"). After
# convert_units it is 0.3 m, and coal reads 0.3 m from an STL of that.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check \
    coal==3.0.3 pin==4.1.0 trimesh==5.2.0 pycollada==0.9.3 numpy==2.4.6 2> /dev/null

cat > "$folder/part.py" << 'PYTHON'
import coal
import numpy as np
import pinocchio
import trimesh

PART = """<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="millimeter" meter="0.001"/><up_axis>Z_UP</up_axis></asset><library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="a" count="12">0 0 0 100 0 0 0 200 0 0 0 300</float_array><technique_common>
<accessor source="#a" count="4" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices><triangles count="4">
<input semantic="VERTEX" source="#v" offset="0"/><p>0 2 1 0 1 3 0 3 2 1 2 3</p></triangles></mesh></geometry>
</library_geometries><library_visual_scenes><visual_scene id="s"><node id="n"><instance_geometry url="#g"/></node>
</visual_scene></library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>"""
URDF = """<robot name="r"><link name="part"><collision><geometry><mesh filename="part.dae"/></geometry></collision>
</link></robot>"""


def side(mesh):
    mesh.computeLocalAABB()
    return f"{np.max(mesh.aabb_local.max_ - mesh.aabb_local.min_):.3g}"


for name, text in {"part.dae": PART, "part.urdf": URDF}.items():
    with open(name, "w") as stream:
        stream.write(text)
model = pinocchio.buildModelFromUrdf("part.urdf")
solids = pinocchio.buildGeomFromUrdf(model, "part.urdf", pinocchio.GeometryType.COLLISION, ".")
scene = trimesh.load_scene("part.dae")
metres = scene.convert_units("meters")
metres.to_geometry().export("part.stl")
loader = coal.MeshLoader()
print(side(solids.geometryObjects[0].geometry), side(loader.load("part.dae", np.ones(3))), end=" ")
print(f"{max(scene.extents):.3g} '{scene.units}' {max(metres.extents):.3g}", side(loader.load("part.stl", np.ones(3))))
PYTHON

found=$(cd "$folder" && "$folder/venv/bin/python" part.py 2> /dev/null)
echo "longest side by Pinocchio, coal, trimesh, trimesh in metres; coal of the STL in metres: $found"
[ "$found" = "300 300 300 '0.001 * meters' 0.3 0.3" ]
