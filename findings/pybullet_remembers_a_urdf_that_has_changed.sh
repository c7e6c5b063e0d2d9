#!/usr/bin/env bash
# pybullet 3.2.7, CPython 3.11: loadURDF gives the robot that the file once held, after the file has changed.
#
# Training with varied robots writes a URDF with other masses or lengths, calls resetSimulation and loads it again.
# PyBullet keeps each file that it has read in memory, by its path as written. It reads none twice before `disconnect`,
# whatever the file's time and size. Every episode then runs the first robot, while the logs name the others. A policy
# that seems to bear any mass has seen one. The option that ends this, `enableFileCaching`, is described for meshes.
# Remedy: setPhysicsEngineParameter(enableFileCaching=0) before the first load, or a new name each time.
#
# Seen: the same path with masses of 1, 20 and 300 kg: 1 1 1 kg, with resetSimulation before each load. The same file
# by another spelling of its path: 300 kg. Without caching: 1 20 300 kg.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check pybullet==3.2.7 numpy==2.4.6 2> /dev/null

cat > "$folder/masses.py" << 'PYTHON'
import pybullet

URDF = """<robot name="r"><link name="body"><inertial><mass value="{}"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"""


def mass(path):
    pybullet.resetSimulation()
    return pybullet.getDynamicsInfo(pybullet.loadURDF(path), -1)[0]


def masses(caching):
    pybullet.connect(pybullet.DIRECT)
    pybullet.setPhysicsEngineParameter(**caching)
    found = []
    for k in (1, 20, 300):
        with open("robot.urdf", "w") as stream:
            stream.write(URDF.format(k))
        found.append(mass("robot.urdf"))
    found.append(mass("./robot.urdf"))
    pybullet.disconnect()
    return found


print("found", *(f"{m:g}" for m in masses({}) + masses({"enableFileCaching": 0})))
PYTHON

found=$(cd "$folder" && "$folder/venv/bin/python" masses.py | sed -n 's/^found //p')
echo "mass [kg] of a file with 1, 20, 300, and of ./file; the same without caching: $found"
[ "$found" = "1 1 1 300 1 20 300 300" ]
