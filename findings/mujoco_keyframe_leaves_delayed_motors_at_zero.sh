#!/usr/bin/env bash
# mujoco 4.0.0, CPython 3.11: after mj_resetDataKeyframe, motors and sensors with a `delay` begin with zeros, not with
# the keyframe.
#
# `delay` models the bus between controller and motor. A keyframe holds a pose and the `ctrl` that keeps it, so a robot
# that is reset to it stays there; this is how episodes begin. With a delay, what was commanded before the reset comes
# first, and that is zero: for the length of the delay position motors pull towards the zero pose with all their gain,
# and sensors read 0, an orientation even 0 0 0 0. Nothing is said, and `data.ctrl` shows the keyframe's values. Each
# episode begins with a blow, and a policy that is trained in it learns to brace. `mj_forward` does not help. Remedy:
# after each reset, `mj_initCtrlHistory` with the keyframe's ctrl, and `mj_initSensorHistory`.
#
# Seen: a hinge at its keyframe of 0.8 rad with ctrl 0.8, kp 100, no gravity, 20 ms of delay. Without delay it has a
# force of 0 and stays at 0.8. With it the force is -80 N m after the reset, and the joint swings to 0.35; the sensors
# read 0, and the quaternion has the length 0. With the history filled in: 0 N m, 0.8, and sensors of 0.8 and length 1.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check mujoco==4.0.0 numpy==2.4.6 2> /dev/null

cat > "$folder/home.py" << 'PYTHON'
import mujoco
import numpy as np

MODEL = """<mujoco><option timestep="0.002" gravity="0 0 0"/>
<worldbody><body><joint name="arm" axis="0 1 0" damping="0.5"/><geom size="0.1" mass="1" pos="0 0 0.3"/>
<site name="hand"/></body></worldbody><actuator><position joint="arm" kp="100" {0}/></actuator>
<sensor><jointpos joint="arm" {0}/><framequat objtype="site" objname="hand" {0}/></sensor>
<keyframe><key qpos="0.8" ctrl="0.8"/></keyframe></mujoco>"""
DELAY = 'delay="0.02" nsample="11"'


def start(delay, fill=False):
    """Return force, joint sensor and length of the quaternion after the reset, and the least angle of 0.2 s."""
    model = mujoco.MjModel.from_xml_string(MODEL.format(delay))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    assert data.ctrl[0] == 0.8
    if fill:
        still = mujoco.MjModel.from_xml_string(MODEL.format(""))
        there = mujoco.MjData(still)
        mujoco.mj_resetDataKeyframe(still, there, 0)
        mujoco.mj_forward(still, there)
        mujoco.mj_initCtrlHistory(model, data, 0, None, np.full((11, 1), 0.8))
        for k, values in enumerate(np.split(there.sensordata, [1])):
            mujoco.mj_initSensorHistory(model, data, k, None, np.tile(values, (11, 1)), 0.0)
    mujoco.mj_forward(model, data)
    found = [data.actuator_force[0], data.sensordata[0], np.linalg.norm(data.sensordata[1:])]
    angles = []
    for _ in range(100):
        mujoco.mj_step(model, data)
        angles.append(data.qpos[0])
    return " ".join(f"{round(value, 2) + 0.0:g}" for value in (*found, min(angles)))


print(start(""), "/", start(DELAY), "/", start(DELAY, fill=True))
PYTHON

found=$("$folder/venv/bin/python" "$folder/home.py")
echo "force [N m], joint sensor, length of the quaternion, least angle: no delay / 20 ms / 20 ms and filled: $found"
[ "$found" = "0 0.8 1 0.8 / -80 0 0 0.35 / 0 0.8 1 0.8" ]
