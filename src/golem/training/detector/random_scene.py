"""A random world for the detector: one compiled model, many looks and poses.

Compiling takes longer than rendering, so a model is kept for many images and only its arrays change: colours, lights,
distractors, what stands about, the robot's arms, and where its camera is.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from golem.robots.model import magpie_model, mjcf, table
from golem.robots.model.spatial import transform
from golem.robots.mujoco.camera import CameraRig
from golem.robots.sensors.cameras import CAMERAS, T_MUJOCO_OPTICAL
from golem.robots.worlds.conditions import Conditions
from golem.robots.worlds.pack import PackPart
from golem.types import SIDES, Array, CameraInfo, Side

DISTRACTORS = 14
AWAY = np.array([0.0, 0.0, -5.0])
"""Where unused distractors are [m]: under the floor."""


@dataclass(frozen=True, slots=True)
class Bore:
    """The bore of a loose screw: an empty one is a part of its own.

    Attributes:
        mouth: (3,) centre of its mouth in the world [m].
        radius: its radius [m].
        screw: the body of its screw.
    """

    mouth: Array
    radius: float
    screw: str


@dataclass(frozen=True, slots=True)
class Compiled:
    """What every random world has.

    Attributes:
        model, data: MuJoCo's.
        robot_geoms: ids of the robot's geoms.
        distractors: ids of the distractors' bodies.
        plain_robot: the robot shows its collision primitives instead of its looks.
        robot_rgba, robot_matid: (ngeom, 4), (ngeom,) colours as compiled.
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    robot_geoms: NDArray[np.int64]
    distractors: tuple[int, ...]
    plain_robot: bool
    robot_rgba: Array
    robot_matid: NDArray[np.int32]


class RandomScene(ABC):
    """A compiled random world, and what differs between its images.

    Attributes:
        parts: what a detector can be asked for.
        bores: of the loose screws.
        screw_tops: how far above its body a loose screw's head ends, by the name of the body [m].
    """

    def __init__(
        self,
        world: Compiled,
        parts: tuple[PackPart, ...],
        bores: tuple[Bore, ...] = (),
        screw_tops: dict[str, float] | None = None,
    ) -> None:
        self.world, self.parts, self.bores = world, parts, bores
        self.screw_tops = screw_tops or {}

    @property
    def model(self) -> mujoco.MjModel:
        """The compiled model."""
        return self.world.model

    @property
    def data(self) -> mujoco.MjData:
        """The state of this image."""
        return self.world.data

    @abstractmethod
    def randomise_looks(self, rng: np.random.Generator) -> Conditions:
        """Draw colours, finishes and lights, and return the conditions that were drawn."""

    @abstractmethod
    def randomise_objects(self, rng: np.random.Generator) -> None:
        """Move what can be moved, and the robot's arms."""

    @abstractmethod
    def place_head(self, rng: np.random.Generator) -> CameraInfo:
        """Stand the robot where its head camera looks at the parts; returns the camera."""

    @abstractmethod
    def place_palm(self, rng: np.random.Generator) -> CameraInfo:
        """Carry the robot to where a palm camera looks at a random part; returns the camera."""


def begin(rng: np.random.Generator) -> tuple[mujoco.MjSpec, bool]:
    """Return a spec that holds the robot alone, and whether it shows its collision primitives."""
    spec = mjcf.robot_spec(hands=True)
    plain = not any(geom.group == 2 for geom in spec.geoms) or rng.random() < 0.25
    for geom in spec.geoms:  # sometimes only the robot's primitives are seen
        if plain:
            geom.group = {2: 4, 3: 2}.get(geom.group, geom.group)
    return spec, plain


def compile_scene(spec: mujoco.MjSpec, plain: bool, rng: np.random.Generator) -> Compiled:
    """Add the distractors and compile."""
    for k in range(DISTRACTORS):
        _add_distractor(spec, k, rng)
    model = spec.compile()
    bodies = tuple(model.body(f"distractor_{k}").id for k in range(DISTRACTORS))
    root = model.body(table.BASE_LINK).rootid[0]
    robot = np.flatnonzero(model.body_rootid[model.geom_bodyid] == root).astype(np.int64)
    colours = model.geom_rgba.copy(), model.geom_matid.copy()
    return Compiled(model, mujoco.MjData(model), robot, bodies, plain, *colours)


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


def randomise_robot(world: Compiled, wild: bool, rng: np.random.Generator) -> None:
    """Draw the colours of robot and distractors; a robot that is not `wild` keeps its own."""
    model = world.model
    shell, hand = random_colour(rng), random_colour(rng)
    for geom in world.robot_geoms:
        body = model.body(model.geom_bodyid[geom]).name
        colour = hand if any(word in body for word in ("hand", "crank", "finger")) else shell
        if rng.random() < 0.3:
            colour = random_colour(rng)
        if world.plain_robot or wild:
            model.geom_rgba[geom] = [*colour, 1.0]
            model.geom_matid[geom] = -1
        else:
            model.geom_rgba[geom] = world.robot_rgba[geom]
            model.geom_matid[geom] = world.robot_matid[geom]
    for body in world.distractors:
        first, count = model.body_geomadr[body], model.body_geomnum[body]
        for geom in range(first, first + count):
            model.geom_rgba[geom] = [*random_colour(rng), 1.0]


