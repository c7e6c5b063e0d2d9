#!/usr/bin/env bash
# mujoco 4.0.0, CPython 3.11: a geom that is moved in the compiled model touches nothing at its new place.
#
# Training varies feet and rough ground by writing `geom_pos` of a compiled model. Poses, distances and pictures follow
# at the next step. Contacts do not: the midphase asks the body's bounding volumes, which are still those of the old
# places. A body of one geom has none and is right; with a second geom contacts are missing, without a word. Remedy:
# `mj_setConst` after each change, or the flag `midphase="disable"`.
#
# Seen: a sphere of two is moved 10 mm into the floor, and mj_geomDistance says -10 mm. Contacts: 0. With mj_setConst,
# without midphase, compiled with that place, or with no other geom in the body: 1.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet mujoco==4.0.0

cat > "$folder/feet.py" << 'PYTHON'
import mujoco

NEW = -0.16


def contacts(z=0.01, others=1, constants=False, **flags):
    """Return distance to the floor [mm] and contacts of a sphere of radius 0.05 m that is moved to NEW."""
    spec = mujoco.MjSpec()
    floor = spec.worldbody.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[5, 5, 1])
    foot = spec.worldbody.add_body(pos=[0, 0, 0.2])
    foot.add_freejoint()
    for k in range(1 + others):
        foot.add_geom(name=f"sphere{k}", size=[0.05, 0, 0], pos=[0.3 * k, 0, z if k == 0 else 0.01])
    model = spec.compile()
    data = mujoco.MjData(model)
    model.geom("sphere0").pos[2] = NEW
    if constants:
        mujoco.mj_setConst(model, data)
    if flags:
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_MIDPHASE
    mujoco.mj_forward(model, data)
    gap = mujoco.mj_geomDistance(model, data, model.geom("sphere0").id, model.geom("floor").id, 1.0, None)
    return f"{1e3 * gap:.0f}:{data.ncon}"


print(contacts(), contacts(constants=True), contacts(midphase=False), contacts(z=NEW), contacts(others=0))
PYTHON

found=$("$folder/venv/bin/python" "$folder/feet.py")
echo "distance [mm]:contacts as it is, after mj_setConst, without midphase, compiled anew, with no other geom: $found"
[ "$found" = "-10:0 -10:1 -10:1 -10:1 -10:1" ]
