"""What a spectator sees of the simulated world: meshes, poses, pictures.

This is the only place where the dashboard reads the simulator. It may: a viewer of the simulation is no module of the
stack, and nothing read here goes back into it. Reading changes nothing either: pictures come from a renderer of the
spectator's own, so that the noise of the robot's cameras stays the same whether somebody watches or not.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from golem.robots.mujoco.camera import CameraRig
from golem.robots.mujoco.engine import MujocoRobot
from golem.types import Array, CameraInfo

HEADLIGHT = (0.28, 0.32)
"""Ambient and diffuse part of the light at a spectator's camera: the hall itself is lit for the robot's eyes."""

TURNS = (0.0, 30.0, -30.0, 60.0, -60.0, 90.0, -90.0, 135.0, -135.0, 180.0)
"""By how much a camera that follows a body may be turned about it [deg], the best first."""
REACH = 1.0
"""Distance from what a camera looks at within which everything is the body's own [m]."""


@dataclass(frozen=True)
class Shot:
    """A spectator's camera.

    Attributes:
        look_at: (x, y, z) point in the middle of the picture, in the world: the floor below the robot's start [m].
        azimuth: heading of the line of sight [deg], 0 along x, counter-clockwise.
        elevation: pitch of the line of sight [deg], negative looks down.
        distance: between camera and point [m].
        fovy: vertical field of view [deg].
    """

    look_at: tuple[float, float, float]
    azimuth: float
    elevation: float
    distance: float
    fovy: float = 40.0

    def view(self) -> mujoco.MjvCamera:
        """Return the shot as MuJoCo's camera."""
        view = mujoco.MjvCamera()
        view.type = mujoco.mjtCamera.mjCAMERA_FREE
        view.lookat[:] = self.look_at
        view.azimuth, view.elevation, view.distance = self.azimuth, self.elevation, self.distance
        return view

    def info(self, name: str, size: tuple[int, int]) -> CameraInfo:
        """Return the intrinsics of the shot for a picture of `size` (width, height) [px]."""
        width, height = size
        focal = 0.5 * height / np.tan(0.5 * np.radians(self.fovy))
        return CameraInfo(name, width, height, focal, focal, 0.5 * (width - 1), 0.5 * (height - 1), 0.0, 60.0, 0.0)


@dataclass(frozen=True)
class BodyMesh:
    """The visible part of the body `name`, `"world"` for all that cannot move: binary glTF in its frame."""

    name: str
    glb: bytes


