"""The live view's server, which no page of a stranger can use.

A browser lets any page open a web socket to this machine, and says in `Origin` whose page it is. So only pages that
came from this machine are answered. A page whose name was turned to this machine's address (DNS rebinding) still
names itself.
"""

from __future__ import annotations

import contextlib
import functools
import io
import logging
import math
import socket
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any
from unittest import mock

import numpy as np
from scipy.spatial.transform import Rotation

from golem.errors import ConfigError, needs
from golem.middleware.web_gate import LOCAL
from golem.robots.model.table import BASE_LINK
from golem.robots.mujoco.spectator import SpectatorView
from golem.types import Array

if TYPE_CHECKING:
    import viser

TARGET_COLOUR = (255, 60, 160)
PUSH_COLOUR = (232, 78, 60)
ARROW = 0.003
"""Length of a push's arrow per force [m/N]."""
LONGEST = 0.9
"""Longest arrow [m]."""
LAG = 0.6
"""Time constant with which the camera follows [s]: a push is seen to move the robot, not the hall."""
WORLD = "/world"
Camera = tuple[tuple[float, float, float], tuple[float, float, float]]
"""Position and the point looked at [m]."""
CAMERAS: dict[str, Camera] = {
    "hanging": ((2.1, 1.1, 1.95), (0.34, -0.04, 1.12)),
    "standing": ((-1.25, -2.55, 1.55), (0.25, 0.0, 0.82)),
    "front": ((3.0, 0.0, 1.3), (0.0, 0.0, 0.9)),
    "left": ((0.2, 3.0, 1.3), (0.2, 0.0, 0.9)),
    "right": ((0.2, -3.0, 1.3), (0.2, 0.0, 0.9)),
    "behind": ((-3.0, 0.0, 1.6), (0.0, 0.0, 0.9)),
    "above": ((0.0, 0.0, 4.5), (0.01, 0.0, 0.0)),
    "hands": ((-0.15, -0.75, 1.55), (0.4, 0.0, 1.0)),
}
"""Where the spectator may stand, as seen from the robot."""
FRAMES = (BASE_LINK, "torso_link", "left_hand", "right_hand")
LAYERS = ("frames", "clouds", "collision shapes", "contacts")
"""What can be shown besides the bodies."""
SEEN = (1e-4, 2e-4)
"""What moves by less is not told to browsers: distance [m], and parts of a quaternion."""
CLOUD_POINTS = 4000
"""Points of a cloud that are sent at most."""
FORCE_ARROW = 0.001
"""Length of a contact's arrow per force [m/N]."""


