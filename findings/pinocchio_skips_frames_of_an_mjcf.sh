#!/usr/bin/env bash
# pin 4.1.0, mujoco 4.0.0, CPython 3.11: Pinocchio leaves out of an MJCF what stands in a `<frame>` or in a body without
# attributes: links, joints and masses.
#
# Both are valid. MuJoCo writes frames itself: `MjSpec.to_xml()` puts what was attached to a site into one. Nothing is
# said, and what is left is a sound model of a lighter robot with fewer joints. A body that has a name or a place is
# read. Whoever loads an MJCF in both has to compare joints and masses.
#
# Seen: an upper arm of 2 kg and a forearm of 1 kg, one hinge each. MuJoCo has 2 joints and 3 kg each time. Pinocchio
# has 1 and 2 kg with `<frame pos="0 0 1">` around the forearm, or with `<body>` alone. With `<body name="forearm">` it
# has 2 and 3 kg.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet pin==4.1.0 mujoco==4.0.0

cat > "$folder/arm.py" << 'PYTHON'
import mujoco
import pinocchio

MJCF = (
    '<mujoco><worldbody><body name="arm"><joint name="shoulder"/><geom size="0.1" mass="2"/>'
    "{}</body></worldbody></mujoco>"
)
FOREARM = '<body{}><joint name="elbow"/><geom size="0.1" mass="1"/></body>'


def read(forearm):
    """Return joints and mass [kg] in MuJoCo and in Pinocchio, and the latter after MuJoCo wrote the file."""
    spec = mujoco.MjSpec.from_string(MJCF.format(forearm))
    model = spec.compile()
    found = [f"{model.nv}:{model.body_subtreemass[0]:.0f}"]
    for text in (MJCF.format(forearm), spec.to_xml()):
        with open("arm.xml", "w") as file:
            file.write(text)
        theirs = pinocchio.buildModelFromMJCF("arm.xml")
        found.append(f"{theirs.nv}:{pinocchio.computeTotalMass(theirs):.0f}")
    return "/".join(found)


named = FOREARM.format(' name="forearm"')
print(read(named), read(f'<frame pos="0 0 1">{named}</frame>'), read(FOREARM.format("")))
PYTHON

found=$(cd "$folder" && "$folder/venv/bin/python" arm.py)
echo "joints:mass [kg] in MuJoCo/Pinocchio/Pinocchio after to_xml: with a name, in a frame, without attributes: $found"
[ "$found" = "2:3/2:3/2:3 2:3/1:2/1:2 2:3/1:2/1:2" ]
