"""The kitchen: the same seed the same kitchen, things stand where they are put, and the fridge opens as one does."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from golem.robots.worlds.fridge import HANDLE, HINGE, FridgeLayout, seal_of
from golem.robots.worlds.kitchen import add_kitchen, draw_kitchen
from golem.robots.worlds.parts import COLLISION_GROUP, VISUAL_GROUP
from golem.robots.worlds.tableware import KINDS, add_object


def kitchen(seed: int) -> tuple[mujoco.MjModel, mujoco.MjData, FridgeLayout]:
    layout = draw_kitchen(np.random.default_rng(seed))
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    add_kitchen(spec, layout)
    model = spec.compile()
    return model, mujoco.MjData(model), layout.fridge


def test_a_seed_is_a_kitchen() -> None:
    assert draw_kitchen(np.random.default_rng(3)) == draw_kitchen(np.random.default_rng(3))
    drawn = [draw_kitchen(np.random.default_rng(seed)) for seed in range(12)]
    assert {one.fridge.hinge_left for one in drawn} == {True, False}
    for one in drawn:
        assert set(KINDS) - {thing.kind for thing in one.things} == set()
        # The bar is on the robot's side of the hinge, the counter on the other side of the robot.
        assert (one.fridge.handle_y > 0.0) == one.fridge.hinge_left
        assert all(thing.position[1] * one.fridge.handle_y < 0.0 for thing in one.things)


@pytest.mark.parametrize("seed", range(3))
def test_what_stands_on_the_counter_stays(seed: int) -> None:
    model, data, _ = kitchen(seed)
    layout = draw_kitchen(np.random.default_rng(seed))
    for _ in range(500):
        mujoco.mj_step(model, data)
    for thing in layout.things:
        place = data.body(thing.body).xpos
        assert np.linalg.norm(place - thing.position) < 0.004
        assert data.body(thing.body).xmat[8] > 0.999


def test_a_pad_beside_the_middle_of_a_can_presses_on_it_and_not_aside() -> None:
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    add_kitchen(spec, draw_kitchen(np.random.default_rng(0)))
    radius = KINDS["can"][0]
    add_object(spec, "can", "held", (0.0, 0.0, 3.0), 0.0, (1.0, 1.0, 1.0))
    spec.worldbody.add_geom(
        name="pad", type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.008, 0.0015, 0.04], pos=[0.01, radius + 0.0012, 3.05]
    )
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    pad = model.geom("pad").id
    normals = [c.frame[:3] for c in data.contact if pad in (c.geom1, c.geom2)]
    assert normals and all(abs(normal[1]) > 0.95 for normal in normals)


def test_a_bowl_is_as_wide_to_the_touch_as_to_the_eye() -> None:
    spec = mujoco.MjSpec()
    for name in ("steel", "dark", "label_white"):
        spec.add_material(name=name)
    add_object(spec, "bowl", "bowl", (0.0, 0.0, 0.0), 0.0, (1.0, 1.0, 1.0), loose=False)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    way = np.array([[-1.0], [0.0], [0.0]])
    for height in (0.02, 0.035, 0.05):
        far = {}
        for group in (VISUAL_GROUP, COLLISION_GROUP):
            seen = np.array([[int(k == group)] for k in range(6)], np.uint8)
            hit = np.zeros((1, 1), np.int32)
            far[group] = mujoco.mj_ray(model, data, np.array([[1.0], [0.0], [height]]), way, seen, 1, -1, hit)
        assert far[VISUAL_GROUP] == pytest.approx(far[COLLISION_GROUP], abs=0.004)


def test_a_mug_and_a_bowl_are_hollow() -> None:
    spec = mujoco.MjSpec()
    for name in ("steel", "dark", "label_white"):
        spec.add_material(name=name)
    for k, kind in enumerate(("mug", "bowl")):
        add_object(spec, kind, kind, (0.5 * k, 0.0, 0.0), 0.0, (1.0, 1.0, 1.0), loose=False)
        ball = spec.worldbody.add_body(name=f"ball_{kind}", pos=[0.5 * k, 0.0, 0.15])
        ball.add_freejoint()
        ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.012, 0, 0], mass=0.01)
    model = spec.compile()
    data = mujoco.MjData(model)
    for _ in range(700):
        mujoco.mj_step(model, data)
    for kind in ("mug", "bowl"):
        assert data.body(f"ball_{kind}").xpos[2] < 0.03


@pytest.mark.parametrize("seed", range(4))
def test_the_door_comes_towards_the_robot_and_the_seal_holds_it_shut(seed: int) -> None:
    model, data, fridge = kitchen(seed)
    seal = seal_of(model, fridge)
    hinge = model.joint(HINGE)

    def pull(force: float, steps: int) -> float:
        for _ in range(steps):
            seal.apply(data)
            # A pull at the bar, as a torque about the hinge.
            data.qfrc_applied[seal.dof] += force * fridge.arm
            mujoco.mj_step(model, data)
        return float(data.qpos[seal.qpos])

    mujoco.mj_forward(model, data)
    start = data.geom(HANDLE).xpos.copy()
    assert pull(0.6 * fridge.seal, 300) < 0.01
    assert pull(fridge.seal + 10.0, 1200) > 0.3
    moved = data.geom(HANDLE).xpos - start
    assert moved[0] < -0.1 and abs(moved[2]) < 1e-6
    assert pull(60.0, 2000) == pytest.approx(float(hinge.range[1]), abs=0.15)
