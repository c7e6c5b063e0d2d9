#!/usr/bin/env bash
# pin-pink 4.4.0, pin 4.1.0, CPython 3.11: a joint with a limit of zero has no limit in Pink's inverse kinematics.
#
# A URDF holds a joint still by `velocity="0"`, or by a range with lower = upper. Pink takes a speed or a range below
# 1e-10 for no limit, without a word: the joint that must not move is then the one that moves most. `check_limits`,
# which `solve_ik` calls first, passes over the same joints. Remedy: limits of 1e-9, or `pinocchio.buildReducedModel`.
#
# Seen: one hinge, a target 1.57 rad away. Limited to 0.5 rad/s it moves at 0.5. Limited to 0 it moves at 80 rad/s, and
# to 1e-9 not at all. With a range of 0..0 it ends at 1.57 rad, with 0..1e-9 at 0.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet pin-pink==4.4.0 pin==4.1.0 qpsolvers==4.13.0 daqp==0.11.0 numpy==2.4.6

cat > "$folder/hinge.py" << 'PYTHON'
import numpy as np
import pink
import pinocchio

URDF = """<robot name="arm"><link name="base"/><link name="arm"/><link name="tip"/>
<joint name="hinge" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
<limit lower="{0}" upper="{1}" velocity="{2}" effort="10"/></joint>
<joint name="end" type="fixed"><parent link="arm"/><child link="tip"/><origin xyz="1 0 0"/></joint></robot>"""


def moved(lower, upper, velocity):
    """Return the greatest speed [rad/s] and the last angle [rad]."""
    model = pinocchio.buildModelFromXML(URDF.format(lower, upper, velocity))
    arm = pink.Configuration(model, model.createData(), np.zeros(1))
    task = pink.tasks.FrameTask("tip", position_cost=1.0, orientation_cost=0.0)
    task.set_target(pinocchio.SE3(np.eye(3), np.array([0.0, 1.0, 0.0])))
    speed = 0.0
    for _ in range(400):
        velocity = pink.solve_ik(arm, [task], 0.01, solver="daqp")
        speed = max(speed, abs(velocity[0]))
        arm.integrate_inplace(velocity, 0.01)
    return speed, arm.q[0]


print(*(f"{moved(-1.6, 1.6, velocity)[0]:.1f}" for velocity in (0.5, 0, 1e-9)), end=" ")
print(*(f"{moved(0, upper, 10)[1]:.2f}" for upper in (0, 1e-9)))
PYTHON

found=$("$folder/venv/bin/python" "$folder/hinge.py")
echo "speed [rad/s] with a limit of 0.5, 0, 1e-9; angle [rad] with a range of 0..0, 0..1e-9: $found"
[ "$found" = "0.5 80.0 0.0 1.57 0.00" ]
