"""The simulator's truth, for judges: what really happened, and which error was the larger. Stacks cannot reach it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np

from golem.capabilities.perception.open_box import OpenBox
from golem.evaluation.episodes.pick_claims import Fastener
from golem.interfaces import topics
from golem.middleware.bus import Bus
from golem.robots.model import magpie_model
from golem.robots.model.table import BASE_LINK
from golem.robots.mujoco.camera import CameraRig
from golem.robots.mujoco.engine import MujocoRobot
from golem.robots.mujoco.scene import ONLOOKER
from golem.robots.worlds.layout import Kind
from golem.types import Array, PlanarPose, Side

FLOOR = "floor"
"""Name of the geom that a robot may touch with its feet."""


class ContactWatch:
    """Collects what the robot touched; call it after every tick.

    Attributes:
        touched: `LINK on BODY` of every pair that was in contact, with the time of the first [s].
    """

    def __init__(self, robot: MujocoRobot) -> None:
        model = robot.scene.model
        self._robot = robot
        mine = (model.body_rootid == model.body(BASE_LINK).id)[model.geom_bodyid]
        floor = np.array([model.geom(i).name == FLOOR for i in range(model.ngeom)])
        # 1 for what is the robot's, 8 for what it may touch with its feet, 0 for the rest.
        kinds = np.where(floor, 8, mine).astype(np.int64)
        self._kind: list[int] = kinds.tolist()
        self._told = robot.watch_contacts(kinds)
        self.touched: dict[str, float] = {}

    def due(self) -> float:
        """Return when it has to look again [s]: after every tick, unless the robot tells of contacts."""
        return math.inf if self._told else -math.inf

    def __call__(self, t: float) -> None:
        contact, kind = self._robot.data.contact, self._kind
        for pair in contact.geom.tolist():
            if kind[pair[0]] + kind[pair[1]] != 1:
                continue
            own, other = pair if kind[pair[0]] else pair[::-1]
            model = self._robot.scene.model
            touch = " on ".join(model.body(model.geom_bodyid[g]).name for g in (own, other))
            self.touched.setdefault(touch, t)


def errors(name: str, off: PlanarPose) -> dict[str, float]:
    """Return x, y, their length [m] and the heading [rad] of `off`, as figures whose names begin with `name`."""
    return {f"{name}_x": off.x, f"{name}_y": off.y, f"{name}_radial": apart(off), f"{name}_yaw": off.yaw}


def apart(off: PlanarPose) -> float:
    """Return how far apart two poses are [m] of which `off` is one in the frame of the other."""
    return math.hypot(off.x, off.y)


def place_error(bus: Bus, robot: MujocoRobot) -> float:
    """Return how far the robot is from where map and odometry have it [m]; 0 where neither says."""
    believed, place = bus.latest(topics.ODOMETRY), bus.latest(topics.MAP_POSE)
    if believed is None or place is None:
        return 0.0
    return apart(robot.truth.pose().to(place.T_odom_map.to(PlanarPose.of(believed.T_odom_base))))


Where = Literal["seated", "lifted", "tray", "floor"]
FALLEN = 0.3
"""What is this far below the rim, which is deeper than the pack, has fallen down [m]."""

BESIDE = 0.005
"""What is this far beside the axis of its place is not in it [m]."""


@dataclass(frozen=True, slots=True)
class Whereabouts:
    """One fastener, and whether it was loosened.

    Attributes:
        where: `seated`: in its bore, on its stud; `lifted`: out of it, in a hand or on the pack; `tray`; `floor`.
        tray: name of the tray that it is in.
        right: whether that tray is for its kind; a bolt goes with the screws.
    """

    slot: int
    kind: Kind
    loose: bool
    where: Where = "seated"
    tray: str = ""
    right: bool = False


def whereabouts(robot: MujocoRobot) -> list[Whereabouts]:
    """Return where every fastener is that was there at the beginning, by its slot."""
    layout, names = robot.scene.layout, robot.scene.names
    draws = {draw.slot: (draw, mouth) for draw, mouth in zip(robot.scene.draws, names.mouths, strict=True)}
    half, height = 0.5 * np.array(layout.tray_size[:2]), layout.tray_size[2]
    trays = [(tray, np.linalg.inv(tray.pose())) for tray in layout.trays()]
    found: list[Whereabouts] = []
    for slot in range(len(layout.fasteners())):
        kind = layout.kind(slot)
        if slot not in draws:
            if slot not in layout.empty_holes:
                found.append(Whereabouts(slot, kind, loose=False))
            continue
        draw, mouth = draws[slot]
        at, axis = robot.data.body(draw.name).xpos, layout.pose()[:3, :3] @ draw.axis()
        along = float((at - mouth) @ axis)
        one = Whereabouts(slot, kind, True, "floor" if at[2] < layout.top_z - FALLEN else "lifted")
        if along <= draw.shank_length and np.linalg.norm(at - mouth - along * axis) < BESIDE:
            one = Whereabouts(slot, kind, loose=True)
        for tray, T in trays:
            x, y, z, _ = T @ (*at, 1.0)
            if (np.abs((x, y)) <= half).all() and -0.01 <= z <= height:
                right = tray.kind == ("nut" if kind == "nut" else "screw")
                one = Whereabouts(slot, kind, True, "tray", tray.name, right)
        found.append(one)
    return found


@dataclass(frozen=True, slots=True)
class GraspTruth:
    """Where hand and screw were when the fingers began to close.

    Attributes:
        aim: from where the hand was sent to the nearest screw [m]: perception.
        reach: from where the hand was sent to where it was [m]: the arm and its calibration.
        miss: from the hand to the nearest screw [m]: what came of both. All three are across the approach axis of the
            hand as it was: one that is too high or too low misses nothing.
        depth: height of the screw's head above the fingertips [m], positive when the tips are below it.
        tilt: angle between approach axis and vertical [rad].
        told: from where the camera by which the hand was sent had the screw to the screw [m]. Of an open loop that is
            `aim`; a servo law moves its command until the palm camera has the screw between the fingers, so that
            command and hand are apart by the arm's error, and that is no fault.
        left: from there to the hand [m]: what the arm, or the servo law, left over.
        calibration: what `told` owes to the calibration of that camera [m].
        seen: what `told` would be without that [m].
        strayed: from where the skill sent a servo law to where the law went [m].
    """

    aim: float
    reach: float
    miss: float
    depth: float
    tilt: float
    told: float
    left: float
    calibration: float = 0.0
    seen: float = 0.0
    strayed: float = 0.0


class Oracle:
    """Reads the truth of one twin."""

    def __init__(self, robot: MujocoRobot) -> None:
        self._robot = robot
        self._T_odom_world: Array = np.asarray(np.linalg.inv(robot.truth.T_world_odom), dtype=np.float64)
        self._rig: CameraRig | None = None

    def screws_in_tray(self) -> list[str]:
        """Return the names of the fasteners that lie inside the walls of a tray."""
        return [f"{w.kind}_{w.slot:02d}" for w in whereabouts(self._robot) if w.where == "tray"]

    def fasteners(self) -> list[Fastener]:
        """Return the fasteners of the pack's near edge that are in their places before anything happens."""
        scene = self._robot.scene
        layout, loose = scene.layout, {draw.slot for draw in scene.draws}
        T_base_world = np.linalg.inv(self._robot.truth.base().T_world_base)
        spots = layout.fasteners()
        found = []
        for slot in layout.reachable(0.5 * layout.size_y):
            if slot not in layout.empty_holes or slot in loose:
                at = layout.pose() @ (*spots[slot], 1.0)
                found.append(Fastener((self._T_odom_world @ at)[:3], (T_base_world @ at)[:3], slot in loose, slot))
        return found

    def taken(self, fasteners: Sequence[Fastener]) -> set[int]:
        """Return which of `fasteners`, by their index, are loose and no longer in their bores."""
        out = {w.slot for w in whereabouts(self._robot) if w.where != "seated"}
        return {i for i, f in enumerate(fasteners) if f.slot in out}

    @property
    def T_world_odom(self) -> Array:
        """(4, 4) odom in the world."""
        return np.asarray(np.linalg.inv(self._T_odom_world), dtype=np.float64)

    def drop_places(self) -> Array:
        """Return (n, 3) places 8 cm above the tray's floor and 3 cm inside its rim, in base_link [m]."""
        layout = self._robot.scene.layout
        box = OpenBox(np.zeros(2), 0.0, np.array(layout.tray_size[:2]), layout.tray_size[2], 0.08)
        flat = box.places(margin=0.03, spacing=0.03)
        places = np.column_stack([flat, np.ones(len(flat))])
        T = np.linalg.inv(self._robot.truth.base().T_world_base) @ layout.tray_pose()
        return (places @ T.T)[:, :3]

    def inside_tray(self, side: Side) -> float:
        """Return how far a hand is inside the tray's rim, seen from above [m]; negative outside."""
        layout = self._robot.scene.layout
        T = np.linalg.inv(layout.tray_pose()) @ self.T_world_odom @ self.gripper(side)
        return float((0.5 * np.array(layout.tray_size[:2]) - np.abs(T[:2, 3])).min())

    def gripper(self, side: Side) -> Array:
        """Return the true (4, 4) pose of a grasp frame in odom."""
        body = self._robot.data.body(magpie_model.hand_name(side))
        T = np.eye(4)
        T[:3, :3] = body.xmat.reshape(3, 3)
        T[:3, 3] = body.xpos
        return self._T_odom_world @ T @ magpie_model.T_HAND_GRIPPER

    def screw_heads(self) -> Array:
        """Return the (n, 3) undersides of the loosened screws' heads in odom [m]."""
        world = np.array([self._robot.data.body(name).xpos for name in self._robot.scene.names.screws])
        return world @ self._T_odom_world[:3, :3].T + self._T_odom_world[:3, 3]

    def camera_shift(self, camera: str, point: Array) -> Array:
        """Return how far from the true `point` (3,) in odom [m] the calibration of `camera` has what is there."""
        seen_by = self._robot.data.camera(camera)
        T = np.eye(4)
        T[:3, :3] = seen_by.xmat.reshape(3, 3) * (1.0, -1.0, -1.0)  # MuJoCo looks along -z, optical frames along z
        T[:3, 3] = seen_by.xpos
        T = self._T_odom_world @ T
        believed = T @ self._robot.calibration[camera] @ np.linalg.inv(T) @ (*point, 1.0)
        return believed[:3] - point

    def grasp(self, side: Side, T_commanded: Array, camera: str, looked_at: Array | None = None) -> GraspTruth:
        """Compare where the hand is, where it was sent, and where the nearest screw is.

        Args:
            side: which hand.
            T_commanded: (4, 4) pose in odom that it was sent to.
            camera: by which.
            looked_at: (3,) where a servo law had the screw, as far from the true hand as it believed it to be from the
                hand, in odom [m]; None of an open loop.
        """
        T = self.gripper(side)
        heads = self.screw_heads()
        screws = (heads - T[:3, 3]) @ T[:3, :3]
        nearest = int(np.argmin(np.hypot(screws[:, 0], screws[:, 1])))
        screw, shift = screws[nearest], self.camera_shift(camera, heads[nearest]) @ T[:3, :3]
        sent = (T_commanded[:3, 3] - T[:3, 3]) @ T[:3, :3]
        had = sent if looked_at is None else (looked_at - T[:3, 3]) @ T[:3, :3]
        return GraspTruth(
            aim=float(np.hypot(*(screw - sent)[:2])),
            reach=float(np.hypot(*sent[:2])),
            miss=float(np.hypot(*screw[:2])),
            depth=-float(screw[2]),
            tilt=float(np.arccos(np.clip(-T[2, 2], -1.0, 1.0))),
            told=float(np.hypot(*(screw - had)[:2])),
            left=float(np.hypot(*had[:2])),
            calibration=float(np.hypot(*shift[:2])),
            seen=float(np.hypot(*(screw + shift - had)[:2])),
        )

    def picture(self) -> bytes:
        """Return a PNG of the scene as it is now, from a camera next to the pack."""
        if self._rig is None:
            self._rig = CameraRig(self._robot.scene.model, [ONLOOKER])
        rgb, _ = self._rig.render(self._robot.data, ONLOOKER.name)
        return cv2.imencode(".png", rgb[:, :, ::-1])[1].tobytes()

    def close(self) -> None:
        """Release the rendering context."""
        if self._rig is not None:
            self._rig.close()
            self._rig = None
