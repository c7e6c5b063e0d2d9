"""The one table of numbers of the robot's body; every model, limit and export is derived from it.

The rows are in `h12.yaml`, beside this file, each with its source.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from golem.errors import unknown_name
from golem.package_data import load_data
from golem.robots.model.spatial import Inertial, rotation_rpy, transform
from golem.types import Array

TORQUE_PROFILES = ("urdf", "paper")
"""Sources of the torque limits: `urdf`, the vendor's, the lower for every joint; `paper`, the GOLEM paper's, up to
6.7 times higher (elbow 120 against 18 N m)."""


@dataclass(frozen=True, slots=True)
class Limits:
    """What the body's joints may do, each array (27,) in motor order, full vendor values without a safety factor.

    Attributes:
        lower, upper: range [rad].
        velocity: magnitude [rad/s].
        torque: magnitude [N m].
    """

    lower: Array
    upper: Array
    velocity: Array
    torque: Array


def load_limits(profile: str = "urdf") -> Limits:
    """Return the limits of the 27 joints, of `"urdf"` or `"paper"`: other torques. Raises ConfigError: no such one."""
    if profile not in TORQUE_PROFILES:
        raise unknown_name("torque limit profile", profile, TORQUE_PROFILES)
    rows = [(j.lower, j.upper, j.velocity, j.torque[profile]) for j in JOINTS]
    return Limits(*np.array(rows).T.copy())


BASE_LINK = "pelvis"
"""The root link; its frame is `base_link`."""


@dataclass(frozen=True, slots=True)
class Joint:
    """One motor and its hinge.

    Attributes:
        name, parent, child: names of the joint and of the two links.
        T_parent_joint: (4, 4) pose of the child link in the parent link at zero angle.
        axis: (3,) unit vector in the child link.
        lower, upper: range [rad].
        velocity: limit [rad/s].
        torque: limit by source [N m]: `"urdf"` and `"paper"`.
    """

    name: str
    parent: str
    child: str
    T_parent_joint: Array
    axis: Array
    lower: float
    upper: float
    velocity: float
    torque: dict[str, float]


@dataclass(frozen=True, slots=True)
class SensorFrame:
    """A frame fixed to a link, x forward: `T_parent_frame` is (4, 4)."""

    name: str
    parent: str
    T_parent_frame: Array


@dataclass(frozen=True, slots=True)
class DofDefaults:
    """Passive joint dynamics: damping [N m s/rad], armature [kg m^2], frictionloss [N m]."""

    damping: float
    armature: float
    frictionloss: float


@dataclass(frozen=True, slots=True)
class Sole:
    """The flat of a foot in its ankle_roll link [m]: height z, extents (lower, upper) along x and y."""

    z: float
    x: tuple[float, float]
    y: tuple[float, float]


def _joint(row: dict[str, Any]) -> Joint:
    return Joint(
        name=row["name"],
        parent=row["parent"],
        child=row["name"].removesuffix("_joint") + "_link",
        T_parent_joint=transform(row["xyz"], rotation_rpy(row["roll"], 0.0, 0.0)),
        axis=np.array([float(row["axis"] == a) for a in "xyz"]),
        lower=float(row["range"][0]),
        upper=float(row["range"][1]),
        velocity=float(row["velocity"]),
        torque={"urdf": float(row["urdf_torque"]), "paper": float(row["paper_torque"])},
    )


_DATA: dict[str, Any] = load_data(__package__, "h12.yaml")

JOINTS: tuple[Joint, ...] = tuple(_joint(row) for row in _DATA["joints"])
"""The 27 joints in the motor order of the vendor's SDK."""
JOINT_NAMES: tuple[str, ...] = tuple(joint.name for joint in JOINTS)
"""Their names, in the same order."""
JOINT_INDEX: dict[str, int] = {name: i for i, name in enumerate(JOINT_NAMES)}
"""Motor index by joint name."""
LINKS: dict[str, Inertial] = {r["name"]: Inertial.of(r["mass"], r["com"], r["inertia"]) for r in _DATA["links"]}
"""Mass properties of the 28 links, each in its link frame, parents before children."""
FRAMES: dict[str, SensorFrame] = {
    row["name"]: SensorFrame(row["name"], row["parent"], transform(row["xyz"], rotation_rpy(*row["rpy"])))
    for row in _DATA["frames"]
}
"""Sensor frames: `imu_link`, `camera_link` (head), `lidar_link`."""
DOF = DofDefaults(**_DATA["dof"])
"""Passive dynamics of every body joint."""
SOLE = Sole(_DATA["sole"]["z"], tuple(_DATA["sole"]["x"]), tuple(_DATA["sole"]["y"]))
"""The sole, the same for both feet."""
BASE_HEIGHT: float = _DATA["base_height"]
"""Height of the pelvis above the floor that clears the soles by 1.8 mm when every joint is at zero [m]."""
T_TORSO_HEAD_OPTICAL: Array = FRAMES["camera_link"].T_parent_frame @ transform(
    (0.0, 0.0, 0.0), np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
)
"""(4, 4) optical frame of the head camera (z forward, x right, y down) in the torso link."""
