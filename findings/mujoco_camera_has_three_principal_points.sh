#!/usr/bin/env bash
# mujoco 4.0.0, CPython 3.11: one calibrated camera has three lenses: one for pictures, another for the sensor
# `camprojection`, and a third for the sensor `rangefinder`.
#
# A simulated depth camera gets the real one's calibration by `sensorsize`, `focal` and `principal`. Pictures follow it.
# `camprojection`, "in pixel coordinates", leaves the principal point out. A `rangefinder` of the camera, "one distance
# for each pixel", counts it from the upper left corner instead of the centre, with the other sign. So even without
# `principal` its first pixel looks along the axis, and three quarters of the view are missing. With `fovy` all three
# agree, and so tests with plain cameras pass. Remedy: `fovy` and no `principal` for cameras with such sensors, and rays
# of one's own (`mj_multiRay`) from the calibration.
#
# Seen: 640 x 480 px, a point at 0.1 m right and 0.2 m up in 1 m. Pixel of pictures, of camprojection, of the ranges:
# with fovy 360 160, three times. With focal 360 160, 360 160, and column 40 in no row (-1). With a principal point of
# 50 20 px as well 310 140, 360 160, and column 90 in no row.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check mujoco==4.0.0 numpy==2.4.6 2> /dev/null

cat > "$folder/camera.py" << 'PYTHON'
import mujoco
import numpy as np

RIGHT, UP, AWAY, WIDE, HIGH = 0.1, 0.2, 1.0, 640, 480
MJCF = f"""<mujoco><worldbody><camera name="c" resolution="{WIDE} {HIGH}" {{}}/><body pos="0 0 -1">
<site name="point" pos="{RIGHT} {UP} 0"/><geom type="box" size="9 9 0.01"/></body></worldbody>
<sensor><camprojection camera="c" site="point"/><rangefinder camera="c" data="dir"/></sensor></mujoco>"""


def pixels(lens):
    """Return where the point is [px] in pictures, by camprojection, and by the rays of the range sensor."""
    model = mujoco.MjModel.from_xml_string(MJCF.format(lens))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    scene, view = mujoco.MjvScene(model, 100), mujoco.MjvCamera()
    view.type, view.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, 0
    mujoco.mjv_updateScene(model, data, mujoco.MjvOption(), None, view, mujoco.mjtCatBit.mjCAT_ALL, scene)
    eye = scene.camera[0]  # what OpenGL is given
    tall = eye.frustum_top - eye.frustum_bottom
    half = eye.frustum_width or tall / 2 * WIDE / HIGH
    picture = (
        (eye.frustum_near * RIGHT / AWAY - eye.frustum_center + half) / (2 * half) * WIDE,
        (eye.frustum_top - eye.frustum_near * UP / AWAY) / tall * HIGH,
    )
    rays = data.sensordata[2:].reshape(HIGH, WIDE, 3)
    slope = rays[..., :2] / -rays[..., 2:]
    column = np.interp(RIGHT, slope[0, :, 0], np.arange(WIDE) + 0.5)
    row = np.interp(-UP, -slope[:, 0, 1], np.arange(HIGH) + 0.5, left=-1)
    return " ".join(f"{value:.0f}" for value in (*picture, *data.sensordata[:2], column, row))


FOCAL = 'sensorsize="0.0064 0.0048" focalpixel="400 400"'
for lens in (f'fovy="{np.degrees(2 * np.arctan(0.6))}"', FOCAL, FOCAL + ' principalpixel="50 20"'):
    print(pixels(lens), end=";")
PYTHON

found=$("$folder/venv/bin/python" "$folder/camera.py")
echo "pixel in pictures, by camprojection, by ranges; with fovy, focal, principal: $found"
[ "$found" = "360 160 360 160 360 160;360 160 360 160 40 -1;310 140 360 160 90 -1;" ]
