"""Randomised pack worlds for the detector: one compiled model, many looks and poses.

Compiling takes longer than rendering, so a model is kept for many images and only its arrays change: colours, lights,
distractors, screws, the robot's arms, and where its camera is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from golem.robots.model import magpie_model, mjcf
from golem.robots.mujoco.camera import CameraRig
from golem.robots.sensors.cameras import CAMERAS, T_MUJOCO_OPTICAL
from golem.robots.worlds import hall
from golem.robots.worlds.clutter import add_clutter
from golem.robots.worlds.conditions import Conditions, draw_conditions
from golem.robots.worlds.dressing import surfaces
from golem.robots.worlds.layout import PackLayout
from golem.robots.worlds.pack import PackNames, add_pack
from golem.robots.worlds.screws import ScrewDraw, ScrewRanges, draw_screws, screw_name
from golem.types import SIDES, Array, CameraInfo, Side

DISTRACTORS = 14
WIDE = ScrewRanges(protrusion=(0.004, 0.013))
"""Loosened screws of the training images: those of the worlds, and some that stand less proud."""
TINTED = (0.25, 0.35)
"""Spread of brightness and of colour of the randomised materials (log scale)."""
CLUTTER = 6
"""Most things that lie on the cover beside the distractors."""
AWAY = np.array([0.0, 0.0, -5.0])
"""Where unused distractors are [m]: under the floor."""


@dataclass(frozen=True, slots=True)
class RandomScene:
    """A compiled random world.

    Attributes:
        model, data: MuJoCo's.
        layout: where the pack stands.
        names: what the pack added.
        draws: its loosened screws.
        robot_geoms: ids of the robot's geoms.
        distractors: ids of the distractors' bodies.
        plain_robot: the robot shows its collision primitives instead of its looks.
        robot_rgba, robot_matid: (ngeom, 4), (ngeom,) colours as compiled.
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    layout: PackLayout
    names: PackNames
    draws: tuple[ScrewDraw, ...]
    robot_geoms: NDArray[np.int64]
    distractors: tuple[int, ...]
    plain_robot: bool
    robot_rgba: Array
    robot_matid: NDArray[np.int32]


def build_world(rng: np.random.Generator) -> RandomScene:
    """Compile a world with random layout, screws and distractors."""
    spec = mjcf.robot_spec(hands=True)
    plain = not any(geom.group == 2 for geom in spec.geoms) or rng.random() < 0.25
    for geom in spec.geoms:  # sometimes only the robot's primitives are seen
        if plain:
            geom.group = {2: 4, 3: 2}.get(geom.group, geom.group)
    layout = PackLayout(
        near_edge=float(rng.uniform(0.2, 0.45)),
        top_z=float(rng.uniform(0.85, 1.1)),
        window_x=(float(rng.uniform(0.09, 0.2)), float(rng.uniform(0.5, 0.75))),
        window_y=(float(rng.uniform(-0.5, -0.3)), float(rng.uniform(0.3, 0.55))),
        window_depth=float(rng.uniform(0.03, 0.06)),
        empty_holes=tuple(int(i) for i in rng.choice(68, size=int(rng.integers(10, 22)), replace=False)),
        tray_size=(
            float(rng.uniform(0.16, 0.30)),
            float(rng.uniform(0.2, 0.34)),
            float(rng.uniform(0.03, 0.08)),
        ),
    )
    lifted = float(rng.choice([0.0, rng.uniform(0.02, 0.12)]))
    layout = replace(layout, tray_z=layout.top_z + lifted, tray_xy=(layout.near_edge + 0.1, -0.3))
    free = [i for i in range(68) if i not in layout.empty_holes]
    draws = draw_screws(rng, WIDE, [int(i) for i in rng.choice(free, size=14, replace=False)])
    names = add_pack(spec, layout, draws)
    add_clutter(spec, layout, int(rng.integers(CLUTTER + 1)), rng)
    for k in range(DISTRACTORS):
        _add_distractor(spec, k, rng)
    model = spec.compile()
    bodies = tuple(model.body(f"distractor_{k}").id for k in range(DISTRACTORS))
    root = model.body(mjcf.BASE_LINK).rootid[0]
    robot = np.flatnonzero(model.body_rootid[model.geom_bodyid] == root).astype(np.int64)
    colours = model.geom_rgba.copy(), model.geom_matid.copy()
    return RandomScene(
        model, mujoco.MjData(model), layout, names, tuple(draws), robot, bodies, plain, *colours
    )


