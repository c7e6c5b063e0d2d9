from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from golem.robots.mujoco.spectator import Shot, SpectatorView
from golem.runtime.lockstep import LockstepRunner, build_robot
from golem.stack import load_stack

SHOT = Shot(look_at=(0.4, 0.0, 1.1), azimuth=180.0, elevation=-20.0, distance=2.0)


def test_poses_follow_the_bodies(twin: tuple[LockstepRunner, Any]) -> None:
    _, robot = twin
    view = SpectatorView(robot)
    finger = view.moving.index("right_a_finger")
    before = view.poses()[0][finger]
    robot.data.joint("torso_joint").qpos[0] += 0.5
    mujoco.mj_kinematics(robot.scene.model, robot.data)
    positions, orientations = view.poses()
    assert np.linalg.norm(positions[finger] - before) > 0.1
    for name, position, wxyz in zip(view.moving, positions, orientations, strict=True):
        np.testing.assert_array_equal(position, robot.data.body(name).xpos)
        np.testing.assert_array_equal(wxyz, robot.data.body(name).xquat)


def test_robot_screws_and_world_are_all_there(twin: tuple[LockstepRunner, Any]) -> None:
    _, robot = twin
    view = SpectatorView(robot)
    meshes = {mesh.name: mesh.glb for mesh in view.meshes()}
    assert set(meshes) == {*view.moving, "world"}
    assert {*robot.scene.names.screws, "pelvis", "right_hand"} <= set(meshes)
    assert all(glb.startswith(b"glTF") for glb in meshes.values())


def test_the_origin_of_odom_is_the_pelvis_at_the_start(twin: tuple[LockstepRunner, Any]) -> None:
    _, robot = twin
    np.testing.assert_allclose(SpectatorView(robot).from_odom(np.zeros(3)), robot.data.body("pelvis").xpos, atol=1e-9)


def test_looking_changes_neither_the_scene_nor_what_the_robot_sees(twin: tuple[LockstepRunner, Any]) -> None:
    _, robot = twin
    model = robot.scene.model
    lamp = model.vis.headlight.ambient.copy()
    lights, qpos = model.light_castshadow.copy(), robot.data.qpos.copy()
    noise = robot._depth["head"]._rng.bit_generator.state
    view = SpectatorView(robot, {"side": SHOT}, (64, 48), fancy=True)
    picture, head = view.picture("side"), view.picture("head")
    view.close()
    assert picture.shape == (48, 64, 3) and head.shape == (240, 320, 3)
    assert picture.std() > 5.0  # something is in the picture
    np.testing.assert_array_equal(model.light_castshadow, lights)
    np.testing.assert_array_equal(model.vis.headlight.ambient, lamp)
    np.testing.assert_array_equal(robot.data.qpos, qpos)
    np.testing.assert_equal(robot._depth["head"]._rng.bit_generator.state, noise)


def test_a_camera_that_follows_goes_where_nothing_hides_the_robot() -> None:
    robot = build_robot(load_stack("hall", profile="ideal"), 0)
    shot = Shot(look_at=(0.3, 0.0, 0.84), azimuth=62.0, elevation=-11.0, distance=3.3)
    view, start = SpectatorView(robot, {"wide": shot}), robot.data.qpos[:2].copy()
    azimuths = set[float]()
    for x in np.linspace(0.0, 6.0, 13):
        for y in (-1.5, 0.0):
            robot.data.qpos[:2] = start + (x, y)
            mujoco.mj_kinematics(robot.scene.model, robot.data)
            view.follow("pelvis")
            camera = view._views["wide"]
            assert view._sees(camera, camera.azimuth)
            azimuths.add(camera.azimuth)
    assert 1 < len(azimuths) < 10
