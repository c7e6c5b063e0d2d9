"""The robot as a file for other software: URDF or MJCF, from the same table as everything else."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from mujoco import mjtGeom

from golem.errors import OutputError, unknown_name
from golem.robots.model import contact_shapes, magpie_model, mjcf
from golem.robots.model.contact_shapes import Shape
from golem.robots.model.spatial import Inertial, rpy_of, transform
from golem.robots.model.table import FRAMES, JOINTS, LINKS, T_TORSO_HEAD_OPTICAL
from golem.types import SIDES, Array


@dataclass(frozen=True)
class ExportConfig:
    """Write the robot model to a file."""

    out: Path
    """The file to write."""
    format: str = "mjcf"
    """urdf or mjcf."""
    hands: bool = True
    """With the MAGPIE hands."""


def run_export(config: ExportConfig) -> None:
    """Write the file, and say so. Raises ConfigError, OutputError: see `export`."""
    export(config.format, config.hands, config.out)
    print(f"Wrote {config.out}")


def export(format: str, hands: bool, out: Path) -> None:
    """Write the robot to a file, whole or not at all.

    Args:
        format: `"urdf"` or `"mjcf"`.
        hands: with the MAGPIE hands.
        out: the file; an existing one is replaced.

    Raises:
        ConfigError: unknown format.
        OutputError: the file cannot be written.
    """
    if format not in _FORMATS:
        raise unknown_name("model format", format, _FORMATS)
    text = _FORMATS[format](hands)
    try:
        handle, temporary = tempfile.mkstemp(dir=out.parent, prefix=f".{out.name}.")
        try:
            with os.fdopen(handle, "w", encoding="utf-8") as file:
                file.write(text)
            Path(temporary).chmod(0o644)
            Path(temporary).replace(out)
        except BaseException:
            Path(temporary).unlink(missing_ok=True)
            raise
    except OSError as error:
        raise OutputError(
            f"Cannot write '{out}': {error.strerror}; give a file in a folder you may write to."
        ) from error


def export_mjcf(hands: bool) -> str:
    """Return the robot as MJCF, visual meshes included in the text; no floor, light or options."""
    spec = mjcf.robot_spec(hands)
    spec.compile()
    return spec.to_xml()


def export_urdf(hands: bool) -> str:
    """Return the robot as URDF.

    The root is `pelvis`, without a floating joint. URDF knows no capsules and no meshes without files, so both visual
    and collision are the contact primitives, a capsule being a cylinder with two spheres. A finger's hinge mimics its
    crank; readers without mimic joints (Pinocchio by default, SAPIEN) see it as a free hinge.
    """
    robot = ElementTree.Element("robot", name="golem_h12")
    shapes: dict[str, list[Shape]] = {}
    for shape in contact_shapes.body_shapes():
        shapes.setdefault(shape.link, []).append(shape)
    for name, inertial in LINKS.items():
        _link(robot, name, inertial, shapes.get(name, []))
    for joint in JOINTS:
        element = _joint(robot, joint.name, "revolute", joint.parent, joint.child, joint.T_parent_joint)
        _hinge(element, joint.axis, joint.lower, joint.upper, joint.torque["urdf"], joint.velocity)
    fixed = [(f.name, f.parent, f.T_parent_frame) for f in FRAMES.values()]
    fixed.append(("head_camera_optical", "torso_link", T_TORSO_HEAD_OPTICAL))
    if hands:
        for side in SIDES:
            hand = magpie_model.hand_name(side)
            _link(robot, hand, magpie_model.BASE, [contact_shapes.housing_shape(hand)])
            _joint(robot, f"{hand}_mount", "fixed", f"{side}_wrist_yaw_link", hand, magpie_model.T_WRIST_HAND)
            fixed.append((f"{side}_gripper", hand, magpie_model.T_HAND_GRIPPER))
            fixed.append((f"{side}_hand_camera_optical", hand, magpie_model.T_HAND_CAMERA))
            for finger in magpie_model.FINGERS:
                _finger(robot, hand, *magpie_model.finger_names(side, finger)[:2], finger)
    for name, parent, T in fixed:
        ElementTree.SubElement(robot, "link", name=name)
        _joint(robot, f"{name}_mount", "fixed", parent, name, T)
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding="unicode", xml_declaration=True) + "\n"


_FORMATS: dict[str, Callable[[bool], str]] = {"mjcf": export_mjcf, "urdf": export_urdf}


def _finger(robot: ElementTree.Element, hand: str, crank: str, blade: str, finger: magpie_model.Finger) -> None:
    mirrored = finger == "b"
    inertials = [i.mirrored() if mirrored else i for i in (magpie_model.CRANK, magpie_model.FINGER)]
    pad = Shape(
        blade, mjtGeom.mjGEOM_BOX, magpie_model.PAD_HALF_SIZE, magpie_model.mirror(finger, magpie_model.PAD_CENTER)
    )
    _link(robot, crank, inertials[0], [])
    _link(robot, blade, inertials[1], [contact_shapes.blade_shape(blade, finger), pad])
    axis = np.array([-1.0 if mirrored else 1.0, 0.0, 0.0])
    pivot = transform(magpie_model.mirror(finger, magpie_model.CRANK_PIVOT))
    element = _joint(robot, crank + "_joint", "revolute", hand, crank, pivot)
    _hinge(element, axis, 0.0, magpie_model.CLOSED, magpie_model.MAX_TORQUE, magpie_model.MAX_SPEED)
    pivot = transform(magpie_model.mirror(finger, magpie_model.FINGER_PIVOT))
    element = _joint(robot, blade + "_joint", "revolute", crank, blade, pivot)
    _hinge(element, axis, -magpie_model.CLOSED, 0.0, magpie_model.MAX_TORQUE, magpie_model.MAX_SPEED)
    ElementTree.SubElement(element, "mimic", joint=crank + "_joint", multiplier="-1", offset="0")


def _numbers(values: Array | list[float] | tuple[float, ...]) -> str:
    return " ".join(repr(float(v) + 0.0) for v in values)


def _origin(parent: ElementTree.Element, T: Array) -> None:
    ElementTree.SubElement(parent, "origin", xyz=_numbers(T[:3, 3]), rpy=_numbers(rpy_of(T[:3, :3])))


def _link(robot: ElementTree.Element, name: str, inertial: Inertial, shapes: list[Shape]) -> None:
    link = ElementTree.SubElement(robot, "link", name=name)
    mass = ElementTree.SubElement(link, "inertial")
    _origin(mass, transform(inertial.com))
    ElementTree.SubElement(mass, "mass", value=repr(inertial.mass))
    keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    ElementTree.SubElement(mass, "inertia", {k: repr(v) for k, v in zip(keys, inertial.six(), strict=True)})
    for shape in shapes:
        for tag in ("visual", "collision"):
            _geometry(link, tag, shape)


def _geometry(link: ElementTree.Element, tag: str, shape: Shape) -> None:
    def add(kind: str, pos: Array, rpy: tuple[float, float, float], **size: str) -> None:
        element = ElementTree.SubElement(link, tag)
        ElementTree.SubElement(element, "origin", xyz=_numbers(pos), rpy=_numbers(rpy))
        ElementTree.SubElement(ElementTree.SubElement(element, "geometry"), kind, size)

    radius, half = float(shape.size[0]), float(shape.size[1])
    level = (0.0, 0.0, 0.0)
    if shape.kind == mjtGeom.mjGEOM_BOX:
        add("box", shape.pos, level, size=_numbers(2.0 * shape.size))
    elif shape.kind == mjtGeom.mjGEOM_SPHERE:
        add("sphere", shape.pos, level, radius=repr(radius))
    else:
        quarter = float(np.pi / 2.0)
        along = {"x": (0.0, quarter, 0.0), "y": (-quarter, 0.0, 0.0), "z": level}[shape.axis]
        add("cylinder", shape.pos, along, radius=repr(radius), length=repr(2.0 * half))
        if shape.kind == mjtGeom.mjGEOM_CAPSULE:
            reach = half * np.array([float(shape.axis == a) for a in "xyz"])
            for end in (shape.pos - reach, shape.pos + reach):
                add("sphere", end, level, radius=repr(radius))


def _joint(robot: ElementTree.Element, name: str, kind: str, parent: str, child: str, T: Array) -> ElementTree.Element:
    joint = ElementTree.SubElement(robot, "joint", name=name, type=kind)
    _origin(joint, T)
    ElementTree.SubElement(joint, "parent", link=parent)
    ElementTree.SubElement(joint, "child", link=child)
    return joint


def _hinge(joint: ElementTree.Element, axis: Array, lower: float, upper: float, effort: float, velocity: float) -> None:
    ElementTree.SubElement(joint, "axis", xyz=_numbers(axis))
    values = {"lower": lower, "upper": upper, "effort": effort, "velocity": velocity}
    ElementTree.SubElement(joint, "limit", {key: repr(float(value)) for key, value in values.items()})
