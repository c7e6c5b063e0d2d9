#!/usr/bin/env bash
# mujoco 4.0.0, CPython 3.11: a body of MjSpec with a mass and no `ipos` has its centre of mass at twice its `pos`.
#
# Payloads and tools are often added to a model by `add_body(pos=..., mass=..., inertia=..., explicitinertial=True)`.
# `ipos` is the centre of mass in the body's own frame; where it is not set, MuJoCo takes the body's `pos`, which is in
# the parent's frame, once more. Nothing warns, the body's frame is right, and only the weight acts elsewhere.
# A mass in a geom of the same body is where it belongs.
#
# Seen: a ball of 1 kg at 0.5 m from a hinge asks for 9.81 N m instead of 4.91 N m; with `ipos` of zeros, or the mass in a
# geom, it is 4.91 N m.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet mujoco==4.0.0

cat > "$folder/payload.py" << 'PYTHON'
import mujoco

BALL = {"mass": 1.0, "inertia": [1e-3] * 3, "explicitinertial": True}


def torque(geom=False, **inertial):
    """Return what holds a ball at 0.5 m on a hinge about y [N m]."""
    spec = mujoco.MjSpec()
    arm = spec.worldbody.add_body(mass=1e-3, ipos=[0, 0, 0], inertia=[1e-6] * 3, explicitinertial=True)
    arm.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, -1, 0])
    ball = arm.add_body(pos=[0.5, 0, 0], **inertial)
    if geom:
        ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.05, 0, 0], mass=1.0)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return f"{data.qfrc_bias[0]:.2f}"


print(torque(**BALL), torque(**BALL, ipos=[0, 0, 0]), torque(geom=True))
PYTHON

found=$("$folder/venv/bin/python" "$folder/payload.py")
echo "torque [N m] without ipos, with ipos of zeros, with the mass in a geom: $found"
[ "$found" = "9.81 4.91 4.91" ]
