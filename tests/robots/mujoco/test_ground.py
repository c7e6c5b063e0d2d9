"""The twin on its feet: the band carries it until it is released, then the soles do; options that change the plant."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from golem.errors import ConfigError
from golem.options import fill
from golem.robots.base import HasGantry
from golem.robots.model.export import export_mjcf
from golem.robots.mujoco.config import MujocoConfig
from golem.robots.mujoco.engine import MujocoRobot
from golem.robots.mujoco.external_forces import RELEASE_TIME
from golem.runtime.lockstep import start_posture
from golem.types import NUM_JOINTS, LowCommand

TICK = 0.002
ZERO = np.zeros(NUM_JOINTS)
LIMP = LowCommand(0.0, ZERO, ZERO, ZERO, ZERO, ZERO)
# Stiff enough for all joints in series to carry the robot as one inverted pendulum, which needs 590 N m/rad.
STIFF = LowCommand(0.0, start_posture(True), ZERO, ZERO, np.full(NUM_JOINTS, 3000.0), np.full(NUM_JOINTS, 40.0))


def twin(**options: Any) -> MujocoRobot:
    config = fill("option", MujocoConfig, {"support": "ground", "world": "open", **options})
    return MujocoRobot("ideal", 0, start_posture(config.support == "ground"), config)


def run(robot: MujocoRobot, seconds: float, command: LowCommand = STIFF) -> None:
    for _ in range(round(seconds / TICK)):
        robot.advance(command, {}, TICK)


def weight(robot: MujocoRobot) -> float:
    return 9.81 * float(robot.scene.model.body_subtreemass[robot.scene.model.body("pelvis").id])


def load(robot: MujocoRobot) -> float:
    return float(robot.truth.foot_forces()[:, 2].sum())


def test_the_soles_are_on_the_floor_at_the_start() -> None:
    robot = twin()
    np.testing.assert_allclose(robot.truth.soles()[:, :, 2], 0.0, atol=1e-9)
    assert robot.truth.base().T_world_base[2, 3] == pytest.approx(0.965, abs=0.002)


def test_the_band_carries_a_limp_robot() -> None:
    robot = twin()
    assert isinstance(robot, HasGantry) and robot.on_gantry
    run(robot, 1.0, LIMP)
    assert not robot.truth.fallen()
    assert abs(robot.truth.base().T_world_base[2, 3] - 0.965) < 0.01
    assert robot.truth.base().tilt < 0.02


def test_a_released_robot_stands_on_its_own_stiff_legs() -> None:
    robot = twin()
    run(robot, 0.3)
    before = robot.truth.base().T_world_base[:3, 3]
    assert load(robot) < 0.3 * weight(robot)
    robot.release()
    assert not robot.on_gantry
    loads = []
    for _ in range(round(RELEASE_TIME / 0.1)):
        run(robot, 0.1)
        loads.append(load(robot))
    # The feet take over bit by bit: no step in the load, no jump of the pelvis.
    assert np.all(np.diff(loads) > 0.0) and max(np.diff([0.0, *loads])) < 0.5 * weight(robot)
    run(robot, 1.5)
    assert load(robot) == pytest.approx(weight(robot), rel=0.01)
    assert np.linalg.norm(robot.truth.base().T_world_base[:3, 3] - before) < 0.02
    assert robot.truth.base().tilt < 0.01
    assert not robot.data.xfrc_applied.any()


def test_a_released_limp_robot_falls() -> None:
    robot = twin()
    robot.release()
    run(robot, 1.2, LIMP)
    assert robot.truth.fallen()
    assert robot.truth.touches() != ()


def test_a_second_release_changes_nothing() -> None:
    one, two = twin(), twin()
    for robot in (one, two):
        robot.release()
        run(robot, 0.2)
    two.release()
    for robot in (one, two):
        run(robot, 0.4)
    np.testing.assert_array_equal(one.data.qpos, two.data.qpos)


def test_the_hoist_never_lets_go() -> None:
    robot = twin(support="hoist")
    assert not robot.on_gantry
    robot.release()
    run(robot, 0.8, LIMP)
    assert robot.truth.base().T_world_base[2, 3] == pytest.approx(1.10, abs=0.01)
    assert load(robot) == 0.0


def test_the_pack_is_as_far_from_the_pelvis_as_in_the_hoist_and_from_the_legs() -> None:
    hung, stands = twin(support="hoist", world="pack"), twin(world="pack")
    for name in (*hung.scene.names.screws, "tray", "pack"):
        in_hoist, on_ground = (robot.data.body(name).xpos - robot.data.body("pelvis").xpos for robot in (hung, stands))
        np.testing.assert_allclose(on_ground, in_hoist, atol=1e-9)
    model, data = stands.scene.model, stands.data
    scenery = [g for g in range(model.ngeom) if model.body(model.geom_bodyid[g]).name in ("pack", "tray")]
    solid = [g for g in scenery if model.geom_contype[g]]
    legs = [
        g
        for g in range(model.ngeom)
        if model.geom_contype[g] and any(w in model.body(model.geom_bodyid[g]).name for w in ("hip", "knee", "ankle"))
    ]
    assert len(solid) > 20 and len(legs) > 10
    nearest = min(mujoco.mj_geomDistance(model, data, a, b, 1.0, None) for a in legs for b in solid)
    assert nearest > 0.10
    run(stands, 0.5)
    assert stands.truth.touches() == ()


def test_limbs_stop_each_other_on_the_ground_and_in_the_hoist_unless_told_otherwise() -> None:
    pairs = [twin(**o).scene.model.npair for o in ({}, {"support": "hoist"}, {"self_collision": False})]
    assert pairs[0] == pairs[1] > 0 == pairs[2]


@pytest.mark.parametrize("feet", ["spheres", "box"])
@pytest.mark.parametrize("cone", ["pyramidal", "elliptic"])
def test_every_contact_model_carries_the_robot(feet: str, cone: str) -> None:
    robot = twin(feet=feet, cone=cone)
    assert robot.scene.model.opt.cone == (cone == "elliptic")
    robot.release()
    run(robot, 1.0)
    assert load(robot) == pytest.approx(weight(robot), rel=0.05)


def test_the_soles_friction_is_the_option() -> None:
    slips = []
    for friction in (0.02, 1.3):
        robot = twin(friction=friction)
        np.testing.assert_allclose(robot.data.contact.friction[:, 0], friction)
        robot.release()
        run(robot, 0.6)
        before = robot.truth.soles()
        robot.push(np.array([40.0, 0.0, 0.0]))
        run(robot, 0.3)
        slips.append((robot.truth.soles() - before)[:, :, 0].mean())
    assert slips[0] > 0.005
    assert abs(slips[1]) < 0.0005


def test_without_slip_the_soles_creep_less() -> None:
    creep = []
    for rounds in (0, 10):
        robot = twin(noslip=rounds)
        robot.release()
        run(robot, 0.6)
        before = robot.truth.soles()
        run(robot, 1.0)
        creep.append(np.abs(robot.truth.soles() - before)[:, :, :2].mean())
    assert creep[1] < 0.5 * creep[0]
    with pytest.raises(ConfigError, match="noslip is from 0 to 100"):
        twin(noslip=-1)


def test_a_payload_hangs_at_the_grasp_frame() -> None:
    bare, laden = twin(), twin(payload=[1.0, 2.5])
    assert weight(laden) - weight(bare) == pytest.approx(3.5 * 9.81)
    for side, mass in (("left", 1.0), ("right", 2.5)):
        body = laden.data.body(f"{side}_hand_payload")
        np.testing.assert_allclose(body.xipos, laden.data.site(f"{side}_gripper").xpos, atol=1e-9)
        assert laden.scene.model.body(body.id).mass[0] == mass
    with pytest.raises(ConfigError, match="payload"):
        twin(payload=[-1.0, 0.0])


def test_latency_comes_on_top_of_the_profiles_delay() -> None:
    robot = twin(latency=0.020)
    robot.advance(LIMP, {}, TICK)
    run(robot, 0.020)
    assert not robot.joints()[2].any()
    robot.advance(STIFF, {}, TICK)
    assert robot.joints()[2].any()


def test_the_robot_of_another_file_stands_on_the_same_floor(tmp_path: Path) -> None:
    file = tmp_path / "robot.xml"
    file.write_text(export_mjcf(hands=False))
    other, ours = twin(mjcf=str(file)), twin()
    assert weight(other) == pytest.approx(weight(ours), rel=1e-6)
    np.testing.assert_allclose(other.imu().quat, ours.imu().quat, atol=1e-9)
    assert other.capture("head")[0].shape == (480, 640, 3)
    other.release()
    run(other, 1.0)
    assert load(other) == pytest.approx(weight(other), rel=0.02)
    assert other.truth.touches() == ()
    other.close()


@pytest.mark.parametrize("share", [0.5, 2.0])
@pytest.mark.parametrize("where", ["motor", "joint"])
def test_the_torque_limits_of_another_file_are_its_own_and_what_is_reported_acts(
    where: str, share: float, tmp_path: Path
) -> None:
    spec = mujoco.MjSpec.from_string(export_mjcf(hands=False))
    limits = {motor.name: share * float(motor.ctrlrange[1]) for motor in spec.actuators}
    for motor in spec.actuators:
        bounds = [-limits[motor.name], limits[motor.name]]
        spec.joint(motor.name).actfrcrange = bounds
        motor.ctrlrange, motor.ctrllimited = bounds, where == "motor"
    (tmp_path / "robot.xml").write_text(spec.to_xml())
    robot = twin(mjcf=str(tmp_path / "robot.xml"))
    robot.advance(replace(LIMP, tau=np.full(27, 1e4)), {}, TICK)
    np.testing.assert_allclose(robot.joints()[2], list(limits.values()))
    acting = [robot.data.qfrc_actuator[robot.scene.model.joint(name).dofadr[0]] for name in limits]
    np.testing.assert_allclose(acting, list(limits.values()))
    robot.close()


@pytest.mark.parametrize("world", ["open", "slope"])
def test_what_stands_around_the_robot_in_its_file_is_left_out(world: str, tmp_path: Path) -> None:
    spec = mujoco.MjSpec.from_string(export_mjcf(hands=False))
    spec.add_texture(name="floor", type=mujoco.mjtTexture.mjTEXTURE_2D, builtin=1, width=8, height=8)
    textures = [""] * 10
    textures[1] = "floor"
    spec.add_material(name="floor", textures=textures)
    plane = mujoco.mjtGeom.mjGEOM_PLANE
    spec.worldbody.add_geom(name="floor", type=plane, size=[0, 0, 0.05], material="floor")
    spec.worldbody.add_geom(type=plane, size=[5, 5, 0.05], pos=[0, 0, 0.3])  # one that would carry it higher
    spec.worldbody.add_light(name="sun", pos=[0, 0, 3])
    spec.worldbody.add_body(name="table", pos=[0.3, 0, 0.5]).add_geom(size=[0.2, 0.2, 0.2])
    (tmp_path / "robot.xml").write_text(spec.to_xml())
    other, ours = twin(mjcf=str(tmp_path / "robot.xml"), world=world), twin(world=world)
    assert weight(other) == pytest.approx(weight(ours), rel=1e-6)
    model, own = other.scene.model, ours.scene.model
    fixed = [sum(m.geom_bodyid == 0) for m in (model, own)]
    assert fixed[0] == fixed[1] and not any(model.body(b).name == "table" for b in range(model.nbody))
    other.release()
    run(other, 1.0)
    assert load(other) == pytest.approx(weight(other), rel=0.02)
    other.close()


def test_a_robot_whose_names_are_the_worlds_is_refused_in_a_sentence(tmp_path: Path) -> None:
    spec = mujoco.MjSpec.from_string(export_mjcf(hands=False))
    spec.body("pelvis").add_geom(name="floor", size=[0.01, 0.01, 0.01])
    (tmp_path / "robot.xml").write_text(spec.to_xml())
    with pytest.raises(ConfigError, match="does not fit into the world 'open': .*repeated name 'floor'") as error:
        twin(mjcf=str(tmp_path / "robot.xml"))
    assert "\n" not in str(error.value)


def test_a_file_that_is_no_such_robot_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "robot.xml"
    with pytest.raises(ConfigError, match="cannot be read"):
        twin(mjcf=str(file))
    with pytest.raises(ConfigError, match="leave feet, torque_profile and self_collision out"):
        twin(mjcf=str(file), feet="box")
    file.write_text("<mujoco><worldbody><body name='pelvis'/></worldbody></mujoco>")
    with pytest.raises(ConfigError, match="27|vendor's order"):
        twin(mjcf=str(file))
    spec = mujoco.MjSpec.from_string(export_mjcf(hands=False))
    spec.delete(spec.joint("base"))  # bolted to the ground
    file.write_text(spec.to_xml())
    with pytest.raises(ConfigError, match="the link pelvis on a free joint"):
        twin(mjcf=str(file))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"support": "grnd"}, "ground, hoist"),
        ({"world": "opn"}, "open"),
        ({"cone": "round"}, "elliptic, pyramidal"),
        ({"feet": "cube"}, "box, spheres"),
        ({"slope": 1.2}, "slope"),
        ({"rubble": -0.1}, "rubble"),
        ({"step": 0.2}, "step"),
        ({"friction": 0.0}, "friction"),
        ({"latency": -0.1}, "latency"),
    ],
)
def test_a_wrong_option_is_answered(options: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        twin(**options)
