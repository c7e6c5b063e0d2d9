"""A free gripper with a compliant wrist that pulls one screw from its bore; run as a script it prints the jam table."""

from __future__ import annotations

from dataclasses import dataclass, replace

import mujoco
import numpy as np

from golem.robots.worlds import pack_part, screws
from golem.robots.worlds.pack import set_contact_options
from golem.robots.worlds.screws import ScrewDraw

STEP = 0.0005
GRIP = 8.0
"""Force of each finger [N]."""
WRIST = 2000.0
"""Stiffness of the wrist per mass [1/s^2]: 0.8 kN/m on a hand of 0.4 kg."""
PULL = 0.03
"""Length of the pull [m]."""


@dataclass(frozen=True)
class Pull:
    """What became of a pull.

    Attributes:
        rise: how far the screw came up [m].
        slip: how far the fingers slid along it [m].
    """

    rise: float
    slip: float


def nominal(friction: float, **changes: float) -> ScrewDraw:
    """Return an upright M6 screw, 20 mm long, with 0.3 mm of clearance and 14 mm of its shank in the bore."""
    values: dict[str, float] = {
        "clearance": 0.0003, "protrusion": 0.006, "tilt": 0.0, "tilt_azimuth": 0.0, "shank_diameter": 0.006,
        "shank_length": 0.020, "head_diameter": 0.012, "head_height": 0.006, "mass": 0.02,
    }  # fmt: skip
    return ScrewDraw(slot=0, friction=friction, hexagonal=False, kind="screw", **{**values, **changes})


def nominal_nut(friction: float, **changes: float) -> ScrewDraw:
    """Return an M6 flange nut with 6 mm of its height on the stud."""
    values = {"shank_length": 0.012, "head_diameter": 0.013, "mass": 0.006, **changes}
    return replace(nominal(friction, **values), kind="nut")


def build(draw: ScrewDraw) -> mujoco.MjModel:
    """Return a plate with one bore and its screw, and a hand of two pads around the head, on a soft wrist."""
    spec = mujoco.MjSpec()
    set_contact_options(spec)
    spec.option.timestep = STEP
    for name in ("zinc", "steel"):
        spec.add_material(name=name)
    plate = spec.worldbody.add_body(name="plate")
    (pack_part.add_stud if draw.kind == "nut" else screws.add_bore)(plate, draw, (0, 0, 0))
    (pack_part.add_nut if draw.kind == "nut" else screws.add_screw)(spec, draw, (0, 0, 0), np.eye(4))
    height = draw.protrusion + draw.head_height / 2
    spec.worldbody.add_body(name="anchor", mocap=True, pos=[0, 0, height])
    hand = spec.worldbody.add_body(name="hand", pos=[0, 0, height], gravcomp=1)
    hand.add_freejoint(name="hand")
    hand.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.02, 0.04, 0.02], pos=[0, 0, 0.05], mass=0.3, contype=0, conaffinity=0
    )
    for side, name in ((1, "a"), (-1, "b")):
        finger = hand.add_body(name=name, pos=[0, side * (draw.head_diameter / 2 + 0.006), 0], gravcomp=1)
        finger.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, -side, 0], damping=[2, 0, 0])
        finger.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.008, 0.0015, 0.01], pos=[0, 0, 0.007], mass=0.05,
            friction=[draw.friction, 0.005, 0.0001], solref=list(screws.SOLREF),
        )  # fmt: skip
        motor = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        motor.set_to_motor()
    weld = spec.add_equality(
        type=mujoco.mjtEq.mjEQ_WELD, objtype=mujoco.mjtObj.mjOBJ_BODY, name1="anchor", name2="hand"
    )
    weld.solref = [-WRIST, -2 * np.sqrt(WRIST)]
    weld.data = [0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0]
    return spec.compile()


def pull(draw: ScrewDraw, tilt: float, azimuth: float = 0.0) -> Pull:
    """Close the fingers and pull along a line.

    Args:
        draw: the screw.
        tilt: angle between the line and the bore's axis [rad].
        azimuth: where the line leans to; 0 is along the pads, pi / 2 along the closing axis [rad].
    """
    model = build(draw)
    data = mujoco.MjData(model)
    data.ctrl[:] = GRIP
    mujoco.mj_forward(model, data)
    start = data.mocap_pos[0].copy()
    line = np.array([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)])
    close, rise = 400, 2000
    screw = model.body(draw.name).id
    hand = model.body("hand").id
    before = data.xpos[screw].copy()
    for k in range(close + rise + 300):
        data.mocap_pos[0] = start + line * PULL * np.clip((k - close) / rise, 0.0, 1.0)
        mujoco.mj_step(model, data)
        if k == close:
            gap = data.xpos[hand] - data.xpos[screw]
    moved = data.xpos[screw] - before
    slip = np.linalg.norm(data.xpos[hand] - data.xpos[screw] - gap)
    return Pull(float(moved[2]), float(slip))


def main() -> None:
    """Print the rise [mm] of the screw over tilt, friction and clearance."""
    tilts = range(0, 35, 5)
    print("rise of a 30 mm pull [mm] at tilt [deg]:", *tilts)
    for friction in (0.15, 0.35, 0.6):
        for azimuth in (0.0, np.pi / 2):
            rises = [pull(nominal(friction), np.deg2rad(t), azimuth).rise * 1e3 for t in tilts]
            print(f"mu {friction} azimuth {np.rad2deg(azimuth):.0f}:", *(f"{r:.1f}" for r in rises))
    for clearance in (0.0001, 0.0006):
        rises = [pull(nominal(0.35, clearance=clearance), np.deg2rad(t)).rise * 1e3 for t in tilts]
        print(f"mu 0.35 clearance {clearance * 1e3:.1f} mm:", *(f"{r:.1f}" for r in rises))


if __name__ == "__main__":
    main()
