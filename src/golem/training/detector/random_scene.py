"""A random world for the detector: one compiled model, many looks and poses.

Compiling takes longer than rendering, so a model is kept for many images and only its arrays change: colours, lights,
distractors, what stands about, the robot's arms, and where its camera is.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from golem.package_data import load_data
from golem.robots.model import magpie_model, mjcf, table
from golem.robots.model.spatial import transform
from golem.robots.mujoco.camera import CameraRig
from golem.robots.sensors.cameras import CAMERAS, T_MUJOCO_OPTICAL
from golem.robots.worlds.conditions import Conditions
from golem.robots.worlds.pack import PackPart
from golem.types import SIDES, Array, CameraInfo, Side

DISTRACTORS = 14
_KINDS: list[list[dict[str, Any]]] = load_data(__package__, "distractors.yaml")
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


class RandomScene(ABC):
    """A compiled random world, and what differs between its images.

    Attributes:
        model, data: MuJoCo's; the state is that of this image.
        parts: what a detector can be asked for.
        bores: of the loose screws.
        screw_tops: how far above its body a loose screw's head ends, by the name of the body [m].
        distractors: ids of the distractors' bodies.
    """

    def __init__(
        self,
        spec: mujoco.MjSpec,
        plain: bool,
        rng: np.random.Generator,
        parts: tuple[PackPart, ...],
        bores: tuple[Bore, ...] = (),
        screw_tops: dict[str, float] | None = None,
    ) -> None:
        """Add the distractors to `spec` and compile it; a `plain` robot shows its collision primitives, see `begin`."""
        self.parts, self.bores, self.screw_tops, self._plain = parts, bores, screw_tops or {}, plain
        for k in range(DISTRACTORS):
            _add_distractor(spec, k, rng)
        self.model = model = spec.compile()
        self.data = mujoco.MjData(model)
        self.distractors = [model.body(f"distractor_{k}").id for k in range(DISTRACTORS)]
        root = model.body(table.BASE_LINK).rootid[0]
        self._robot = np.flatnonzero(model.body_rootid[model.geom_bodyid] == root)
        self._colours = model.geom_rgba.copy(), model.geom_matid.copy()

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

    def randomise_robot(self, wild: bool, rng: np.random.Generator) -> None:
        """Draw the colours of robot and distractors; a robot that is not `wild` keeps its own."""
        model = self.model
        shell, hand = random_colour(rng), random_colour(rng)
        for geom in self._robot:
            body = model.body(model.geom_bodyid[geom]).name
            colour = hand if any(word in body for word in ("hand", "crank", "finger")) else shell
            if rng.random() < 0.3:
                colour = random_colour(rng)
            if self._plain or wild:
                model.geom_rgba[geom] = [*colour, 1.0]
                model.geom_matid[geom] = -1
            else:
                model.geom_rgba[geom] = self._colours[0][geom]
                model.geom_matid[geom] = self._colours[1][geom]
        for body in self.distractors:
            first, count = model.body_geomadr[body], model.body_geomnum[body]
            for geom in range(first, first + count):
                model.geom_rgba[geom] = [*random_colour(rng), 1.0]

    def randomise_lights(self, rng: np.random.Generator) -> None:
        """Draw places, colours and strengths of the lights, and who casts shadows."""
        model = self.model
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

    def scatter(self, low: Array, high: Array, rng: np.random.Generator) -> None:
        """Put some of the distractors between two corners (3,) [m], and the others away."""
        model = self.model
        for body in self.distractors:
            model.body_pos[body] = AWAY
            if rng.random() < 0.3:
                model.body_pos[body] = rng.uniform(low, high)
                a = rng.uniform(-np.pi, np.pi)
                model.body_quat[body] = [np.cos(a / 2), 0, 0, np.sin(a / 2)]

    def pose_arms(self, rng: np.random.Generator) -> None:
        """Draw the joints of both arms, and the gaps of both hands."""
        model, data = self.model, self.data
        for side in SIDES:
            mirror = 1.0 if side == "left" else -1.0
            for joint, low, high in (
                ("shoulder_pitch", -1.2, 0.3), ("shoulder_roll", -0.1, 0.6), ("shoulder_yaw", -0.6, 0.6),
                ("elbow", 0.0, 1.6), ("wrist_roll", -0.8, 0.8), ("wrist_pitch", -0.4, 0.4), ("wrist_yaw", -0.8, 0.8),
            ):  # fmt: skip
                sign = 1.0 if joint in ("shoulder_pitch", "elbow", "wrist_pitch") else mirror
                data.qpos[model.joint(f"{side}_{joint}_joint").qposadr[0]] = sign * rng.uniform(low, high)
            self.set_gap(side, float(rng.uniform(0.0, magpie_model.MAX_GAP)))

    def stand(self, position: Array, rng: np.random.Generator) -> CameraInfo:
        """Put the base at `position` (3,) [m], turned by normal errors, about z most; returns the head camera."""
        data = self.data
        data.qpos[:3] = position
        errors = [rng.normal(0.0, size) for size in (0.2, 0.08, 0.05)]
        data.qpos[3:7] = Rotation.from_euler("ZYX", errors).as_quat(scalar_first=True)
        self.refresh()
        return CAMERAS["head"]

    def carry(self, info: CameraInfo, T_world_optical: Array) -> None:
        """Move the base so that a camera of the hand is at a pose (4, 4)."""
        data = self.data
        self.refresh()
        T_base = transform(data.qpos[:3], Rotation.from_quat(data.qpos[3:7], scalar_first=True).as_matrix())
        T_base = T_world_optical @ np.linalg.inv(self.camera_pose(info.name)) @ T_base
        data.qpos[:3] = T_base[:3, 3]
        data.qpos[3:7] = Rotation.from_matrix(T_base[:3, :3]).as_quat(scalar_first=True)
        self.refresh()

    def set_gap(self, side: Side, gap: float) -> None:
        """Open both fingers of a hand to `gap` [m]."""
        crank = float(magpie_model.crank_from_gap(gap))
        for finger in magpie_model.FINGERS:
            names = magpie_model.finger_names(side, finger)
            self.data.qpos[self.model.joint(names[0]).qposadr[0]] = crank
            self.data.qpos[self.model.joint(names[1]).qposadr[0]] = -crank

    def refresh(self) -> None:
        """Compute where bodies, cameras and lights are for the present joint positions."""
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)

    def camera_pose(self, name: str) -> Array:
        """Return the (4, 4) pose of a camera's optical frame in the world."""
        camera = self.model.camera(name).id
        return transform(self.data.cam_xpos[camera], self.data.cam_xmat[camera].reshape(3, 3)) @ T_MUJOCO_OPTICAL

    def make_rigs(self) -> tuple[CameraRig, CameraRig]:
        """Return the plain and the shadow-casting renderer of the world."""
        infos = list(CAMERAS.values())
        return CameraRig(self.model, infos), CameraRig(self.model, infos, fancy=True)


