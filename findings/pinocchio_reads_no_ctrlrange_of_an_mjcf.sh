#!/usr/bin/env bash
# pin 4.1.0, mujoco 4.0.0, CPython 3.11: of an MJCF's motors Pinocchio takes no limit of torque, neither ctrlrange nor
# forcerange; its effort limit is infinite.
#
# Most published MJCFs of humanoids have their torque limits in the ctrlrange of the motors, and MuJoCo keeps them. A
# controller that asks Pinocchio's model for effortLimit then plans with infinite motors. The limit that both read is
# actuatorfrcrange of the joint.
#
# Seen: effortLimit is inf with ctrlrange or forcerange on the motor, 40 with actuatorfrcrange on the joint.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet pin==4.1.0 mujoco==4.0.0

cat > "$folder/limits.py" << 'PYTHON'
import mujoco
import pinocchio

MJCF = (
    '<mujoco><worldbody><body name="arm"><joint name="hinge" {joint}/><geom size="0.1" mass="1"/></body></worldbody>'
    '<actuator><motor joint="hinge" {motor}/></actuator></mujoco>'
)


def limits(joint="", motor=""):
    text = MJCF.format(joint=joint, motor=motor)
    with open("arm.xml", "w") as file:
        file.write(text)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.ctrl[0] = 1000.0
    mujoco.mj_forward(model, data)
    return f"{pinocchio.buildModelFromMJCF('arm.xml').effortLimit[-1]:g} {data.qfrc_actuator[0]:g}"


print(limits(motor='ctrlrange="-40 40"'), limits(motor='forcerange="-40 40"'), limits(joint='actuatorfrcrange="-40 40"'))
PYTHON

found=$(cd "$folder" && "$folder/venv/bin/python" limits.py 2> /dev/null | tail -1)
echo "Pinocchio's limit, MuJoCo's torque [N m] with ctrlrange, forcerange, actuatorfrcrange: $found"
[ "$found" = "inf 40 inf 40 40 40" ]
