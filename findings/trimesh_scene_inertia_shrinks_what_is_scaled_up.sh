#!/usr/bin/env bash
# trimesh 5.2.0, numpy 2.4.6, CPython 3.11: a scene whose nodes scale their meshes has a false inertia and volume.
#
# A glTF file is in metres. It holds a part in the CAD's millimetres and scales it by its node, and it places one mesh
# in several sizes that way. `extents` and `to_mesh()` of the scene apply the scale. `volume` does not. And
# `moment_inertia` applies it upside down: the scale stands where a rotation is expected, whose inverse is its
# transpose. So the inertia is divided by the square of the scale where it should grow with the fifth power. Nothing is
# said. Properties of one scene then belong to three different parts, and a link that gets its size from one and its
# inertia from another is absurd. Remedy: ask `scene.to_mesh()` for all of them.
#
# Seen: a box of 0.1 x 0.2 x 0.3 m and 1000 kg/m3 has 0.006 m3 and at most 0.065 kg m2. In metres the scene says so, and
# so does to_mesh(). In millimetres under a node of 0.001 the extents are still 0.1 0.2 0.3, to_mesh() has still 0.006
# and 0.065, and the scene has 6000000 and 6.5e+19. In double size the scene has a quarter of the inertia, to_mesh() 32
# times of it.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check trimesh==5.2.0 numpy==2.4.6 2> /dev/null

cat > "$folder/scene.py" << 'PYTHON'
import io

import numpy as np
import trimesh


def numbers(size, scale):
    """Return extents, then volume and largest inertia of the scene and of its one mesh, for a box read from a glTF."""
    made = trimesh.Scene()
    box = trimesh.creation.box(size * np.array([0.1, 0.2, 0.3]))
    made.add_geometry(box, transform=np.diag([scale, scale, scale, 1.0]))
    scene = trimesh.load_scene(io.BytesIO(made.export(file_type="glb")), file_type="glb")
    for mesh in scene.geometry.values():
        mesh.density = 1000.0
    whole = scene.to_mesh()
    return [*scene.extents, scene.volume, scene.moment_inertia.max(), whole.volume, whole.moment_inertia.max()]


def told(values):
    return " ".join(f"{value:.3g}" for value in values)


metres, millimetres, double = numbers(1.0, 1.0), numbers(1000.0, 0.001), numbers(1.0, 2.0)
print(told(metres), "/", told(millimetres), "/", told([double[4] / metres[4], double[6] / metres[6]]))
PYTHON

found=$("$folder/venv/bin/python" "$folder/scene.py")
echo "extents, volume and inertia of the scene, of to_mesh: in metres / in millimetres, scaled;" \
    "inertia of double size over that of once, of the scene, of to_mesh: $found"
[ "$found" = "0.1 0.2 0.3 0.006 0.065 0.006 0.065 / 0.1 0.2 0.3 6e+06 6.5e+19 0.006 0.065 / 0.25 32" ]