def _add_distractor(spec: mujoco.MjSpec, index: int, rng: np.random.Generator) -> None:
    kinds = mujoco.mjtGeom
    body = spec.worldbody.add_body(name=f"distractor_{index}", pos=AWAY.tolist())
    look = {"contype": 0, "conaffinity": 0, "group": 2}
    u = rng.uniform
    match index % 7:
        case 0:  # cable
            body.add_geom(type=kinds.mjGEOM_CAPSULE, size=[u(0.003, 0.008), u(0.05, 0.2), 0],
                          quat=[0.7071, 0.7071, 0, 0], **look)  # fmt: skip
        case 1:  # screwdriver
            body.add_geom(type=kinds.mjGEOM_CYLINDER, size=[u(0.01, 0.016), 0.05, 0], quat=[0.7071, 0.7071, 0, 0],
                          **look)  # fmt: skip
            body.add_geom(type=kinds.mjGEOM_CYLINDER, size=[0.003, 0.07, 0], pos=[0, 0.11, 0],
                          quat=[0.7071, 0.7071, 0, 0], **look)  # fmt: skip
        case 2:  # box
            body.add_geom(type=kinds.mjGEOM_BOX, size=[u(0.01, 0.06), u(0.01, 0.06), u(0.004, 0.03)], **look)
        case 3:  # sticker or tape
            body.add_geom(type=kinds.mjGEOM_BOX, size=[u(0.006, 0.03), u(0.02, 0.07), 0.0004], **look)
        case 4:  # washer-like disc
            body.add_geom(type=kinds.mjGEOM_CYLINDER, size=[u(0.008, 0.03), 0.001, 0], **look)
        case 5:  # wrench
            body.add_geom(type=kinds.mjGEOM_BOX, size=[0.007, u(0.05, 0.09), 0.003], **look)
            body.add_geom(type=kinds.mjGEOM_CYLINDER, size=[0.014, 0.004, 0], pos=[0, 0.07, 0], **look)
        case _:  # ball or cap
            body.add_geom(type=kinds.mjGEOM_SPHERE, size=[u(0.006, 0.02), 0, 0], **look)


def randomise_looks(world: RandomScene, rng: np.random.Generator) -> Conditions:
    """Draw finishes, colours of materials, robot and distractors, the lights, and who casts shadows.

    Returns:
        The conditions that were drawn: of them finish, cover, tray and light hold for the image.
    """
    model = world.model
    wild = rng.random() < 0.6  # the others keep the colours of a work place, up to light and small tints
    conditions = draw_conditions("varied", {}, rng)
    looks = {name: (rgba[:3], *shine[:2]) for name, (rgba, *shine) in hall.MATERIALS.items()}
    for name, (colour, specular, shininess) in (looks | surfaces(conditions)).items():
        mat = model.material(name).id
        base = np.array(colour)
        if (
            wild
            and name in ("cover_coat", "cover_bead", "wall_paint", "wall_band", "stand_blue")
            and rng.random() < 0.5
        ):
            base = rng.uniform(0.05, 0.9) * np.exp(0.25 * rng.standard_normal(3))
        if wild and name == "tray_teal" and rng.random() < 0.6:
            base = rng.uniform(0.02, 1.0, 3)
        brightness, colour = TINTED if wild else (0.1, 0.1)
        tint = np.exp(brightness * rng.standard_normal()) * np.exp(0.25 * colour * rng.standard_normal(3))
        model.mat_rgba[mat, :3] = np.clip(base * tint, 0.0, 1.0)
        model.mat_specular[mat] = np.clip(specular * rng.uniform(0.3, 1.5), 0, 1)
        model.mat_shininess[mat] = np.clip(shininess * rng.uniform(0.5, 1.5), 0, 1)
    shell, hand = _random_colour(rng), _random_colour(rng)
    for geom in world.robot_geoms:
        body = model.body(model.geom_bodyid[geom]).name
        colour = hand if any(word in body for word in ("hand", "crank", "finger")) else shell
        if rng.random() < 0.3:
            colour = _random_colour(rng)
        if world.plain_robot or wild:
            model.geom_rgba[geom] = [*colour, 1.0]
            model.geom_matid[geom] = -1
        else:
            model.geom_rgba[geom] = world.robot_rgba[geom]
            model.geom_matid[geom] = world.robot_matid[geom]
    for body in world.distractors:
        first, count = model.body_geomadr[body], model.body_geomnum[body]
        for geom in range(first, first + count):
            model.geom_rgba[geom] = [*_random_colour(rng), 1.0]
    model.vis.headlight.ambient[:] = rng.uniform(0.05, 0.45)
    model.vis.headlight.diffuse[:] = rng.uniform(0.0, 0.5)
    model.vis.headlight.specular[:] = rng.uniform(0.0, 0.4)
    for light in range(model.nlight):
        pos = np.array([rng.uniform(-1.5, 2.5), rng.uniform(-2.5, 2.5), rng.uniform(2.0, 4.0)])
        aim = np.array([rng.uniform(0.3, 1.0), rng.uniform(-0.6, 0.6), 1.0]) - pos
        model.light_pos[light] = pos
        model.light_dir[light] = aim / np.linalg.norm(aim)
        level = rng.uniform(0.05, 0.7)
        model.light_diffuse[light] = level * np.exp(0.08 * rng.standard_normal(3))
        model.light_specular[light] = level * rng.uniform(0.2, 1.0)
        model.light_castshadow[light] = light == 0 or rng.random() < 0.3
    return conditions