def begin(rng: np.random.Generator) -> tuple[mujoco.MjSpec, bool]:
    """Return a spec that holds the robot alone, and whether it shows its collision primitives."""
    spec = mjcf.robot_spec(hands=True)
    plain = not any(geom.group == 2 for geom in spec.geoms) or rng.random() < 0.25
    for geom in spec.geoms:  # sometimes only the robot's primitives are seen
        if plain:
            geom.group = {2: 4, 3: 2}.get(geom.group, geom.group)
    return spec, plain


def _add_distractor(spec: mujoco.MjSpec, index: int, rng: np.random.Generator) -> None:
    body = spec.worldbody.add_body(name=f"distractor_{index}", pos=AWAY.tolist())
    for row in _KINDS[index % len(_KINDS)]:
        kind = getattr(mujoco.mjtGeom, f"mjGEOM_{row['type'].upper()}")
        size = [rng.uniform(*length) if isinstance(length, list) else length for length in row["size"]]
        turn = [0.7071, 0.7071, 0, 0] if row.get("lies") else [1, 0, 0, 0]
        pos = row.get("pos", [0, 0, 0])
        body.add_geom(type=kind, size=size, pos=pos, quat=turn, contype=0, conaffinity=0, group=2)


def random_colour(rng: np.random.Generator) -> Array:
    """Return a colour (3,), grey more often than not."""
    if rng.random() < 0.6:
        return np.clip(rng.uniform(0.02, 0.8) * np.exp(0.08 * rng.standard_normal(3)), 0, 1)
    return rng.uniform(0.0, 1.0, 3)


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


def random_part(parts: tuple[PackPart, ...], rng: np.random.Generator) -> PackPart:
    """Return a part: every class is as likely as the others."""
    labels = sorted({part.label for part in parts})
    label = labels[int(rng.integers(len(labels)))]
    choices = [part for part in parts if part.label == label]
    return choices[int(rng.integers(len(choices)))]
