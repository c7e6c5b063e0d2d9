"""Gizmos on a server that is none: what a mouse does, and what is shown."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np

from golem.teleop.driving import Driving
from golem.teleop.pilot import HandPilot
from golem.teleop.session import Gizmos

ORIGIN = np.array([0.0, 0.0, 1.3])


class Handle(SimpleNamespace):
    """A node of the scene."""

    def on_update(self, call: Callable[[Any], None]) -> None:
        self.call = call

    def mouse(self, phase: str, client: int = 4) -> None:
        self.call(SimpleNamespace(phase=phase, client_id=client))


class Server:
    """What of viser's server is used."""

    def __init__(self) -> None:
        self.handles: dict[str, Handle] = {}
        self.scene = self

    def add_transform_controls(self, name: str, **given: Any) -> Handle:
        return self.handles.setdefault(name, Handle(position=np.zeros(3), wxyz=np.array([1.0, 0.0, 0.0, 0.0]), **given))

    def add_label(self, name: str, text: str, **given: Any) -> Handle:
        return self.handles.setdefault(name, Handle(text=text, position=np.zeros(3), **given))

    def on_client_disconnect(self, call: Callable[[Any], None]) -> None:
        self.gone = call


def test_a_dragged_gizmo_is_a_goal_in_odom_until_it_is_let_go_or_its_window_gone() -> None:
    server, pilot = Server(), HandPilot()
    Gizmos(server, lambda p: p + ORIGIN, pilot, Driving(pilot))  # type: ignore[arg-type]
    right = server.handles["/world/right_goal"]
    right.position = np.array([0.4, -0.2, 1.2])
    right.mouse("start")
    np.testing.assert_allclose(pilot.wish(1e9).goals["right"][:3, 3], (0.4, -0.2, -0.1))
    right.position = np.array([0.4, -0.2, 1.1])
    right.mouse("update")
    np.testing.assert_allclose(pilot.wish(1e9).goals["right"][2, 3], -0.2)
    right.mouse("end")
    assert not pilot.wish(0.0).moves
    right.mouse("start")
    server.gone(SimpleNamespace(client_id=4))
    assert not pilot.wish(0.0).moves


def test_two_windows_that_drag_are_a_fight() -> None:
    server, pilot = Server(), HandPilot()
    Gizmos(server, lambda p: p + ORIGIN, pilot, Driving(pilot))  # type: ignore[arg-type]
    server.handles["/world/right_goal"].mouse("start", 1)
    server.handles["/world/left_goal"].mouse("start", 2)
    assert pilot.wish(0.0).goals == {} and pilot.state == "two"


def test_what_is_refused_stands_at_the_gizmo() -> None:
    server, pilot = Server(), HandPilot()
    driving = Driving(pilot)
    gizmos = Gizmos(server, lambda p: p + ORIGIN, pilot, driving)  # type: ignore[arg-type]
    driving.refused["left"] = "outside the work space"
    T = np.eye(4)
    T[:3, 3] = (0.3, 0.2, 0.1)
    gizmos.show({"left": T, "right": T})
    label = server.handles["/world/left_refused"]
    assert label.visible and label.text == "outside the work space"
    np.testing.assert_allclose(label.position, (0.3, 0.2, 1.4))
    assert not server.handles["/world/right_refused"].visible
    right = server.handles["/world/right_goal"]
    right.mouse("start")
    right.position = np.zeros(3)
    gizmos.show({"left": T, "right": T})
    np.testing.assert_allclose(right.position, 0.0)  # it is in somebody's hand


def test_a_gizmo_stays_in_the_hand_that_drags_it_when_another_window_goes() -> None:
    server, pilot = Server(), HandPilot()
    gizmos = Gizmos(server, lambda p: p + ORIGIN, pilot, Driving(pilot))  # type: ignore[arg-type]
    right = server.handles["/world/right_goal"]
    right.mouse("start", 1)
    right.position = np.array([0.4, -0.2, 1.1])
    server.gone(SimpleNamespace(client_id=2))
    gizmos.show({"left": np.eye(4), "right": np.eye(4)})
    np.testing.assert_allclose(right.position, (0.4, -0.2, 1.1))
    server.gone(SimpleNamespace(client_id=1))
    gizmos.show({"left": np.eye(4), "right": np.eye(4)})
    np.testing.assert_allclose(right.position, ORIGIN)