def _random_colour(rng: np.random.Generator) -> Array:
    if rng.random() < 0.6:
        return np.clip(rng.uniform(0.02, 0.8) * np.exp(0.08 * rng.standard_normal(3)), 0, 1)
    return rng.uniform(0.0, 1.0, 3)


def randomise_objects(world: RandomScene, rng: np.random.Generator) -> None:
    """Move the tray, scatter distractors, take some screws out of their bores (tray, cover, or just raised)."""
    model, data, layout = world.model, world.data, world.layout
    mujoco.mj_resetData(model, data)
    tray = model.body(world.names.tray).id
    side = rng.choice([-1.0, 1.0])
    tray_at = np.array(
        [layout.near_edge + rng.uniform(-0.02, 0.5), side * rng.uniform(0.15, 0.65), layout.tray_z]
    )
    model.body_pos[tray] = tray_at
    turn = rng.uniform(-np.pi, np.pi) if rng.random() < 0.3 else rng.normal(0.0, 0.05)
    model.body_quat[tray] = [np.cos(turn / 2), 0.0, 0.0, np.sin(turn / 2)]
    for body in world.distractors:
        model.body_pos[body] = AWAY
        if rng.random() < 0.3:
            spot = [layout.near_edge + rng.uniform(0.0, 0.8), rng.uniform(-0.7, 0.7)]
            model.body_pos[body] = [*spot, layout.top_z + rng.uniform(0.0, 0.012)]
            a = rng.uniform(-np.pi, np.pi)
            model.body_quat[body] = [np.cos(a / 2), 0, 0, np.sin(a / 2)]
    for draw in world.draws:
        at = model.joint(screw_name(draw.slot)).qposadr[0]
        choice = rng.random()
        if choice < 0.15:
            data.qpos[at : at + 3] += rng.uniform(0.0, 0.02) * draw.axis()
        elif choice < 0.45:
            if choice < 0.3:
                spot = tray_at[:2] + rng.uniform(-0.35, 0.35, 2) * min(layout.tray_size[:2])
                z = layout.tray_z + 0.004
            else:
                spot = np.array([layout.near_edge + rng.uniform(0.0, 0.7), rng.uniform(-0.6, 0.6)])
                z = layout.top_z
            data.qpos[at : at + 3] = [*spot, z + draw.head_diameter / 2]
            lying = Rotation.from_euler("zy", [rng.uniform(-np.pi, np.pi), np.pi / 2 + rng.uniform(0.0, 0.3)])
            data.qpos[at + 3 : at + 7] = lying.as_quat(scalar_first=True)
    _pose_arms(world, rng)


def _pose_arms(world: RandomScene, rng: np.random.Generator) -> None:
    model, data = world.model, world.data
    for side in SIDES:
        mirror = 1.0 if side == "left" else -1.0
        for joint, low, high in (
            ("shoulder_pitch", -1.2, 0.3), ("shoulder_roll", -0.1, 0.6), ("shoulder_yaw", -0.6, 0.6),
            ("elbow", 0.0, 1.6), ("wrist_roll", -0.8, 0.8), ("wrist_pitch", -0.4, 0.4), ("wrist_yaw", -0.8, 0.8),
        ):  # fmt: skip
            sign = 1.0 if joint in ("shoulder_pitch", "elbow", "wrist_pitch") else mirror
            data.qpos[model.joint(f"{side}_{joint}_joint").qposadr[0]] = sign * rng.uniform(low, high)
        _set_gap(world, side, float(rng.uniform(0.0, magpie_model.MAX_GAP)))


