"""Gizmos for both palms in the live view: dragged they are goals, else they are where the hands are sent."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.transform import Rotation

from golem.dashboard.server import WORLD
from golem.teleop.driving import Driving
from golem.teleop.pilot import HandPilot
from golem.types import SIDES, Array, Side

if TYPE_CHECKING:
    import viser


class Gizmos:
    """Two gizmos of one server, and what is refused at them."""

    def __init__(
        self, server: viser.ViserServer, from_odom: Callable[[Array], Array], pilot: HandPilot, driving: Driving
    ) -> None:
        """Add them; `from_odom` brings a point (3,) of odom into the world that is shown, whose axes are the same."""
        self._origin, self._pilot, self._driving = from_odom(np.zeros(3)), pilot, driving
        self._held: set[Side] = set()
        self._gizmos, self._labels = {}, {}
        for side in SIDES:
            gizmo = server.scene.add_transform_controls(f"{WORLD}/{side}_goal", scale=0.15, visible=False)
            label = server.scene.add_label(f"{WORLD}/{side}_refused", "", visible=False)
            gizmo.on_update(lambda event, side=side: self._drag(event, side))
            self._gizmos[side], self._labels[side] = gizmo, label
        server.on_client_disconnect(lambda client: self._gone(str(client.client_id)))

    def _drag(self, event: Any, side: Side) -> None:
        """Take a movement of the mouse, in a thread of the server."""
        if event.phase == "end":
            self._held.discard(side)
        else:
            self._held.add(side)
        goal = None
        if side in self._held:
            goal, gizmo = np.eye(4), self._gizmos[side]
            goal[:3, :3] = Rotation.from_quat(np.asarray(gizmo.wxyz), scalar_first=True).as_matrix()
            goal[:3, 3] = np.asarray(gizmo.position) - self._origin
        self._pilot.drag(f"view {event.client_id}", side, goal, time.monotonic())

    def _gone(self, client: str) -> None:
        self._held.clear()
        self._pilot.leave(f"view {client}")

    def show(self, poses: dict[Side, Array]) -> None:
        """Show the gizmos that nobody drags at `poses` (4, 4) in odom, and what is refused."""
        for side in SIDES:
            gizmo, label, why = self._gizmos[side], self._labels[side], self._driving.refused[side]
            T = poses[side]
            if side not in self._held:
                gizmo.position = T[:3, 3] + self._origin
                gizmo.wxyz = Rotation.from_matrix(T[:3, :3]).as_quat(scalar_first=True)
                gizmo.visible = True
            label.visible = bool(why)
            if why:
                label.text, label.position = why, np.asarray(gizmo.position)
