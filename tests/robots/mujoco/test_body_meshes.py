from __future__ import annotations

import mujoco
import numpy as np
import pytest

from golem.robots.model.mjcf import robot_spec
from golem.robots.mujoco import body_meshes

KIND = mujoco.mjtGeom
PRIMITIVES = [
    (KIND.mjGEOM_BOX, [0.1, 0.2, 0.3], [0.1, 0.2, 0.3]),
    (KIND.mjGEOM_SPHERE, [0.1, 0, 0], [0.1, 0.1, 0.1]),
    (KIND.mjGEOM_ELLIPSOID, [0.1, 0.2, 0.3], [0.1, 0.2, 0.3]),
    (KIND.mjGEOM_CYLINDER, [0.1, 0.3, 0], [0.1, 0.1, 0.3]),
    (KIND.mjGEOM_CAPSULE, [0.1, 0.3, 0], [0.1, 0.1, 0.4]),
    (KIND.mjGEOM_PLANE, [2.0, 3.0, 0.1], [2.0, 3.0, 0.0]),
]


def one_geom(**options: object) -> mujoco.MjModel:
    spec = mujoco.MjSpec()
    spec.add_material(name="paint", rgba=[0.1, 0.2, 0.3, 1.0])
    spec.worldbody.add_geom(**options)
    return spec.compile()


@pytest.mark.parametrize(("kind", "size", "half"), PRIMITIVES, ids=lambda v: getattr(v, "name", None))
def test_a_primitive_has_the_size_and_the_centre_of_its_geom(
    kind: mujoco.mjtGeom, size: list[float], half: list[float]
) -> None:
    mesh = body_meshes.geom_mesh(one_geom(type=kind, size=size), 0)
    np.testing.assert_allclose(mesh.bounds, [[-h for h in half], half], atol=0.003)


def test_a_kind_of_geom_that_no_world_uses_is_refused() -> None:
    with pytest.raises(NotImplementedError, match="HFIELD"):
        model = one_geom(type=KIND.mjGEOM_BOX, size=[1, 1, 1])
        model.geom_type[0] = int(KIND.mjGEOM_HFIELD)
        body_meshes.geom_mesh(model, 0)


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({"material": "paint"}, (0.1, 0.2, 0.3, 1.0)),
        ({"rgba": [0.9, 0.8, 0.7, 1.0]}, (0.9, 0.8, 0.7, 1.0)),
        ({"material": "paint", "rgba": [0.9, 0.8, 0.7, 1.0]}, (0.9, 0.8, 0.7, 1.0)),
    ],
)
def test_colours_follow_mujocos_rules(options: dict[str, object], expected: tuple[float, ...]) -> None:
    model = one_geom(type=KIND.mjGEOM_BOX, size=[1, 1, 1], **options)
    np.testing.assert_allclose(body_meshes.look(model, 0)[0], expected, atol=1e-6)


def test_collision_shapes_and_transparent_geoms_are_not_shown() -> None:
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body()
    body.add_freejoint()
    for options in ({"group": 3}, {"rgba": [1, 1, 1, 0]}, {"group": 1}):
        body.add_geom(type=KIND.mjGEOM_BOX, size=[1, 1, 1], **options)
    assert body_meshes.visual_geoms(spec.compile()) == {1: [2]}


def test_every_visual_geom_of_the_robot_lies_in_its_bodys_mesh() -> None:
    model = robot_spec().compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    meshes = body_meshes.body_meshes(model, data)
    assert set(meshes) == set(body_meshes.visual_geoms(model))
    for body, geoms in body_meshes.visual_geoms(model).items():
        parts = list(meshes[body].geometry.values())
        wanted = [body_meshes.geom_mesh(model, geom) for geom in geoms]
        assert sum(len(part.faces) for part in parts) == sum(len(mesh.faces) for mesh in wanted)
        surface = sum(part.area for part in parts)
        assert surface == pytest.approx(sum(mesh.area for mesh in wanted), rel=1e-6)
        # In the body's frame the mesh reaches exactly as far as its geoms do in the world.
        R, p = data.xmat[body].reshape(3, 3), data.xpos[body]
        shown = np.concatenate([part.vertices for part in parts]) @ R.T + p
        placed = np.concatenate(
            [
                mesh.vertices @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
                for geom, mesh in zip(geoms, wanted, strict=True)
            ]
        )
        np.testing.assert_allclose(shown.min(axis=0), placed.min(axis=0), atol=1e-6)
        np.testing.assert_allclose(shown.max(axis=0), placed.max(axis=0), atol=1e-6)