class SpectatorView:
    """The simulated world of one robot, read only.

    `moving`: the visible bodies that can move, in the order of `poses`.
    """

    def __init__(
        self,
        robot: MujocoRobot,
        shots: Mapping[str, Shot] | None = None,
        size: tuple[int, int] = (960, 540),
        *,
        fancy: bool = False,
    ) -> None:
        """Look at `robot` and its world.

        Args:
            shots: a spectator's cameras by name, besides the robot's own.
            size: width and height of the shots' pictures [px].
            fancy: shadows, reflections, smooth edges: a second and more per picture on a CPU.
        """
        self._model, self._data = robot.scene.model, robot.data
        self._shots = dict(shots or {})
        self._views = {name: shot.view() for name, shot in self._shots.items()}
        self._infos = [shot.info(name, size) for name, shot in self._shots.items()]
        # A picture only for the eye: half the robot's own resolution is what an inset shows.
        self._infos += [halved(info) for info in robot.cameras.values()]
        self._fancy = fancy
        self._rig: CameraRig | None = None
        from golem.robots.mujoco import body_meshes  # trimesh takes a second, which only a viewer needs

        self._meshes = body_meshes.body_meshes
        self._moving = np.array([body for body in body_meshes.visual_geoms(self._model) if body], dtype=int)
        self.moving: list[str] = [self._model.body(int(body)).name for body in self._moving]
        self._origin = robot.truth.T_world_odom[:3, 3]

    def meshes(self, *, collision: bool = False) -> list[BodyMesh]:
        """Return one mesh per visible body, or per moving body that collides."""
        from trimesh.exchange.gltf import export_glb

        meshes = self._meshes(self._model, self._data, collision=collision)
        return [BodyMesh(self._model.body(body).name, export_glb(scene)) for body, scene in meshes.items()]

    def poses(self) -> tuple[Array, Array]:
        """Return positions (n, 3) [m] and orientations (n, 4) wxyz of the moving bodies in the world."""
        return self._data.xpos[self._moving].copy(), self._data.xquat[self._moving].copy()

    def position(self, body: str) -> Array:
        """Return (3,) where a body is in the world [m]."""
        return self._data.body(body).xpos.copy()

    def contacts(self, length: float) -> Array:
        """Return (n, 2, 3) arrows in the world [m]: each contact's force on the second body, `length` [m/N] long."""
        arrows, wrench = np.zeros((self._data.ncon, 2, 3)), np.zeros(6)
        for i in range(self._data.ncon):
            contact = self._data.contact[i]
            mujoco.mj_contactForce(self._model, self._data, i, wrench)
            arrows[i] = contact.pos
            arrows[i, 1] += length * (wrench[:3] @ contact.frame.reshape(3, 3))
        return arrows[np.linalg.norm(arrows[:, 1] - arrows[:, 0], axis=1) > 5.0 * length]

    def from_odom(self, point: Array) -> Array:
        """Return (3,) or (n, 3) points of the odom frame in the world: odom is where the pelvis was at the start."""
        return np.asarray(point, dtype=float) + self._origin

    def follow(self, body: str) -> None:
        """Move the spectator's cameras along with a body: they look at it as they looked at the world's origin."""
        x, y, _ = self.position(body)
        for name, shot in self._shots.items():
            view = self._views[name]
            view.lookat[:2] = shot.look_at[0] + x, shot.look_at[1] + y
            # It stays where it is until something hides the body, then it goes to the nearest free side.
            turns = (view.azimuth, *(shot.azimuth + turn for turn in TURNS))
            view.azimuth = next((a for a in turns if self._sees(view, a)), shot.azimuth)

    def _sees(self, view: mujoco.MjvCamera, azimuth: float) -> bool:
        """Return whether nothing stands between a camera at `azimuth` [deg] and what it looks at."""
        a, e = np.radians(azimuth), np.radians(view.elevation)
        sight = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        place, hit = view.lookat - view.distance * sight, np.zeros(1, np.int32)
        met = mujoco.mj_ray(self._model, self._data, place, sight, None, 1, -1, hit)
        return met < 0.0 or met > view.distance - REACH

    def picture(self, name: str) -> NDArray[np.uint8]:
        """Return (height, width, 3) what a shot, or a camera of the robot, shows now."""
        if self._rig is None:
            self._rig = CameraRig(self._model, self._infos, fancy=self._fancy, views=self._views)
        if name not in self._shots:
            return self._rig.render(self._data, name)[0]
        shadows = self._model.light_castshadow.copy()
        self._model.light_castshadow[:] = self._fancy
        try:
            with headlight(self._model):
                return self._rig.render(self._data, name)[0]
        finally:
            self._model.light_castshadow[:] = shadows

    def close(self) -> None:
        """Release the renderer."""
        if self._rig is not None:
            self._rig.close()
            self._rig = None


@contextmanager
def headlight(model: mujoco.MjModel) -> Iterator[None]:
    """Light the world for people: its lights belong to the model, and the robot's cameras see by them too."""
    lamp = model.vis.headlight
    kept = lamp.ambient.copy(), lamp.diffuse.copy()
    lamp.ambient[:], lamp.diffuse[:] = HEADLIGHT
    try:
        yield
    finally:
        lamp.ambient[:], lamp.diffuse[:] = kept


def halved(info: CameraInfo) -> CameraInfo:
    """Return the same camera with half as many pixels along each side."""
    fx, fy, cx, cy = info.fx / 2, info.fy / 2, (info.cx - 0.5) / 2, (info.cy - 0.5) / 2
    return replace(info, width=info.width // 2, height=info.height // 2, fx=fx, fy=fy, cx=cx, cy=cy)