class Stage:
    """What one server shows of one simulated world.

    The camera belongs to the spectator, who may turn it at any time; so it is the world that moves under it.
    """

    def __init__(self, server: viser.ViserServer, view: SpectatorView, *, standing: bool) -> None:
        """Show what `view` sees of a robot that is `standing` or hangs."""
        self._view = view
        scene = server.scene
        scene.set_up_direction("+z")
        scene.configure_environment_map("studio", environment_intensity=0.22)
        scene.configure_default_lights(enabled=False)
        scene.add_light_directional("/sun", intensity=1.9, cast_shadow=True, position=(1.6, -1.4, 4.0))
        scene.add_light_directional("/fill", intensity=0.5, position=(2.0, 3.0, 2.0))
        # Light above, darker at the horizon.
        rows = np.linspace(0.0, 1.0, 256)[:, None, None]
        colours = (1.0 - rows) * np.array([236.0, 241.0, 247.0]) + rows * np.array([150.0, 162.0, 178.0])
        scene.set_background_image(np.broadcast_to(colours, (256, 4, 3)).astype(np.uint8), format="png")
        camera = server.initial_camera
        camera.position, camera.look_at = CAMERAS["standing" if standing else "hanging"]
        camera.fov = 0.75
        self._world = scene.add_frame(WORLD, show_axes=False)
        self._bodies = {mesh.name: scene.add_glb(f"{WORLD}/{mesh.name}", mesh.glb) for mesh in view.meshes()}
        self._target = scene.add_icosphere(f"{WORLD}/target", radius=0.012, color=TARGET_COLOUR, visible=False)
        self._target_label = scene.add_label(f"{WORLD}/target_label", "target", visible=False)
        self._arrow = scene.add_arrows(
            f"{WORLD}/push", np.zeros((1, 2, 3)), PUSH_COLOUR, shaft_radius=0.014, head_radius=0.035, visible=False
        )
        self._followed: Array = np.zeros(2)
        self._scene = scene
        self._frames = {
            body: scene.add_frame(f"{WORLD}/frame_{body}", axes_length=0.15, axes_radius=0.006, visible=False)
            for body in FRAMES
        }
        self._shapes: dict[str, viser.SceneNodeHandle] = {}
        self._layers: frozenset[str] = frozenset()
        self._told: tuple[Array, Array] | None = None
        self.show(0.0, None)

    def look(self, view: SpectatorView) -> None:
        """Show what `view` sees from now on: another episode in the same world."""
        self._view, self._told = view, None
        self._followed = np.zeros(2)

    def show(
        self, dt: float, target: Array | None, poses: tuple[Array, Array] | None = None, *, follow: bool = True
    ) -> None:
        """Show the present moment.

        Args:
            dt: time since the last one [s].
            target: (3,) what the skill aims at, in odom [m], or None.
            poses: of another moment, as of `SpectatorView.poses`.
            follow: whether the camera goes with the robot.
        """
        names, now = self._view.moving, poses or self._view.poses()
        if self._told is None:
            self._told = np.full_like(now[0], np.inf), np.full_like(now[1], np.inf)
        away = [np.abs(new - old).max(axis=1) > least for new, old, least in zip(now, self._told, SEEN, strict=True)]
        for i in np.flatnonzero(away[0] | away[1]):
            name, position, wxyz = names[i], now[0][i], now[1][i]
            self._told[0][i], self._told[1][i] = position, wxyz
            for handle in (self._bodies[name], self._frames.get(name), self._shapes.get(name)):
                if handle is not None:
                    handle.position, handle.wxyz = position, wxyz
        base = now[0][names.index(BASE_LINK)] if BASE_LINK in names else self._view.position(BASE_LINK)
        if follow:
            self._followed += (1.0 - math.exp(-dt / LAG)) * (base[:2] - self._followed)
        self._world.position = (-self._followed[0], -self._followed[1], 0.0)
        self._target.visible = self._target_label.visible = target is not None
        if target is not None:
            self._target.position = self._target_label.position = self._view.from_odom(target)

    def show_layers(self, layers: frozenset[str], clouds: Sequence[Array]) -> None:
        """Show `layers`, some of `LAYERS`, and of `clouds` (n, 3) in odom [m]; contacts are those of the present."""
        if "collision shapes" in layers and not self._shapes:
            for mesh in self._view.meshes(collision=True):
                self._shapes[mesh.name] = self._scene.add_glb(f"{WORLD}/shape_{mesh.name}", mesh.glb)
            self._told = None
        for name, handles in (("frames", self._frames), ("collision shapes", self._shapes)):
            if (name in layers) != (name in self._layers):
                for handle in handles.values():
                    handle.visible = name in layers
        shown = [self._view.from_odom(points) for points in clouds if len(points)] if "clouds" in layers else []
        self._replace("cloud", np.concatenate(shown) if shown else None)
        self._replace("contacts", self._view.contacts(FORCE_ARROW) if "contacts" in layers else None)
        self._layers = layers

    def _replace(self, name: str, points: Array | None) -> None:
        """Show a cloud (n, 3) or arrows (n, 2, 3); None or nothing takes it away."""
        path = f"{WORLD}/{name}"
        if points is None or not len(points):
            self._scene.remove_by_name(path)
        elif points.ndim == 2:
            some = points[:: 1 + len(points) // CLOUD_POINTS].astype(np.float32)
            self._scene.add_point_cloud(path, some, (40, 120, 220), point_size=0.008)
        else:
            self._scene.add_arrows(
                path, points.astype(np.float32), (30, 160, 90), shaft_radius=0.006, head_radius=0.015
            )

    def show_push(self, force: Array, body: str) -> None:
        """Show a push with the (3,) `force` in the world [N] on a body; zero hides it."""
        size = float(np.linalg.norm(force))
        self._arrow.visible = size > 0.0
        if size > 0.0:
            head = self._view.position(body)
            tail = head - force / size * min(ARROW * size, LONGEST)
            self._arrow.points = np.array([[tail, head]], dtype=np.float32)


def gizmo_pose(gizmo: Any, origin: Array) -> Array:
    """Return the (4, 4) pose in odom at which a gizmo stands; `origin` (3,) is odom's in the world that is shown."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_quat(np.asarray(gizmo.wxyz), scalar_first=True).as_matrix()
    T[:3, 3] = np.asarray(gizmo.position) - origin
    return T


def place_gizmo(gizmo: Any, T: Array, origin: Array) -> None:
    """Bring a gizmo to the pose `T` (4, 4) in odom; see `gizmo_pose`."""
    gizmo.position, gizmo.wxyz = T[:3, 3] + origin, Rotation.from_matrix(T[:3, :3]).as_quat(scalar_first=True)


def serve(host: str, port: int) -> viser.ViserServer:
    """Start a server at exactly the port that was asked for: viser would silently take the next free one.

    Web sockets are opened for pages of this machine, and for programs, which name no page.

    Raises:
        ConfigError: the address cannot be had.
        MissingExtra: viser is not installed.
    """
    with needs("", "view"):
        import viser
        import websockets.asyncio.server
    try:
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind((host, port))
            port = probe.getsockname()[1]
    except (OSError, OverflowError) as error:
        raise ConfigError(f"Cannot serve the live view at {host}:{port} ({error}); choose another --port.") from error
    logging.getLogger("websockets").setLevel(logging.ERROR)
    strict = functools.partial(websockets.asyncio.server.serve, origins=[LOCAL, None])
    with (
        contextlib.redirect_stdout(io.StringIO()),  # its banner; our callers say where to look
        # viser has no option for it. Its constructor returns once it serves.
        mock.patch.object(websockets.asyncio.server, "serve", strict),
    ):
        return viser.ViserServer(host=host, port=port, verbose=False)
