"""Reads the links of a URDF as triangle meshes on a tree: all that a description has for spheres, and nothing else.

MuJoCo's compiler drops visuals, mimics and locked joints, and refuses masses that spheres do not need.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation
from tqdm import tqdm

from golem.errors import ConfigError
from golem.evaluation.spheres import robot_geometry
from golem.evaluation.spheres.mesh_file import find_mesh, read_mesh
from golem.evaluation.spheres.robot_geometry import GeometryChoice, RobotGeometry
from golem.robots.model.link_geometry import JointKind, LinkGeometry, SurfacePart
from golem.robots.model.spatial import rotation_rpy, transform
from golem.robots.mujoco.geom_mesh import primitive
from golem.types import Array

KINDS: dict[str, JointKind] = {"fixed": "fixed", "revolute": "hinge", "continuous": "hinge", "prismatic": "slide"}
NAMED = 12
"""How many findings a message names."""
UNLIMITED: dict[JointKind, float] = {"fixed": 0.0, "hinge": math.pi, "slide": 1.0}
"""Range of a joint without limits, to both sides [rad or m]."""
_SHAPES = ("box", "sphere", "cylinder", "capsule", "mesh")


@dataclass(slots=True)
class _Reader:
    file: Path
    packages: Mapping[str, Path]
    folder: str
    findings: list[str]

    def numbers(self, element: ET.Element | None, key: str, default: str, where: str) -> Array:
        """Return the numbers of an attribute; as many as the default has."""
        text = default if element is None else element.get(key, default)
        try:
            found = np.array([float(word) for word in text.split()])
        except ValueError:
            found = np.zeros(0)
        count = len(default.split())
        if len(found) != count or not np.isfinite(found).all():
            self.findings.append(f"{where}: {key} is {count} numbers, not '{text}'")
            return np.array([float(word) for word in default.split()])
        return found

    def pose(self, element: ET.Element, where: str) -> Array:
        """Return the (4, 4) pose of the `origin` of an element."""
        origin = element.find("origin")
        xyz, rpy = (self.numbers(origin, key, "0 0 0", where) for key in ("xyz", "rpy"))
        return transform(xyz, rotation_rpy(*(float(angle) for angle in rpy)))

    def parts(self, link: ET.Element, choice: GeometryChoice) -> tuple[SurfacePart, ...]:
        """Return the chosen surfaces of a link, or the others where it has none."""
        where = f"link '{link.get('name')}'"
        other = "collision" if choice == "visual" else "visual"
        for kind in (choice, other):
            shapes = [
                (element, shape)
                for element in link.findall(kind)
                if (shape := next((s for n in _SHAPES if (s := element.find(f"geometry/{n}")) is not None), None))
                is not None
            ]
            if shapes:
                found = [self._part(shape, self.pose(element, where), where) for element, shape in shapes]
                return tuple(part for part in found if part is not None)
        return ()

    def _part(self, shape: ET.Element, T: Array, where: str) -> SurfacePart | None:
        count = len(self.findings)
        if shape.tag == "mesh":
            name = shape.get("filename", "")
            scale = self.numbers(shape, "scale", "1 1 1", where)
            path = find_mesh(name, self.file, self.packages, self.folder)
            if path is None:
                self.findings.append(f"{where}: there is no mesh '{name}'")
                return None
            try:
                vertices, faces = read_mesh(path)
            except ConfigError as error:
                self.findings.append(f"{where}: {error}")
                return None
            vertices = vertices * scale
        else:
            size = 0.5 * self.numbers(shape, "size", "1 1 1", where) if shape.tag == "box" else np.zeros(3)
            if shape.tag != "box":
                size[0] = self.numbers(shape, "radius", "1", where)[0]
            if shape.tag in ("cylinder", "capsule"):
                size[1] = 0.5 * self.numbers(shape, "length", "1", where)[0]
            if size.min() < 0.0:
                self.findings.append(f"{where}: its {shape.tag} has a negative size")
            if len(self.findings) > count or not size.any():  # one of size 0 stands for none
                return None
            mesh = primitive(shape.tag, *(float(v) for v in size))
            vertices, faces = np.asarray(mesh.vertices, float), np.asarray(mesh.faces, np.int64)
        return SurfacePart(vertices @ T[:3, :3].T + T[:3, 3], faces)

    def joint(self, element: ET.Element) -> list[LinkGeometry]:
        """Return the joint of an element as links without a name, three for a planar one; none for another kind."""
        name, kind = element.get("name", ""), element.get("type", "")
        where = f"joint '{name}'"
        if kind not in KINDS and kind != "planar":
            self.findings.append(f"{where} is {kind or 'of no kind'}; links hang on planar, {', '.join(KINDS)}")
            return []
        T, axis = self.pose(element, where), self.numbers(element.find("axis"), "xyz", "1 0 0", where)
        length = float(np.linalg.norm(axis))
        if kind != "fixed" and length < 1e-9:
            self.findings.append(f"{where}: its axis has no length")
        axis = axis / length if length > 1e-9 else np.array([0.0, 0.0, 1.0])
        if kind == "planar":
            rows: tuple[tuple[str, JointKind, Array], ...] = (
                *zip(("TX", "TY"), ("slide", "slide"), _across(axis), strict=True),
                ("RZ", "hinge", axis),
            )
            return [
                LinkGeometry("", -1, T if k == "TX" else np.eye(4), f"{name}_{k}", one, a, np.zeros(3),
                             -UNLIMITED[one], UNLIMITED[one], ())
                for k, one, a in rows
            ]  # fmt: skip
        limit = element.find("limit")
        bound = UNLIMITED[KINDS[kind]]
        lower, upper = -bound, bound
        if kind in ("revolute", "prismatic") and limit is not None:
            lower, upper = (_bound(limit.get(key, "0"), s * bound) for key, s in (("lower", -1), ("upper", 1)))
        if lower > upper:
            self.findings.append(f"{where}: its lower limit {lower:g} is above its upper limit {upper:g}")
        mimic = element.find("mimic")
        leader, ratio, offset = "", 1.0, 0.0
        if mimic is not None and KINDS[kind] != "fixed":
            leader = mimic.get("joint", "")
            ratio = float(self.numbers(mimic, "multiplier", "1", where)[0])
            offset = float(self.numbers(mimic, "offset", "0", where)[0])
        title = "" if kind == "fixed" else name
        turns = KINDS[kind]
        return [LinkGeometry("", -1, T, title, turns, axis, np.zeros(3), lower, upper, (), leader, ratio, offset)]


def read_urdf(root: ET.Element, file: Path, choice: GeometryChoice, packages: Mapping[str, Path]) -> RobotGeometry:
    """Return the links of a URDF; see `read_geometry`.

    A joint whose limits are equal stays where they are. Raises ConfigError: something is wrong with it; names all that
    is.

    Args:
        root: its element `robot`.
        packages: folders of ROS packages by name.
    """
    unfilled = any("${" in value for element in root.iter() for value in element.attrib.values())
    if any("xacro" in element.tag for element in root.iter()) and (unfilled or root.find("link") is None):
        raise ConfigError(f"'{file}' is a xacro file; `xacro {file.name} > robot.urdf` makes a URDF of it.")
    compiler = root.find("mujoco/compiler")
    reader = _Reader(file, packages, "" if compiler is None else compiler.get("meshdir", ""), [])
    elements = {link.get("name", ""): link for link in root.findall("link")}
    joints = root.findall("joint")
    findings = reader.findings
    for what, names in (
        ("link", [link.get("name", "") for link in root.findall("link")]),
        ("joint", [joint.get("name", "") for joint in joints]),
    ):
        findings += [f"{what} '{name}' occurs twice" for name in sorted({n for n in names if names.count(n) > 1})]
    below: dict[str, list[tuple[str, ET.Element]]] = {name: [] for name in elements}
    above: dict[str, str] = {}
    for joint in joints:
        ends = [_link(joint, end) for end in ("parent", "child")]
        lost = [end for end in ends if end not in elements]
        if lost:
            findings.append(f"joint '{joint.get('name')}' joins the link '{lost[0]}', which there is not")
        elif ends[1] in above:
            findings.append(f"link '{ends[1]}' hangs on two joints")
        else:
            above[ends[1]] = ends[0]
            below[ends[0]].append((ends[1], joint))
    roots = [name for name in elements if name not in above]
    if len(roots) != 1:
        which = ", ".join(roots[:3]) or ("its links hang in a circle" if elements else "and no links")
        findings.append(f"it has {len(roots)} roots ({which}), not one")
    base = LinkGeometry("", -1, np.eye(4), "", "fixed", np.array([0.0, 0.0, 1.0]), np.zeros(3), 0.0, 0.0, ())
    links: list[LinkGeometry] = []
    waiting = [(name, -1, [base]) for name in roots]
    bar = tqdm(total=len(elements), desc="links", disable=None)
    while waiting:
        name, parent, chain = waiting.pop()
        for k, between in enumerate(chain[:-1]):
            links.append(replace(between, name=f"{name}:{k}", parent=parent))
            parent = len(links) - 1
        links.append(replace(chain[-1], name=name, parent=parent, parts=reader.parts(elements[name], choice)))
        bar.update()
        here = len(links) - 1
        for child, element in reversed(below[name]):
            floats = element.get("type") == "floating" and parent < 0 and not links[here].parts
            chain = [base] if floats else reader.joint(element)  # the free root of a robot that goes about
            waiting.append((child, here, chain or [base]))
    bar.close()
    links, wrong = robot_geometry.led(links)
    findings += wrong
    if findings:
        more = f"; and {len(findings) - NAMED} more" if len(findings) > NAMED else ""
        raise ConfigError(f"'{file}' cannot be read as a robot: {'; '.join(findings[:NAMED])}{more}.")
    return robot_geometry.with_surface(RobotGeometry(file.stem, tuple(links)))


def _link(joint: ET.Element, end: str) -> str:
    element = joint.find(end)
    return "" if element is None else element.get("link", "")


def _across(axis: Array) -> tuple[Array, Array]:
    """Return the two directions of the plane across an axis (3,): x and y, turned as z is to the axis."""
    turn = Rotation.align_vectors(axis[np.newaxis], np.array([[0.0, 0.0, 1.0]]))[0].as_matrix()
    return turn[:, 0], turn[:, 1]


def _bound(text: str, unlimited: float) -> float:
    """Return a limit; one that is no number or beyond all bounds is none."""
    try:
        value = float(text)
    except ValueError:
        return unlimited
    return value if abs(value) < 1e6 else unlimited
