#!/usr/bin/env bash
# coal 3.0.3, mujoco 4.0.0, CPython 3.11: one matrix of heights is one terrain in MuJoCo and its mirror image in coal.
#
# Both take a matrix with rows along y and columns along x, centred at the origin. MuJoCo's first row is at the smallest
# y, coal's first row is at the largest. Neither says so where the matrix is asked for. A robot that walks in MuJoCo
# and plans its feet with coal plans them on the mirrored ground: a step on its left is a step on its right. Flat
# ground, ramps along x and ridges across the path look right, and so do tests with them. coal's size is the whole one,
# MuJoCo's half of it. Remedy: `heights[::-1]` for one of the two.
#
# Seen: 2 x 1 m, 5 columns, 3 rows, heights of 0 but for 1 m in the first row and first column. The ground under the
# corners -x -y, -x +y, +x -y, +x +y, probed by a ray in MuJoCo and by a small sphere in coal at 0.9 m: MuJoCo meets it
# in the first corner, coal in the second. With the rows reversed coal meets it in the first.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check \
    coal==3.0.3 mujoco==4.0.0 numpy==2.4.6 2> /dev/null

cat > "$folder/ground.py" << 'PYTHON'
import coal
import mujoco
import numpy as np

HEIGHTS = np.zeros((3, 5))
HEIGHTS[0, 0] = 1.0
CORNERS = [(x, y) for x in (-0.98, 0.98) for y in (-0.49, 0.49)]
MODEL = """<mujoco><asset><hfield name="ground" nrow="3" ncol="5" size="1 0.5 1 0.1"/></asset>
<worldbody><geom type="hfield" hfield="ground"/></worldbody></mujoco>"""


def by_mujoco(heights):
    model = mujoco.MjModel.from_xml_string(MODEL)
    model.hfield_data[:] = heights.ravel()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    down, met = np.array([0.0, 0.0, -1.0]), np.zeros(1, np.int32)
    tops = [2.0 - mujoco.mj_ray(model, data, np.array([x, y, 2.0]), down, None, 1, -1, met, None) for x, y in CORNERS]
    return "".join(str(int(top > 0.9)) for top in tops)


def by_coal(heights):
    ground, ball = coal.HeightFieldAABB(2.0, 1.0, heights, -0.1), coal.Sphere(0.02)
    found = ""
    for x, y in CORNERS:
        at, result = coal.Transform3s(np.eye(3), np.array([x, y, 0.9])), coal.CollisionResult()
        found += str(int(coal.collide(ground, coal.Transform3s(), ball, at, coal.CollisionRequest(), result) > 0))
    return found


print(by_mujoco(HEIGHTS), by_coal(HEIGHTS), by_coal(np.ascontiguousarray(HEIGHTS[::-1])))
PYTHON

found=$("$folder/venv/bin/python" "$folder/ground.py")
echo "corners -x -y, -x +y, +x -y, +x +y that are high: in MuJoCo, in coal, in coal with the rows reversed: $found"
[ "$found" = "1000 0100 1000" ]
