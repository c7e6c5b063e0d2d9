"""How the robot looks: our own shells and discs over the vendor's proportions, seen but never touched.

Written for the pelvis, the torso and the left side; the right side is the mirror image.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import mujoco
import numpy as np
from numpy.typing import NDArray

from golem.robots.model import magpie_model
from golem.robots.model.loft import Axis, Loft, ring
from golem.robots.model.spatial import quat_of, rotation_rpy
from golem.types import Array

VISUAL_GROUP = 2
"""Geom group of everything in this module."""

Material = Literal["shell", "graphite", "joint", "visor", "rubber", "accent", "glow", "metal"]
_MATERIALS: dict[Material, tuple[tuple[float, float, float], float, float, float]] = {
    "shell": ((0.56, 0.58, 0.61), 0.5, 0.5, 0.0),
    "graphite": ((0.17, 0.18, 0.20), 0.5, 0.45, 0.0),
    "joint": ((0.06, 0.065, 0.075), 0.6, 0.5, 0.0),
    "visor": ((0.015, 0.02, 0.03), 1.0, 0.95, 0.0),
    "rubber": ((0.035, 0.035, 0.035), 0.1, 0.1, 0.0),
    "accent": ((0.95, 0.42, 0.07), 0.4, 0.4, 0.05),
    "glow": ((0.25, 0.80, 1.0), 0.2, 0.5, 0.8),
    "metal": ((0.50, 0.52, 0.55), 0.8, 0.7, 0.0),
}
"""Colour, specular, shininess, emission."""

_KINDS = {
    "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER,
    "capsule": mujoco.mjtGeom.mjGEOM_CAPSULE,
    "ellipsoid": mujoco.mjtGeom.mjGEOM_ELLIPSOID,
    "box": mujoco.mjtGeom.mjGEOM_BOX,
}
_ALONG: dict[Axis, tuple[float, float, float]] = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1)}


@dataclass(frozen=True, slots=True)
class Solid:
    """A primitive: `size` as in MJCF, centre, and the direction of a cylinder's or capsule's length."""

    kind: str
    size: tuple[float, ...]
    pos: tuple[float, float, float]
    along: tuple[float, float, float] = (0.0, 0.0, 1.0)

    def mirrored(self) -> Solid:
        """Return the mirror image in the xz plane."""
        (x, y, z), (a, b, c) = self.pos, self.along
        return replace(self, pos=(x, -y, z), along=(a, -b, c))


@dataclass(frozen=True, slots=True)
class VisualPart:
    """Something to see on a link."""

    link: str
    material: Material
    shape: Loft | Solid

    def mirrored(self) -> VisualPart:
        """Return the same part of the right side."""
        return VisualPart(self.link.replace("left_", "right_", 1), self.material, self.shape.mirrored())


def _disc(axis: Axis, radius: float, half: float, pos: tuple[float, float, float]) -> Solid:
    return Solid("cylinder", (radius, half), pos, _ALONG[axis])


def _rod(start: Sequence[float], end: Sequence[float], radius: float) -> Solid:
    a, b = np.array(start, float), np.array(end, float)
    middle, span = (a + b) / 2.0, b - a
    half = float(np.linalg.norm(span)) / 2.0
    x, y, z = (span / (2.0 * half)).tolist()
    return Solid("capsule", (radius, half), (float(middle[0]), float(middle[1]), float(middle[2])), (x, y, z))


# fmt: off
# One line per part and a few sections per line: the tables below are read as shapes.


def _trunk() -> Iterable[VisualPart]:
    yield VisualPart("pelvis", "graphite", Loft("y", [
        (-0.153, -0.038, 0, 0.020, 0.036), (-0.142, -0.038, 0, 0.033, 0.055), (-0.10, -0.036, 0, 0.039, 0.066),
        (0.10, -0.036, 0, 0.039, 0.066), (0.142, -0.038, 0, 0.033, 0.055), (0.153, -0.038, 0, 0.020, 0.036),
    ], power=3.0))
    yield VisualPart("pelvis", "joint", _disc("z", 0.055, 0.014, (0, 0, 0.010)))
    yield VisualPart("pelvis", "glow", _disc("x", 0.010, 0.002, (0.0655, 0, -0.036)))
    torso = "torso_link"
    yield VisualPart(torso, "shell", Loft("z", [
        (0.028, 0, 0, 0.052, 0.074), (0.038, 0, 0, 0.064, 0.087), (0.06, 0, 0, 0.068, 0.092),
        (0.26, 0, 0, 0.071, 0.101), (0.40, 0, 0, 0.070, 0.108), (0.455, 0, 0, 0.066, 0.106),
        (0.475, 0, 0, 0.056, 0.095), (0.482, 0, 0, 0.044, 0.080),
    ], power=5.0, segments=32))
    yield VisualPart(torso, "joint", _disc("z", 0.062, 0.012, (0, 0, 0.020)))
    # Chest panel, its light, and the battery's cover on the back.
    yield VisualPart(torso, "graphite", Loft("x", [
        (0.060, 0, 0.345, 0.074, 0.098), (0.073, 0, 0.345, 0.070, 0.094), (0.0755, 0, 0.345, 0.064, 0.088),
    ], power=4.5, segments=28))
    yield VisualPart(torso, "glow", _rod((0.0755, -0.034, 0.395), (0.0755, 0.034, 0.395), 0.0035))
    yield VisualPart(torso, "accent", _rod((0.0720, -0.060, 0.150), (0.0720, 0.060, 0.150), 0.0030))
    yield VisualPart(torso, "graphite", Loft("x", [
        (-0.090, 0, 0.27, 0.060, 0.135), (-0.086, 0, 0.27, 0.070, 0.146), (-0.055, 0, 0.27, 0.076, 0.152),
    ], power=5.0, segments=28))
    # Neck and helmet. The lidar hangs under the brow, the depth camera sits in it.
    yield VisualPart(torso, "joint", _rod((-0.012, 0.036, 0.475), (0.002, 0.016, 0.585), 0.011))
    yield VisualPart(torso, "joint", _rod((-0.012, -0.036, 0.475), (0.002, -0.016, 0.585), 0.011))
    yield VisualPart(torso, "graphite", Loft("z", [
        (0.545, 0.020, 0, 0.026, 0.030), (0.565, 0.012, 0, 0.040, 0.046), (0.62, 0.004, 0, 0.054, 0.062),
        (0.665, 0.008, 0, 0.067, 0.071), (0.695, 0.016, 0, 0.078, 0.075), (0.716, 0.019, 0, 0.078, 0.072),
        (0.735, 0.020, 0, 0.069, 0.062), (0.748, 0.020, 0, 0.053, 0.047), (0.756, 0.020, 0, 0.034, 0.030),
        (0.760, 0.020, 0, 0.012, 0.010),
    ], power=2.3, segments=28))
    yield VisualPart(torso, "visor", Loft("z", [
        (0.553, 0.052, 0, 0.016, 0.022), (0.570, 0.050, 0, 0.034, 0.040), (0.61, 0.045, 0, 0.050, 0.054),
        (0.65, 0.045, 0, 0.057, 0.060), (0.682, 0.050, 0, 0.055, 0.058), (0.695, 0.050, 0, 0.040, 0.045),
    ], power=2.3, segments=24))
    yield VisualPart(torso, "visor", Solid("box", (0.011, 0.045, 0.0125), (0.100, 0.0, 0.693)))
    for y in (-0.0325, 0.0325):
        yield VisualPart(torso, "visor", _disc("x", 0.007, 0.0015, (0.1105, y, 0.693)))
    yield VisualPart(torso, "glow", Solid("ellipsoid", (0.004, 0.030, 0.0035), (0.1005, 0, 0.628)))


def _leg() -> Iterable[VisualPart]:
    # The hip's yaw motor is in the pelvis, its pitch motor in the yaw link, and so on down.
    yield VisualPart("pelvis", "joint", _disc("z", 0.050, 0.028, (0, 0.0875, -0.095)))
    yaw = "left_hip_yaw_link"
    yield VisualPart(yaw, "graphite", _disc("z", 0.046, 0.020, (0, 0, 0.055)))
    yield VisualPart(yaw, "graphite", _disc("y", 0.060, 0.038, (0, -0.010, 0)))
    yield VisualPart(yaw, "metal", _disc("y", 0.040, 0.044, (0, -0.010, 0)))
    pitch = "left_hip_pitch_link"
    yield VisualPart(pitch, "joint", Solid("ellipsoid", (0.056, 0.058, 0.060), (0, 0.002, 0)))
    yield VisualPart(pitch, "graphite", _disc("x", 0.036, 0.0575, (0, 0.002, 0)))
    thigh = "left_hip_roll_link"
    yield VisualPart(thigh, "shell", Loft("z", [
        (-0.442, 0.003, 0.001, 0.028, 0.030), (-0.430, 0.003, 0.001, 0.043, 0.041), (-0.37, 0.002, 0, 0.050, 0.045),
        (-0.26, -0.001, 0, 0.060, 0.051), (-0.165, -0.004, 0.002, 0.066, 0.055), (-0.105, -0.003, 0.006, 0.062, 0.050),
        (-0.070, 0, 0.014, 0.050, 0.038), (-0.060, 0, 0.016, 0.030, 0.028),
    ], power=2.9, segments=24))
    yield VisualPart(thigh, "shell", Loft("y", [
        (0.022, 0, 0, 0.060, 0.060), (0.046, -0.002, 0, 0.060, 0.060), (0.056, -0.002, 0, 0.050, 0.050),
        (0.059, -0.002, 0, 0.030, 0.030),
    ], power=2.0, segments=28))
    sections = [(-0.10, 0, 0.034, 0.055, 0.022), (0, 0, 0.040, 0.0585, 0.017)]
    yield VisualPart(thigh, "shell", Loft("z", sections, power=3.0))
    yield VisualPart(thigh, "accent", _disc("y", 0.016, 0.0035, (0, 0.0575, -0.002)))
    yield VisualPart(thigh, "joint", _disc("y", 0.040, 0.012, (-0.002, -0.049, -0.165)))
    shank = "left_knee_link"
    yield VisualPart(shank, "joint", _disc("y", 0.040, 0.044, (0, 0, 0)))
    yield VisualPart(shank, "metal", _disc("y", 0.024, 0.0465, (0, 0, 0)))
    yield VisualPart(shank, "shell", Loft("z", [
        (-0.345, -0.003, 0, 0.022, 0.025), (-0.33, -0.003, 0, 0.027, 0.028), (-0.25, -0.006, 0, 0.036, 0.035),
        (-0.15, -0.006, 0, 0.047, 0.041), (-0.08, -0.001, 0, 0.050, 0.043), (-0.042, 0.002, 0, 0.045, 0.040),
        (-0.030, 0.003, 0, 0.030, 0.030),
    ], power=3.0, segments=24))
    yield VisualPart(shank, "graphite", Loft("z", [
        (-0.408, 0, 0, 0.014, 0.020), (-0.395, 0, 0, 0.019, 0.024), (-0.335, -0.003, 0, 0.022, 0.024),
    ], power=3.0))
    yield VisualPart(shank, "graphite", _rod((-0.026, 0.0, -0.30), (-0.030, 0.0, -0.41), 0.008))
    yield VisualPart("left_ankle_pitch_link", "metal", _disc("y", 0.014, 0.027, (0, 0, 0)))
    foot = "left_ankle_roll_link"
    yield VisualPart(foot, "graphite", Loft("x", [
        (-0.084, 0, -0.026, 0.024, 0.012), (-0.072, 0, -0.018, 0.034, 0.020), (-0.025, 0, -0.006, 0.037, 0.032),
        (0.022, 0, -0.006, 0.038, 0.032), (0.075, 0, -0.018, 0.041, 0.020), (0.130, 0, -0.025, 0.040, 0.013),
        (0.162, 0, -0.028, 0.030, 0.009), (0.171, 0, -0.030, 0.018, 0.006),
    ], power=3.2, segments=24))
    yield VisualPart(foot, "rubber", Loft("z", [
        (-0.045, 0.044, 0, 0.1275, 0.0405), (-0.034, 0.044, 0, 0.130, 0.043), (-0.030, 0.044, 0, 0.127, 0.040),
    ], power=3.6, segments=28))


def _arm() -> Iterable[VisualPart]:
    c, s = float(np.cos(0.2618)), float(np.sin(0.2618))
    yield VisualPart("torso_link", "joint", Solid("cylinder", (0.040, 0.030), (0, 0.124, 0.417), (0, c, s)))
    shoulder = "left_shoulder_pitch_link"
    yield VisualPart(shoulder, "graphite", _disc("y", 0.038, 0.026, (0, 0.034, -0.004)))
    yield VisualPart(shoulder, "joint", Solid("ellipsoid", (0.033, 0.044, 0.040), (0.0, 0.066, -0.006)))
    upper = "left_shoulder_roll_link"
    yield VisualPart(upper, "shell", Loft("z", [
        (-0.118, -0.034, 0, 0.041, 0.041), (-0.10, -0.034, 0, 0.042, 0.042), (-0.05, -0.035, 0, 0.043, 0.043),
        (0.0, -0.035, 0, 0.044, 0.045), (0.024, -0.035, 0, 0.040, 0.041), (0.038, -0.035, 0, 0.029, 0.030),
        (0.044, -0.035, 0, 0.014, 0.015),
    ], power=2.4, segments=22))
    yield VisualPart(upper, "graphite", _disc("x", 0.036, 0.006, (0.008, 0, 0)))
    yield VisualPart(upper, "accent", _disc("x", 0.013, 0.0075, (0.0085, 0, 0)))
    yield VisualPart(upper, "joint", _disc("z", 0.039, 0.014, (-0.0342, 0, -0.131)))
    elbow = "left_shoulder_yaw_link"
    yield VisualPart(elbow, "shell", Loft("z", [
        (-0.180, 0.006, 0.012, 0.034, 0.020), (-0.165, 0.006, 0.010, 0.035, 0.024), (-0.12, 0.004, 0.003, 0.034, 0.033),
        (-0.06, 0.001, 0, 0.037, 0.037), (-0.014, 0, 0, 0.040, 0.040), (-0.003, 0, 0, 0.039, 0.039),
    ], power=2.4, segments=22))
    yield VisualPart(elbow, "graphite", _disc("y", 0.042, 0.017, (0.006, 0.020, -0.182)))
    yield VisualPart(elbow, "accent", _disc("y", 0.013, 0.018, (0.006, 0.021, -0.182)))
    forearm = "left_elbow_link"
    yield VisualPart(forearm, "joint", _disc("y", 0.042, 0.018, (0, -0.022, 0)))
    yield VisualPart(forearm, "metal", _disc("y", 0.024, 0.018, (0, -0.026, 0)))
    yield VisualPart(forearm, "shell", Loft("x", [
        (-0.004, -0.034, -0.003, 0.020, 0.026), (0.012, -0.033, -0.004, 0.028, 0.034),
        (0.06, -0.033, -0.008, 0.032, 0.035), (0.108, -0.033, -0.011, 0.034, 0.034),
        (0.118, -0.033, -0.011, 0.031, 0.031),
    ], power=2.6, segments=22))
    wrist = "left_wrist_roll_link"
    yield VisualPart(wrist, "joint", _disc("x", 0.032, 0.005, (0.002, 0, 0)))
    yield VisualPart(wrist, "shell", Loft("x", [
        (0.006, 0, 0, 0.031, 0.031), (0.016, 0, 0, 0.034, 0.033), (0.050, 0, 0, 0.033, 0.032),
        (0.066, 0, 0, 0.028, 0.026),
    ], power=2.5, segments=22))
    yield VisualPart(wrist, "graphite", _disc("y", 0.027, 0.034, (0.087, 0, 0)))
    yield VisualPart("left_wrist_pitch_link", "joint", _disc("z", 0.026, 0.030, (0.020, 0, 0)))
    palm = "left_wrist_yaw_link"
    yield VisualPart(palm, "graphite", Loft("x", [
        (0.004, 0, 0, 0.026, 0.040), (0.030, 0, 0, 0.028, 0.040), (0.046, 0, 0, 0.029, 0.032),
        (0.054, 0, 0, 0.029, 0.029),
    ], power=3.0))
    yield VisualPart(palm, "metal", _disc("x", 0.032, 0.0125, (0.0665, 0, 0)))


def _hand() -> Iterable[VisualPart]:
    hand = "left_hand"
    yield VisualPart(hand, "graphite", Loft("x", [
        (-0.016, 0, 0.029, 0.060, 0.026), (0.012, 0, 0.029, 0.060, 0.026)
    ], power=4.0))
    yield VisualPart(hand, "joint", Loft("z", [
        (0.022, 0, 0, 0.0205, 0.0205), (0.044, 0, 0, 0.0205, 0.0205), (0.0455, 0, 0, 0.019, 0.019)
    ], power=5.0))
    for y in (-0.009, 0.009):
        yield VisualPart(hand, "visor", _disc("z", 0.005, 0.0006, (0.006, y, 0.0455)))
    for s in (1.0, -1.0):
        for x in (-0.0175, 0.0135):
            yield VisualPart(hand, "shell", Loft("x", [
                (x - 0.0025, s * 0.046, 0.046, 0.0205, 0.039), (x + 0.0025, s * 0.046, 0.046, 0.0205, 0.039)
            ], power=3.0))
        yield VisualPart(hand, "joint", Loft("x", [
            (-0.015, s * 0.045, 0.046, 0.018, 0.035), (0.011, s * 0.045, 0.046, 0.018, 0.035)
        ], power=5.0))
        yield VisualPart(hand, "metal", _disc("x", 0.009, 0.019, (-0.002, s * 0.038, 0.069)))


def _finger() -> Iterable[VisualPart]:
    crank, blade, _ = magpie_model.finger_names("left", "a")
    pivot = magpie_model.FINGER_PIVOT
    for x in (-0.0045, -0.0125):
        yield VisualPart(crank, "accent", _rod((x, 0, 0), (x, pivot[1], pivot[2]), 0.0042))
    yield VisualPart(blade, "metal", _disc("x", 0.0065, 0.0085, (0, 0, 0)))
    yield VisualPart(blade, "graphite", _rod((0, 0, 0), (0, 0.022, -0.004), 0.006))
    # The outer edge curves in to the tip; the inner edge is straight and carries the pad.
    inner = -0.0208
    outer = [(0.0, 0.003), (0.02, 0.004), (0.045, 0.0), (0.065, -0.0075), (0.0813, -0.0175)]
    yield VisualPart(blade, "graphite", Loft("z", [
        (z, 0.003, (inner + y) / 2.0, 0.008, (y - inner) / 2.0) for z, y in outer
    ], power=5.0))
    x, y, z = magpie_model.PAD_CENTER.tolist()
    yield VisualPart(blade, "rubber", Solid("box", tuple(magpie_model.PAD_HALF_SIZE.tolist()), (x, y, z)))


# fmt: on


def parts(hands: bool) -> list[VisualPart]:
    """Return everything to see of the robot, with or without hands."""
    left = [*_leg(), *_arm()]
    whole = [*_trunk(), *left, *(part.mirrored() for part in left)]
    if hands:
        # The two hands are the same hand twice, not mirror images: only finger b mirrors finger a.
        a = list(_finger())
        b = [VisualPart(p.link.replace("_a_", "_b_"), p.material, p.shape.mirrored()) for p in a]
        hand = [*_hand(), *a, *b]
        whole += [*hand, *(replace(part, link=part.link.replace("left_", "right_", 1)) for part in hand)]
    return whole


def add_looks(spec: mujoco.MjSpec, hands: bool) -> None:
    """Add every part, and the materials and meshes it needs, to the robot's spec."""
    for name, (rgb, specular, shininess, emission) in _MATERIALS.items():
        spec.add_material(
            name=f"h12_{name}", rgba=[*rgb, 1.0], specular=specular, shininess=shininess, emission=emission
        )
    # The rim of the open face, tilted so that the chin lies further back than the brow.
    _add_mesh(spec, "h12_face", *ring(0.066, 0.080, 0.0085))
    tilt = quat_of(rotation_rpy(0.0, 0.22, 0.0))
    _add_geom(spec.body("torso_link"), "graphite", pos=(0.086, 0.0, 0.632), quat=tilt, meshname="h12_face")
    for number, part in enumerate(parts(hands)):
        body = spec.body(part.link)
        if isinstance(part.shape, Loft):
            mesh = f"h12_{part.link}_{number}"
            _add_mesh(spec, mesh, *part.shape.mesh())
            _add_geom(body, part.material, meshname=mesh)
        else:
            size = [*part.shape.size, 0.0, 0.0][:3]
            quat = quat_of(_turned(part.shape.along))
            _add_geom(body, part.material, kind=_KINDS[part.shape.kind], size=size, pos=part.shape.pos, quat=quat)


def _turned(along: Sequence[float]) -> Array:
    """Return a rotation that takes z to the unit vector `along`."""
    z = np.array(along, float)
    x = np.cross((0.0, 1.0, 0.0) if abs(z[1]) < 0.9 else (0.0, 0.0, 1.0), z)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def _add_mesh(spec: mujoco.MjSpec, name: str, vertices: Array, faces: NDArray[np.int32]) -> None:
    spec.add_mesh(name=name, uservert=vertices.ravel(), userface=faces.ravel())


def _add_geom(
    body: mujoco.MjsBody,
    material: Material,
    *,
    kind: mujoco.mjtGeom = mujoco.mjtGeom.mjGEOM_MESH,
    size: Sequence[float] = (0.0, 0.0, 0.0),
    pos: Sequence[float] = (0.0, 0.0, 0.0),
    quat: Sequence[float] | Array = (1.0, 0.0, 0.0, 0.0),
    meshname: str = "",
) -> None:
    body.add_geom(
        type=kind,
        size=list(size),
        pos=list(pos),
        quat=list(quat),
        meshname=meshname,
        material=f"h12_{material}",
        contype=0,
        conaffinity=0,
        group=VISUAL_GROUP,
        mass=0.0,
    )