def randomise_lights(model: mujoco.MjModel, rng: np.random.Generator) -> None:
    """Draw places, colours and strengths of the lights, and who casts shadows."""
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


def scatter(world: Compiled, low: Array, high: Array, rng: np.random.Generator) -> None:
    """Put some of the distractors between two corners (3,) [m], and the others away."""
    model = world.model
    for body in world.distractors:
        model.body_pos[body] = AWAY
        if rng.random() < 0.3:
            model.body_pos[body] = rng.uniform(low, high)
            a = rng.uniform(-np.pi, np.pi)
            model.body_quat[body] = [np.cos(a / 2), 0, 0, np.sin(a / 2)]


def random_colour(rng: np.random.Generator) -> Array:
    """Return a colour (3,), grey more often than not."""
    if rng.random() < 0.6:
        return np.clip(rng.uniform(0.02, 0.8) * np.exp(0.08 * rng.standard_normal(3)), 0, 1)
    return rng.uniform(0.0, 1.0, 3)


def pose_arms(world: Compiled, rng: np.random.Generator) -> None:
    """Draw the joints of both arms, and the gaps of both hands."""
    model, data = world.model, world.data
    for side in SIDES:
        mirror = 1.0 if side == "left" else -1.0
        for joint, low, high in (
            ("shoulder_pitch", -1.2, 0.3), ("shoulder_roll", -0.1, 0.6), ("shoulder_yaw", -0.6, 0.6),
            ("elbow", 0.0, 1.6), ("wrist_roll", -0.8, 0.8), ("wrist_pitch", -0.4, 0.4), ("wrist_yaw", -0.8, 0.8),
        ):  # fmt: skip
            sign = 1.0 if joint in ("shoulder_pitch", "elbow", "wrist_pitch") else mirror
            data.qpos[model.joint(f"{side}_{joint}_joint").qposadr[0]] = sign * rng.uniform(low, high)
        set_gap(world, side, float(rng.uniform(0.0, magpie_model.MAX_GAP)))


def stand(world: Compiled, position: Array, rng: np.random.Generator) -> None:
    """Put the base at `position` (3,) [m], turned by normal errors, about z more than about y and x."""
    data = world.data
    data.qpos[:3] = position
    errors = [rng.normal(0.0, size) for size in (0.2, 0.08, 0.05)]
    data.qpos[3:7] = Rotation.from_euler("ZYX", errors).as_quat(scalar_first=True)
    refresh(world)


def random_side(rng: np.random.Generator) -> Side:
    """Return either side."""
    return SIDES[int(rng.integers(2))]


def aim(info: CameraInfo, target: Array, view: Array, distance: float, rng: np.random.Generator) -> Array:
    """Return the (4, 4) pose in the world of a camera that shows `target` at a random pixel.

    Args:
        target: (3,) in the world [m].
        view: (3, 3) orientation of the optical frame.
        distance: of the target along the optical axis [m].
    """
    pixel = rng.uniform([0.1, 0.1], [0.9, 0.9]) * (info.width, info.height)
    ray = np.array([(pixel[0] - info.cx) / info.fx, (pixel[1] - info.cy) / info.fy, 1.0])
    return transform(target - view @ ray * distance, view)


def carry(world: Compiled, info: CameraInfo, T_world_optical: Array) -> None:
    """Move the base so that a camera of the hand is at a pose (4, 4)."""
    data = world.data
    refresh(world)
    T_base = transform(data.qpos[:3], Rotation.from_quat(data.qpos[3:7], scalar_first=True).as_matrix())
    T_base = T_world_optical @ np.linalg.inv(camera_pose(world, info.name)) @ T_base
    data.qpos[:3] = T_base[:3, 3]
    data.qpos[3:7] = Rotation.from_matrix(T_base[:3, :3]).as_quat(scalar_first=True)
    refresh(world)


def set_gap(world: Compiled, side: Side, gap: float) -> None:
    """Open both fingers of a hand to `gap` [m]."""
    crank = float(magpie_model.crank_from_gap(gap))
    for finger in magpie_model.FINGERS:
        names = magpie_model.finger_names(side, finger)
        world.data.qpos[world.model.joint(names[0]).qposadr[0]] = crank
        world.data.qpos[world.model.joint(names[1]).qposadr[0]] = -crank


def random_part(parts: tuple[PackPart, ...], rng: np.random.Generator) -> PackPart:
    """Return a part: every class is as likely as the others."""
    labels = sorted({part.label for part in parts})
    label = labels[int(rng.integers(len(labels)))]
    choices = [part for part in parts if part.label == label]
    return choices[int(rng.integers(len(choices)))]


def refresh(world: Compiled) -> None:
    """Compute where bodies, cameras and lights are for the present joint positions."""
    mujoco.mj_kinematics(world.model, world.data)
    mujoco.mj_camlight(world.model, world.data)


def camera_pose(world: Compiled, name: str) -> Array:
    """Return the (4, 4) pose of a camera's optical frame in the world."""
    camera = world.model.camera(name).id
    return transform(world.data.cam_xpos[camera], world.data.cam_xmat[camera].reshape(3, 3)) @ T_MUJOCO_OPTICAL


def make_rigs(world: Compiled) -> tuple[CameraRig, CameraRig]:
    """Return the plain and the shadow-casting renderer of a world."""
    infos = list(CAMERAS.values())
    return CameraRig(world.model, infos), CameraRig(world.model, infos, fancy=True)
