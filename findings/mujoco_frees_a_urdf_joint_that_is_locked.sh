#!/usr/bin/env bash
# mujoco 4.0.0, pin 4.1.0, CPython 3.11: a URDF joint that is locked by lower = upper turns freely in MuJoCo.
#
# Grippers and other parts that a description holds still are often written so. MuJoCo warns on the console that it
# ignores the limits, and the joint has none: under 1 N m it turns for ever. With lower above upper it does the same and
# says nothing. Pinocchio keeps both limits, so two readers of one file disagree about what moves.
#
# Seen: limits 0..0 and 1..-1 are "not limited" in MuJoCo, and after 1 s of 1 N m the joint has turned by 0.50 rad;
# limits -0.1..0.1 hold it at 0.1. Pinocchio has 0..0.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet mujoco==4.0.0 pin==4.1.0

cat > "$folder/joint.py" << 'PYTHON'
import mujoco
import pinocchio

LINK = '<link name="{0}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
URDF = (
    '<robot name="r">' + LINK.format("base") + LINK.format("finger") + '<joint name="hinge" type="revolute">'
    '<parent link="base"/><child link="finger"/><axis xyz="0 0 1"/>'
    '<limit lower="{lower}" upper="{upper}" effort="10" velocity="1"/></joint></robot>'
)


def turned(lower, upper):
    model = mujoco.MjModel.from_xml_string(URDF.format(lower=lower, upper=upper))
    data = mujoco.MjData(model)
    data.qfrc_applied[0] = 1.0
    while data.time < 1.0:
        mujoco.mj_step(model, data)
    return f"{int(model.jnt_limited[0])} {data.qpos[0]:.2f}"


pin = pinocchio.buildModelFromXML(URDF.format(lower=0, upper=0))
print(turned(0, 0), turned(1, -1), turned(-0.1, 0.1), f"{pin.lowerPositionLimit[0]:g} {pin.upperPositionLimit[0]:g}")
PYTHON

found=$(cd "$folder" && "$folder/venv/bin/python" joint.py 2> /dev/null | tail -1)
echo "limited, turned [rad] by limits 0..0, 1..-1, -0.1..0.1; Pinocchio's limits of 0..0: $found"
[ "$found" = "0 0.50 0 0.50 1 0.10 0 0" ]
