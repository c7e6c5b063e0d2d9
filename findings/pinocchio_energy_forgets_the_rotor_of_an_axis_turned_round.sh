#!/usr/bin/env bash
# pin 4.1.0, CPython 3.11: the kinetic energy counts the rotor of a hinge along +z, and not that of one along -z.
#
# Since there is `armature`, Pinocchio's energy is that of links and rotors. A hinge whose axis is none of x, y and z
# (JointModelRevoluteUnaligned) is left out: its mass matrix and torques have the rotor, computeKineticEnergy and
# computeMechanicalEnergy do not. A URDF's `<axis xyz="0 0 -1"/>` is such an axis, too, and right limbs are often the
# left ones with the sign turned. One arm of a robot then keeps its energy and the other one seems to gain and to lose
# it, which is how collisions are found and how simulations are checked. Slides and `continuous` joints are right in
# all directions. Remedy: half of v M v, with M of `crba`.
#
# Seen: a link of 0.02 kg m2, armature 0.1, 2 rad/s. Energy by the mass matrix 0.24 J for each axis. By
# computeKineticEnergy axis z has 0.24, axis -z 0.04, axis (0.6 0 0.8) 0.04, and `continuous` about -z 0.24. Torque for
# 1 rad/s2: 0.12 N m each.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check pin==4.1.0 numpy==2.4.6 2> /dev/null

cat > "$folder/energy.py" << 'PYTHON'
import numpy as np
import pinocchio

URDF = """<robot name="arm"><link name="base"/><link name="link"><inertial><mass value="1"/>
<inertia ixx="0.02" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="hinge" type="{}">
<parent link="base"/><child link="link"/><axis xyz="{}"/><limit lower="-1" upper="1" effort="9" velocity="9"/></joint>
</robot>"""


def numbers(kind, axis):
    """Return kinetic, mechanical less potential, and mass matrix's energy [J]; torque for 1 rad/s2 [N m]."""
    model = pinocchio.buildModelFromXML(URDF.format(kind, axis))
    model.armature, model.gravity.linear = np.array([0.1]), np.zeros(3)
    data, q, v = model.createData(), pinocchio.neutral(model), np.array([2.0])
    kinetic = pinocchio.computeKineticEnergy(model, data, q, v)
    total = pinocchio.computeMechanicalEnergy(model, data, q, v) - pinocchio.computePotentialEnergy(model, data, q)
    by_mass = 0.5 * v @ pinocchio.crba(model, data, q) @ v
    torque = pinocchio.rnea(model, data, q, np.zeros(1), np.ones(1))[0]
    return " ".join(f"{value:.2f}" for value in (kinetic, total, by_mass, torque))


asked = ("revolute", "0 0 1"), ("revolute", "0 0 -1"), ("revolute", "0.6 0 0.8"), ("continuous", "0 0 -1")
print(" / ".join(numbers(*each) for each in asked))
PYTHON

found=$("$folder/venv/bin/python" "$folder/energy.py")
echo "kinetic, mechanical energy, that of the mass matrix [J], torque [N m]:" \
    "axis z / -z / oblique / continuous -z: $found"
[ "$found" = "0.24 0.24 0.24 0.12 / 0.04 0.04 0.24 0.12 / 0.04 0.04 0.24 0.12 / 0.24 0.24 0.24 0.12" ]
