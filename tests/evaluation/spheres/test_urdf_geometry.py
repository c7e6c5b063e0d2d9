"""URDFs of others: surfaces, where meshes may lie, joints that are held or follow, all that is wrong at once."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import trimesh
from tests.robots.model.collada import collada

from golem.errors import ConfigError
from golem.evaluation.spheres.link_poses import hold_joints, link_poses
from golem.evaluation.spheres.mesh_file import find_mesh, package_folders, read_mesh
from golem.evaluation.spheres.robot_geometry import RobotGeometry, read_geometry
from golem.robots.model.link_geometry import joint_names

BOX = '<geometry><box size="0.1 0.2 0.3"/></geometry>'
SHAPE = f"<collision>{BOX}</collision>"
SIZE = (0.2, 0.4, 0.6)
"""Sides of the mesh that the files here name."""


def joint(child: str, kind: str = "revolute", inner: str = "", parent: str = "base", name: str = "") -> str:
    return (
        f'<joint name="{name or child}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0.1 0.2 0.3" rpy="0.1 -0.2 0.3"/><axis xyz="0 2 0"/>{inner}</joint>'
    )


LIMIT = '<limit lower="-1" upper="2" effort="1" velocity="1"/>'


def robot(folder: Path, body: str, base: str = SHAPE) -> Path:
    path = folder / "robot.urdf"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f'<robot name="r"><link name="base">{base}</link>{body}</robot>')
    return path


def arm(folder: Path, inner: str = SHAPE, kind: str = "revolute", limit: str = LIMIT) -> RobotGeometry:
    return read_geometry(robot(folder, f'<link name="tip">{inner}</link>{joint("tip", kind, limit)}'))


def sides(robot: RobotGeometry, link: int = 1) -> list[float]:
    vertices = np.concatenate([part.vertices for part in robot.links[link].parts])
    return (vertices.max(axis=0) - vertices.min(axis=0)).tolist()


def mesh_link(name: str, what: str = "collision", scale: str = "") -> str:
    return f'<{what}><geometry><mesh filename="{name}" {scale}/></geometry></{what}>'


@pytest.mark.parametrize(("choice", "expected"), [("visual", [0.1, 0.1, 0.1]), ("collision", [0.1, 0.2, 0.3])])
def test_either_surface_is_read_and_the_other_where_it_is_alone(
    choice: str, expected: list[float], tmp_path: Path
) -> None:
    cube = '<visual><geometry><box size="0.1 0.1 0.1"/></geometry></visual>'
    path = robot(
        tmp_path,
        f'<link name="both">{cube}{SHAPE}</link><link name="seen">{cube}</link><link name="felt">{SHAPE}</link>'
        f'<link name="none"/>{"".join(joint(name, "fixed") for name in ("both", "seen", "felt", "none"))}',
    )
    read = read_geometry(path, choice)  # pyright: ignore[reportArgumentType]
    by_name = {link.name: i for i, link in enumerate(read.links)}
    assert sides(read, by_name["both"]) == pytest.approx(expected)
    assert sides(read, by_name["seen"]) == pytest.approx([0.1, 0.1, 0.1])
    assert sides(read, by_name["felt"]) == pytest.approx([0.1, 0.2, 0.3])
    assert read.links[by_name["none"]].parts == ()


SHAPES = {
    '<sphere radius="0.1"/>': (0.2, 0.2, 0.2),
    '<cylinder radius="0.1" length="0.6"/>': (0.2, 0.2, 0.6),
    '<capsule radius="0.1" length="0.6"/>': (0.2, 0.2, 0.8),
    '<box size="0.1 0.2 0.3"/>': (0.1, 0.2, 0.3),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_shapes_have_the_sizes_of_a_urdf(shape: str, tmp_path: Path) -> None:
    read = arm(tmp_path, f"<visual><origin xyz='1 0 0'/><geometry>{shape}</geometry></visual>")
    assert sides(read) == pytest.approx(SHAPES[shape], abs=2e-3)
    middle = np.mean([read.links[1].parts[0].vertices.max(axis=0), read.links[1].parts[0].vertices.min(axis=0)], axis=0)
    assert middle == pytest.approx([1.0, 0.0, 0.0], abs=1e-3)


INERTIAS = {
    "none": "",
    "no inertia": '<mass value="1"/>',
    "no mass": '<mass value="0"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>',
    "A + B < C": '<mass value="1"/><inertia ixx="5" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>',
    "negative": '<mass value="1"/><inertia ixx="-1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>',
    "no numbers": '<mass value="heavy"/>',
}


@pytest.mark.parametrize("inertia", INERTIAS)
def test_spheres_need_no_inertia(inertia: str, tmp_path: Path) -> None:
    read = arm(tmp_path, f"{SHAPE}<inertial>{INERTIAS[inertia]}</inertial>")
    assert [len(link.parts) for link in read.links] == [1, 1]


@pytest.mark.parametrize(
    ("name", "at", "variable"),
    [
        ("c.stl", "ws/arm/urdf/c.stl", ""),
        ("../meshes/c.stl", "ws/arm/meshes/c.stl", ""),
        ("package://arm/meshes/c.stl", "ws/arm/meshes/c.stl", ""),
        ("package://arm/meshes/c.stl", "ws/arm/urdf/meshes/c.stl", ""),
        ("package://other/meshes/c.stl", "ws/other/meshes/c.stl", ""),
        ("package://renamed/meshes/c.stl", "ws/arm/meshes/c.stl", ""),
        ("package://far/meshes/c.stl", "opt/far/meshes/c.stl", "ROS_PACKAGE_PATH=opt"),
        ("package://far/meshes/c.stl", "opt/far/meshes/c.stl", "ROS_PACKAGE_PATH=none:opt/far"),
        ("package://far/meshes/c.stl", "opt/share/far/meshes/c.stl", "AMENT_PREFIX_PATH=opt"),
        ("package://given/meshes/c.stl", "anywhere/meshes/c.stl", "--package"),
        ("model://arm/meshes/c.stl", "ws/arm/meshes/c.stl", ""),
        ("$(find arm)/meshes/c.stl", "ws/arm/meshes/c.stl", ""),
        ("file://$(find arm)/meshes/c.stl", "ws/arm/meshes/c.stl", ""),
        ("file://{tmp}/ws/x/c.stl", "ws/x/c.stl", ""),
        ("{tmp}/ws/x/c.stl", "ws/x/c.stl", ""),
        ("package://arm/my%20meshes/c.stl", "ws/arm/my meshes/c.stl", ""),
        ("..\\meshes\\c.stl", "ws/arm/meshes/c.stl", ""),
    ],
)
def test_where_a_mesh_may_lie(
    name: str, at: str, variable: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for path in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"):
        monkeypatch.delenv(path, raising=False)
    packages = {}
    if variable == "--package":
        (tmp_path / "anywhere").mkdir()
        packages = package_folders((f"given={tmp_path / 'anywhere'}",))
    elif variable:
        key, _, folders = variable.partition("=")
        monkeypatch.setenv(key, ":".join(str(tmp_path / folder) for folder in folders.split(":")))
    mesh = tmp_path / at
    mesh.parent.mkdir(parents=True, exist_ok=True)
    trimesh.creation.box(SIZE).export(mesh)
    filename = name.format(tmp=tmp_path)
    path = robot(
        tmp_path / "ws" / "arm" / "urdf", f'<link name="tip">{mesh_link(filename)}</link>{joint("tip", "fixed")}'
    )
    found = find_mesh(filename, path, packages)
    assert found is not None and found.resolve() == mesh.resolve()
    assert sides(read_geometry(path, packages=packages)) == pytest.approx(SIZE, abs=1e-6)


@pytest.mark.parametrize("name", ["meshes/c.stl", "c.stl", "elsewhere/c.stl"])
def test_meshdir_counts_though_the_names_have_it_already(name: str, tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    trimesh.creation.box(SIZE).export(tmp_path / "meshes" / "c.stl")
    compiler = '<mujoco><compiler meshdir="meshes" discardvisual="false"/></mujoco>'
    path = robot(tmp_path, f'<link name="tip">{mesh_link(name)}</link>{joint("tip", "fixed")}{compiler}')
    assert sides(read_geometry(path)) == pytest.approx(SIZE, abs=1e-6)


@pytest.mark.parametrize("ending", ["stl", "STL", "obj", "ply", "glb", "off", "ascii.stl", "dae"])
@pytest.mark.parametrize(("scale", "factor"), [("", (1, 1, 1)), ('scale="0.001 -0.002 0.003"', (0.001, 0.002, 0.003))])
def test_meshes_of_many_formats(ending: str, scale: str, factor: tuple[float, ...], tmp_path: Path) -> None:
    file, box = tmp_path / f"c.{ending}", trimesh.creation.box(SIZE)
    if ending == "dae":
        file.write_text(collada(box))
    elif ending == "ascii.stl":
        file.write_text(str(box.export(file_type="stl_ascii")))
    else:
        box.export(file, file_type=ending.lower())
    read = arm(tmp_path, mesh_link(file.name, "visual", scale))
    assert sides(read) == pytest.approx(np.multiply(SIZE, factor), rel=1e-5)
    assert len(read.links[1].parts[0].faces) == 12


@pytest.mark.parametrize(("unit", "up", "moved"), [("0.001", "Z_UP", 0.0), ("0.0254", "Y_UP", 0.0), ("1", "X_UP", 3.0)])
def test_a_collada_file_counts_in_its_unit_and_stands_as_in_rviz(
    unit: str, up: str, moved: float, tmp_path: Path
) -> None:
    file = tmp_path / "c.dae"
    file.write_text(collada(trimesh.creation.box(SIZE), unit, up, moved))
    vertices, _ = read_mesh(file)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    assert high - low == pytest.approx(np.multiply(SIZE, float(unit)), rel=1e-5)
    assert (0.5 * (low + high))[0] == pytest.approx(moved * float(unit), abs=1e-6)


@pytest.mark.parametrize(
    ("kind", "inner", "expected"),
    [
        ("revolute", '<limit lower="0" upper="0" effort="1" velocity="1"/>', (0.0, 0.0)),
        ("revolute", '<limit lower="0.3" upper="0.3" effort="1" velocity="1"/>', (0.3, 0.3)),
        ("prismatic", '<limit lower="0.1" upper="0.1" effort="1" velocity="1"/>', (0.1, 0.1)),
        ("revolute", '<limit effort="1" velocity="1"/>', (0.0, 0.0)),
        ("revolute", '<limit lower="-1" upper="2" effort="1" velocity="1"/>', (-1.0, 2.0)),
        ("revolute", "", (-np.pi, np.pi)),
        ("revolute", '<limit lower="-1e16" upper="inf" effort="1" velocity="1"/>', (-np.pi, np.pi)),
        ("continuous", '<limit effort="1" velocity="1"/>', (-np.pi, np.pi)),
        ("prismatic", "", (-1.0, 1.0)),
    ],
)
def test_the_range_of_a_joint(kind: str, inner: str, expected: tuple[float, float], tmp_path: Path) -> None:
    link = arm(tmp_path, kind=kind, limit=inner).links[1]
    assert (link.lower, link.upper) == pytest.approx(expected)
    assert link.axis.tolist() == [0.0, 1.0, 0.0] and link.joint == "tip"


def follower(inner: str, first: str = LIMIT) -> str:
    links = "".join(f'<link name="{name}">{SHAPE}</link>' for name in ("a", "b", "c"))
    return (
        links
        + joint("a", inner=first)
        + joint("b", inner=LIMIT + inner)
        + joint("c", "prismatic", LIMIT + '<mimic joint="b" multiplier="0.5" offset="0.1"/>', "b")
    )


def test_joints_that_follow_another_are_not_free(tmp_path: Path) -> None:
    links = read_geometry(robot(tmp_path, follower('<mimic joint="a" multiplier="-2" offset="0.3"/>'))).links
    assert joint_names(links) == ["a"]
    b, c = (next(link for link in links if link.name == name) for name in "bc")
    assert (b.leader, b.ratio, b.offset) == ("a", -2.0, 0.3)
    assert (c.leader, c.ratio, c.offset) == pytest.approx(("a", -1.0, 0.25))  # 0.5 (-2 a + 0.3) + 0.1
    free = read_geometry(robot(tmp_path, follower("").replace("<mimic", "<no"))).links
    order = [link.joint for link in free if link.joint]
    q = {"a": 0.4, "b": -2 * 0.4 + 0.3, "c": -0.4 + 0.25}
    np.testing.assert_allclose(link_poses(links, np.array([0.4])), link_poses(free, np.array([q[j] for j in order])))
    held = hold_joints(links, {"a": 0.4})
    assert joint_names(held) == []
    np.testing.assert_allclose(link_poses(held, np.zeros(0)), link_poses(links, np.array([0.4])))


def test_every_kind_of_joint_moves_as_in_pinocchio(tmp_path: Path) -> None:
    kinds = ("revolute", "continuous", "prismatic", "fixed")
    names = [f"{kind}{k}" for k in range(2) for kind in kinds]
    body = "".join(f'<link name="{name}">{SHAPE}</link>' for name in names)
    body += "".join(
        joint(name, name[:-1], LIMIT, parent) for name, parent in zip(names, ["base", *names[:-1]], strict=True)
    )
    path = robot(tmp_path, body)
    links, model = read_geometry(path).links, pin.buildModelFromUrdf(str(path))
    q, x = np.random.default_rng(0).uniform(-1.0, 1.0, len(joint_names(links))), pin.neutral(model)
    for name, value in zip(joint_names(links), q, strict=True):
        one = model.joints[model.getJointId(name)]
        x[one.idx_q : one.idx_q + one.nq] = value if one.nq == 1 else (np.cos(value), np.sin(value))
    data = model.createData()
    pin.framesForwardKinematics(model, data, x)
    for link, T in zip(links, link_poses(links, q), strict=True):
        np.testing.assert_allclose(T, data.oMf[model.getFrameId(link.name, pin.FrameType.BODY)].homogeneous, atol=1e-12)


WRONG = {
    "swapped": (
        joint("tip", inner='<limit lower="1" upper="-1"/>'),
        "'tip': its lower limit 1 is above its upper limit -1",
    ),
    "ball": (joint("tip", "spherical"), "joint 'tip' is spherical; links hang on planar, fixed, revolute"),
    "no axis": (joint("tip").replace("0 2 0", "0 0 0"), "its axis has no length"),
    "no parent": (joint("tip", parent="nose"), "joins the link 'nose', which there is not"),
    "two roots": ("", r"it has 2 roots \(base, tip\), not one"),
    "two parents": (joint("tip") + joint("tip", name="again"), "link 'tip' hangs on two joints"),
    "no leader": (joint("tip", inner='<mimic joint="j"/>'), "'tip' follows 'j', which is no joint"),
    "itself": (joint("tip", inner='<mimic joint="tip"/>'), "'tip' follows 'tip', which is no joint"),
    "numbers": (joint("tip").replace("0.1 0.2 0.3", "0.1 ${x} 0.3"), "xyz is 3 numbers, not '0.1 .{x. 0.3'"),
    "twice": (joint("tip") + '<link name="tip"/>', "link 'tip' occurs twice"),
}


@pytest.mark.parametrize("what", WRONG)
def test_what_cannot_be_a_robot_is_named(what: str, tmp_path: Path) -> None:
    body, match = WRONG[what]
    with pytest.raises(ConfigError, match=match) as refusal:
        read_geometry(robot(tmp_path, f'<link name="tip">{SHAPE}</link>{body}'))
    assert "\n" not in str(refusal.value)


def test_all_that_is_wrong_is_named_at_once(tmp_path: Path) -> None:
    (tmp_path / "lfs.stl").write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0\n")
    (tmp_path / "bad.dae").write_text("no mesh")
    (tmp_path / "empty.obj").write_text("")
    names = ["package://far/a.stl", "lfs.stl", "bad.dae", "empty.obj", "gone.stl"]
    body = "".join(f'<link name="l{k}">{mesh_link(name)}</link>' for k, name in enumerate(names))
    body += "".join(joint(f"l{k}", inner='<limit lower="2" upper="1"/>') for k in range(len(names)))
    with pytest.raises(ConfigError) as refusal:
        read_geometry(robot(tmp_path, body))
    said = str(refusal.value)
    for words in ("'package://far/a.stl'", "Git LFS", "bad.dae holds no mesh", "empty.obj holds", "'gone.stl'"):
        assert words in said
    assert said.count("above its upper limit") == 5


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("", "it is no XML"),
        ("<robot", "it is no XML"),
        ("<sdf version='1.6'/>", "its root is <sdf>"),
        (
            '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:macro name="a"/></robot>',
            "is a xacro file; `xacro robot.urdf > ",
        ),
        ("<robot/>", "it has 0 roots"),
    ],
)
def test_a_file_that_is_no_robot_is_called_what_it_is(text: str, match: str, tmp_path: Path) -> None:
    (tmp_path / "robot.urdf").write_text(text)
    with pytest.raises(ConfigError, match=match):
        read_geometry(tmp_path / "robot.urdf")


def test_what_xacro_left_behind_and_shapes_of_no_size_do_not_matter(tmp_path: Path) -> None:
    nothing = '<visual><geometry><box size="0 0 0"/></geometry></visual>'
    body = f'<link name="tip">{nothing}</link>{joint("tip", "fixed")}<xacro:property name="a" value="1"/>'
    path = robot(tmp_path, body)
    path.write_text(path.read_text().replace("<robot ", '<robot xmlns:xacro="http://ros.org/wiki/xacro" '))
    assert [len(link.parts) for link in read_geometry(path).links] == [1, 0]
    path.write_text(path.read_text().replace(' xmlns:xacro="http://ros.org/wiki/xacro"', ""))
    assert [len(link.parts) for link in read_geometry(path).links] == [1, 0]  # of a space that is not declared


def test_folders_of_packages_are_named_with_them(tmp_path: Path) -> None:
    assert package_folders((f"arm={tmp_path}",)) == {"arm": tmp_path}
    for wrong in ("arm", f"={tmp_path}", f"arm={tmp_path / 'none'}"):
        with pytest.raises(ConfigError, match="--package takes NAME=FOLDER"):
            package_folders((wrong,))
