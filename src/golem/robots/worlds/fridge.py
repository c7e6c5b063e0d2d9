"""A fridge that can be opened: a door on a hinge, a magnetic seal that lets go within a centimetre, a bar to hold."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco

from golem.kernels import njit
from golem.robots.worlds import parts
from golem.robots.worlds.layout import yaw_quat
from golem.robots.worlds.parts import ALONG_X, BOX, CAPSULE, CYLINDER

HINGE = "fridge_hinge"
"""Name of the door's joint."""
HANDLE = "fridge_bar"
"""Name of the bar's visible geom."""
WIDE = 1.9
"""How far the door opens [rad]."""
INSET = 0.05
"""Distance of the bar from the edge of the door; the hinge is at the other edge [m]."""
SEAL = 0.02
"""Angle at which the seal has let go [rad]: a gasket of 10 mm at the far edge."""


@dataclass(frozen=True, slots=True)
class FridgeLayout:
    """Where the fridge stands and what its door is.

    Attributes:
        front: x of the door's face [m].
        handle_y: y of the bar [m].
        handle_z: height of the bar's middle above the floor [m].
        yaw: heading of the fridge, about the foot of the bar [rad].
        hinge_left: whether the hinge is to the left of the bar, as seen from the robot.
        width: of the door [m].
        length: of the bar [m].
        radius: of the bar [m].
        standoff: from the door's face to the bar's axis [m].
        seal: force at the bar that breaks the seal [N]; the hand cannot pull with more than its pads hold [own].
        friction: torque of the hinge [N m].
        mass: of the door with what hangs in it [kg].
    """

    front: float = 0.62
    handle_y: float = -0.16
    handle_z: float = 1.24
    yaw: float = 0.0
    hinge_left: bool = False
    width: float = 0.60
    length: float = 0.45
    radius: float = 0.0125
    standoff: float = 0.055
    seal: float = 10.0
    friction: float = 0.6
    mass: float = 14.0

    @property
    def arm(self) -> float:
        """Distance from the hinge to the bar [m]."""
        return self.width - INSET


@dataclass(frozen=True, slots=True)
class Seal:
    """The gasket's pull on the door, broken by `torque` [N m]; `dof`, `qpos` are where the hinge is in the model."""

    dof: int
    qpos: int
    torque: float

    def apply(self, data: mujoco.MjData) -> None:
        """Pull the door shut, less the further it is open."""
        data.qfrc_applied[self.dof] = -seal_torque(self.torque, float(data.qpos[self.qpos]))


@njit(cache=True, nogil=True)
def seal_torque(most: float, angle: float) -> float:
    """Return how hard the gasket pulls a door shut that is open by `angle` [rad], if `most` breaks it [N m]."""
    return most * min(max(1.0 - angle / SEAL, 0.0), 1.0)


def add_fridge(spec: mujoco.MjSpec, layout: FridgeLayout) -> None:
    """Add the cabinet and its door; see `seal_of` for the gasket."""
    side = 1.0 if layout.hinge_left else -1.0  # y of the hinge as seen from the bar
    place = [layout.front, layout.handle_y, 0.0]
    body = spec.worldbody.add_body(name="fridge", pos=place, quat=yaw_quat(layout.yaw))
    middle = side * (layout.width / 2 - INSET)
    deep, tall, plinth = 0.56, 1.86, 0.08
    door_low, door_high = 0.62, tall - 0.02
    half_w, thick = layout.width / 2, 0.055
    face = thick + 0.008  # the gasket's width lies between door and cabinet
    shell = "fridge_steel"
    # Cabinet: five walls, so that an open door shows an inside.
    for name, size, pos in (
        ("left", (deep / 2, 0.02, tall / 2), (face + deep / 2, middle + half_w - 0.02, tall / 2 + plinth)),
        ("right", (deep / 2, 0.02, tall / 2), (face + deep / 2, middle - half_w + 0.02, tall / 2 + plinth)),
        ("top", (deep / 2, half_w, 0.02), (face + deep / 2, middle, tall + plinth - 0.02)),
        ("back", (0.02, half_w, tall / 2), (face + deep - 0.02, middle, tall / 2 + plinth)),
        ("plinth", (deep / 2 - 0.03, half_w - 0.02, plinth / 2), (face + deep / 2, middle, plinth / 2)),
    ):
        parts.solid(body, BOX, size, pos, "dark" if name == "plinth" else shell)
    for z in (0.78, 1.02, 1.28, 1.54):
        parts.visual(body, BOX, (deep / 2 - 0.03, half_w - 0.04, 0.006), (face + deep / 2, middle, z), "fridge_glass")
    # The freezer drawer below stays shut.
    drawer = (door_low - 0.01 - plinth) / 2
    size, pos = (thick / 2, half_w - 0.002, drawer), (thick / 2, middle, plinth + drawer)
    parts.solid(body, BOX, size, pos, shell)
    parts.visual(body, BOX, (0.012, half_w - 0.08, 0.012), (-0.035, middle, 2 * drawer), "steel")
    for y in (-half_w + 0.09, half_w - 0.09):
        parts.visual(body, BOX, (0.02, 0.01, 0.01), (-0.015, middle + y, 2 * drawer), "steel")
    _add_door(body, layout, side, middle, (door_low, door_high), thick)


def _add_door(
    body: mujoco.MjsBody, layout: FridgeLayout, side: float, middle: float, heights: tuple[float, float], thick: float
) -> None:
    low, high = heights
    door = body.add_body(name="fridge_door", pos=[thick, side * layout.arm, 0.0])
    joint = door.add_joint(
        name=HINGE, type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0.0, 0.0, -side], range=[0.0, WIDE],
        damping=1.2, frictionloss=layout.friction, armature=0.05,
    )  # fmt: skip
    joint.limited = True
    half_h, half_w = (high - low) / 2, layout.width / 2
    y = middle - side * layout.arm
    size, pos = (thick / 2, half_w - 0.002, half_h), (-thick / 2, y, low + half_h)
    parts.solid(door, BOX, size, pos, "fridge_steel", mass=layout.mass)
    parts.visual(door, BOX, (0.004, half_w - 0.015, half_h - 0.015), (0.003, y, low + half_h), "rubber")
    at_y = -side * layout.arm
    x, z = -thick - layout.standoff, layout.handle_z
    bar = (layout.radius, layout.length / 2)
    parts.collider(door, CYLINDER, bar, (x, at_y, z), friction=0.8, mass=0.3)
    parts.visual(door, CAPSULE, bar, (x, at_y, z), "fridge_bar", name=HANDLE)
    for k, end in enumerate((-1.0, 1.0)):
        post = (0.009, layout.standoff / 2)
        at = (-thick - layout.standoff / 2, at_y, z + end * (layout.length / 2 - 0.02))
        parts.collider(door, CYLINDER, post, at, quat=ALONG_X)
        parts.visual(door, CYLINDER, post, at, "fridge_bar", quat=ALONG_X, name=f"{HANDLE}_post_{k}")
    parts.visual(door, BOX, (0.001, 0.035, 0.012), (-thick - 0.0005, y, high - 0.10), "steel")


def seal_of(model: mujoco.MjModel, layout: FridgeLayout) -> Seal:
    """Return the gasket of the fridge in a compiled model."""
    joint = model.joint(HINGE)
    return Seal(int(joint.dofadr[0]), int(joint.qposadr[0]), layout.seal * layout.arm)
