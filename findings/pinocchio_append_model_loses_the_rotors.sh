#!/usr/bin/env bash
# pin 4.1.0, CPython 3.11: appendModel drops the armature of both models, and the first one's gravity.
#
# An arm and its hand, or a base and its arm, are joined by `pinocchio.appendModel`. Limits, damping, friction, and even
# rotorInertia and rotorGearRatio come along. `armature`, the rotors' inertia as the joints feel it and the only one of
# these that the dynamics use, is zero for every joint afterwards. Gravity is -9.81 again, also for a model of a robot
# on a wall or in water. Nothing is said. With geared motors the rotors are most of a wrist's inertia, so torques by
# `rnea` are too weak and accelerations by `aba` too large. buildReducedModel keeps both. Remedy: set `armature` and
# `gravity` after joining, by the joints' names.
#
# Seen: two joints, each 0.02 kg m2 of link and 0.1 of armature, gravity 0, damping 0.5. What 1 rad/s2 of the hand's
# joint takes: 0.12 N m before, 0.02 joined. Armature 0.1 0.1 becomes 0 0, gravity -9.81; damping is still 0.5 0.5.
# A reduced model has 0.1 and 0.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check pin==4.1.0 numpy==2.4.6 2> /dev/null

cat > "$folder/join.py" << 'PYTHON'
import numpy as np
import pinocchio

URDF = """<robot name="{0}"><link name="{0}_root"/><link name="{0}_link"><inertial><mass value="1"/>
<inertia ixx="0.02" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="{0}" type="revolute">
<parent link="{0}_root"/><child link="{0}_link"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="9" velocity="3"/><dynamics damping="0.5"/></joint></robot>"""


def part(name):
    model = pinocchio.buildModelFromXML(URDF.format(name))
    model.armature = np.array([0.1])
    model.gravity.linear = np.zeros(3)
    return model


def torque(model):
    """Return what turns the last joint with 1 rad/s2 while the others stay [N m]."""
    rest, wanted = np.zeros(model.nv), np.eye(model.nv)[-1]
    return pinocchio.rnea(model, model.createData(), rest, rest, wanted)[-1]


def told(model):
    return [f"{value:g}" for value in (*model.armature, *model.damping, model.gravity.linear[2])]


arm, hand = part("arm"), part("hand")
joined = pinocchio.appendModel(arm, hand, arm.getFrameId("arm_link"), pinocchio.SE3.Identity())
whole = joined.copy()
whole.armature, whole.gravity.linear = np.array([0.1, 0.1]), np.zeros(3)
reduced = pinocchio.buildReducedModel(whole, [1], np.zeros(2))
print(f"{torque(hand):.2f} {torque(joined):.2f}", *told(hand), "/", *told(joined), "/", *told(reduced))
PYTHON

found=$("$folder/venv/bin/python" "$folder/join.py")
echo "torque of the hand's joint alone, joined [N m]; armature, damping, gravity of hand / joined / reduced: $found"
[ "$found" = "0.12 0.02 0.1 0.5 0 / 0 0 0.5 0.5 -9.81 / 0.1 0.5 0" ]