def place_head(world: RandomScene, rng: np.random.Generator) -> CameraInfo:
    """Stand the robot in front of the pack with its head camera looking down at it; returns the camera."""
    data = world.data
    data.qpos[:3] = [rng.uniform(-0.2, 0.15), rng.uniform(-0.4, 0.4), rng.uniform(0.9, 1.15)]
    angles = [rng.normal(0.0, 0.2), rng.normal(0.0, 0.08), rng.normal(0.0, 0.05)]
    data.qpos[3:7] = Rotation.from_euler("ZYX", angles).as_quat(scalar_first=True)
    refresh(world)
    return CAMERAS["head"]


def place_palm(world: RandomScene, rng: np.random.Generator) -> CameraInfo:
    """Carry the robot to where its palm camera looks down at a random part, sometimes with a screw in its fingers."""
    model, data = world.model, world.data
    refresh(world)
    side = SIDES[int(rng.integers(2))]
    info = CAMERAS[f"{side}_hand"]
    labels = sorted({part.label for part in world.names.parts})
    label = labels[int(rng.integers(len(labels)))]
    choices = [part for part in world.names.parts if part.label == label]
    part = choices[int(rng.integers(len(choices)))]
    target = data.xpos[model.body(part.body).id] if label == "tray" else part.position
    height = float(np.exp(rng.uniform(np.log(0.10), np.log(0.50))))
    view = Rotation.from_euler("ZYX", [rng.uniform(-np.pi, np.pi), rng.normal(0, 0.12), rng.normal(0, 0.12)])
    R = view.as_matrix() @ T_MUJOCO_OPTICAL[:3, :3]
    pixel = rng.uniform([0.1, 0.1], [0.9, 0.9]) * (info.width, info.height)
    ray = np.array([(pixel[0] - info.cx) / info.fx, (pixel[1] - info.cy) / info.fy, 1.0])
    T_world_optical = _pose(target - R @ ray * height, R)
    held = (
        world.draws[int(rng.integers(len(world.draws)))] if label == "screw" and rng.random() < 0.3 else None
    )
    if held is not None:
        _set_gap(world, side, held.head_diameter)
    refresh(world)
    T_base = _pose(data.qpos[:3], Rotation.from_quat(data.qpos[3:7], scalar_first=True).as_matrix())
    T_base = T_world_optical @ np.linalg.inv(camera_pose(world, info.name)) @ T_base
    data.qpos[:3] = T_base[:3, 3]
    data.qpos[3:7] = Rotation.from_matrix(T_base[:3, :3]).as_quat(scalar_first=True)
    refresh(world)
    if held is not None:
        site = model.site(f"{side}_gripper").id
        R_grip = data.site_xmat[site].reshape(3, 3)
        tilt = Rotation.from_rotvec(0.15 * rng.standard_normal(3)).as_matrix()
        at = model.joint(screw_name(held.slot)).qposadr[0]
        data.qpos[at : at + 3] = data.site_xpos[site] - R_grip[:, 2] * rng.uniform(0.0, 0.01)
        upright = R_grip @ T_MUJOCO_OPTICAL[:3, :3] @ tilt
        data.qpos[at + 3 : at + 7] = Rotation.from_matrix(upright).as_quat(scalar_first=True)
        refresh(world)
    return info


def _set_gap(world: RandomScene, side: Side, gap: float) -> None:
    """Open both fingers of a hand to `gap` [m]."""
    crank = float(magpie_model.crank_from_gap(gap))
    for finger in magpie_model.FINGERS:
        names = magpie_model.finger_names(side, finger)
        world.data.qpos[world.model.joint(names[0]).qposadr[0]] = crank
        world.data.qpos[world.model.joint(names[1]).qposadr[0]] = -crank


def _pose(position: Array, rotation: Array) -> Array:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotation, position
    return T


def refresh(world: RandomScene) -> None:
    """Compute where bodies, cameras and lights are for the present joint positions."""
    mujoco.mj_kinematics(world.model, world.data)
    mujoco.mj_camlight(world.model, world.data)


def camera_pose(world: RandomScene, name: str) -> Array:
    """Return the (4, 4) pose of a camera's optical frame in the world."""
    camera = world.model.camera(name).id
    return _pose(world.data.cam_xpos[camera], world.data.cam_xmat[camera].reshape(3, 3)) @ T_MUJOCO_OPTICAL


def make_rigs(world: RandomScene) -> tuple[CameraRig, CameraRig]:
    """Return the plain and the shadow-casting renderer of a world."""
    infos = list(CAMERAS.values())
    return CameraRig(world.model, infos), CameraRig(world.model, infos, fancy=True)
