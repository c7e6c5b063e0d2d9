"""What the controls of the view do, on a running robot; the browser's side is viser's."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from golem.dashboard import film, live
from golem.dashboard.history import BALANCE
from golem.dashboard.live import LiveView
from golem.dashboard.panel import Button
from golem.dashboard.server import CAMERAS, LAYERS
from golem.interfaces import topics
from golem.robots.model.table import JOINT_INDEX
from golem.runtime.lockstep import LockstepRunner
from golem.types import SIDES


@pytest.fixture
def view(walker: tuple[LockstepRunner, Any], monkeypatch: pytest.MonkeyPatch) -> Iterator[LiveView]:
    with LiveView(*walker, port=0) as view:
        monkeypatch.setattr(view._server, "get_clients", lambda: {0: None})  # somebody looks
        yield view


def rest(view: LiveView, seconds: float) -> None:
    end = view._running.executor.t + seconds
    view.idle(lambda: view._running.executor.t >= end)


def test_speed_layers_plot_and_the_past(view: LiveView, walker: tuple[LockstepRunner, Any]) -> None:
    controls, stage = view.panel.view, view._stage
    controls._speed.value = "as fast as it can"
    rest(view, 0.5)
    before = np.array(stage._bodies["left_knee_link"].position)
    for box in controls._layers.values():
        box.value = True
    controls._signal.value = BALANCE
    walker[1].data.body("left_knee_link").xpos[:] += 1.0
    view._next_camera = view._next_chart = 0.0
    view.update()
    assert stage._layers == frozenset(LAYERS)
    assert stage._frames["pelvis"].visible and len(stage._shapes) > 20
    paths = list(view._server.scene._handle_from_node_name)
    assert "/world/contacts" in paths  # a robot that stands
    times, margins = controls._plot.data
    assert len(times) == len(margins) > 5 and margins[-1] > 0.02
    np.testing.assert_allclose(stage._bodies["left_knee_link"].position, before + 1.0, atol=0.05)
    controls._past.value = -0.3
    view.update()
    np.testing.assert_allclose(stage._bodies["left_knee_link"].position, before, atol=0.05)
    for box in controls._layers.values():
        box.value = False
    view._next_camera = view._next_chart = 0.0
    view.update()
    assert "/world/contacts" not in view._server.scene._handle_from_node_name and not stage._frames["pelvis"].visible


def test_what_rests_is_neither_sent_nor_pictured_again(
    view: LiveView, walker: tuple[LockstepRunner, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    made = list[str]()
    monkeypatch.setattr(
        live, "camera_picture", lambda running, shown, camera: made.append(camera) or np.zeros((4, 4, 3))
    )
    rest(view, 0.1)
    stage, data = view._stage, walker[1].data
    knee, palm = (np.array(stage._bodies[name].position) for name in ("left_knee_link", "right_hand"))
    made.clear()
    view._pictured, view._positions = time.perf_counter(), view._view.poses()[0]
    data.body("left_knee_link").xpos[:] += 1e-3
    data.body("right_hand").xpos[:] += 1e-5
    view._next_camera = 0.0
    view.update()
    assert not made and np.array_equal(stage._bodies["right_hand"].position, palm)
    np.testing.assert_allclose(stage._bodies["left_knee_link"].position, knee + 1e-3, atol=1e-6)
    data.body("left_knee_link").xpos[:] += 0.01
    view._next_camera = 0.0
    view.update()
    assert made == list(live.CAMERAS)


def test_robot_time_goes_as_fast_as_asked(view: LiveView) -> None:
    view.panel.view._speed.value = "a tenth"
    rest(view, 0.1)  # from here on at that speed
    begin = time.perf_counter()
    rest(view, 0.2)
    assert time.perf_counter() - begin > 1.0


def test_a_film_is_written_beside_the_robot(view: LiveView, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(film, "FILMS", tmp_path)
    monkeypatch.setattr(film, "LIVE", (160, 90))
    view.panel.view._speed.value = "as fast as it can"
    view.panel.press(Button.RECORD)
    rest(view, 0.3)
    assert view.panel.view.record.label == "End the film"
    view.panel.press(Button.RECORD)
    end = time.monotonic() + 30.0
    while "Written" not in view._note and time.monotonic() < end:
        rest(view, 0.1)
    assert list(tmp_path.glob("*.webp")) and str(tmp_path) in view._note


def test_the_camera_goes_where_it_is_sent(view: LiveView, monkeypatch: pytest.MonkeyPatch) -> None:
    camera = SimpleNamespace(position=None, look_at=None)
    client = SimpleNamespace(camera=camera, atomic=nullcontext)
    monkeypatch.setattr(view._server, "get_clients", lambda: {0: client})
    view.panel.view._camera.value = "above"
    end = time.monotonic() + 5.0
    while camera.position is None and time.monotonic() < end:
        time.sleep(0.01)
    assert (camera.position, camera.look_at) == CAMERAS["above"]


@pytest.mark.slow
def test_arms_go_where_sliders_and_gizmos_say(view: LiveView, walker: tuple[LockstepRunner, Any]) -> None:
    running, arms = walker[0], view.panel.arms
    view.panel.view._speed.value = "as fast as it can"
    rest(view, 1.0)
    view._next_camera = 0.0  # by the clock on the wall the sliders may not have heard yet
    view.update()
    view.panel.press(Button.MOVE)
    rest(view, 0.1)
    assert "slider" in view._note and view._wanted is None
    elbow = next(slider for slider in arms._sliders if slider.label == "left_elbow")
    wanted = elbow.value - 0.3
    elbow.value = wanted
    arms._turn(SimpleNamespace(client=object()))
    view.panel.press(Button.MOVE)
    asked = view.wait_for_skill()
    assert asked is not None
    assert view.run(*asked).success
    state = running.bus.latest(topics.LOW_STATE)
    assert state is not None and state.q[JOINT_INDEX["left_elbow_joint"]] == pytest.approx(wanted, abs=0.03)
    goal = running.commanded("right").copy()
    goal[:3, 3] += (0.05, 0.0, 0.0)
    gizmo = arms._gizmos["right"]
    gizmo.position = goal[:3, 3] + arms._origin
    arms._dragged(None, "right")
    view.panel.press(Button.MOVE)
    asked = view.wait_for_skill()
    assert asked is not None and view.run(*asked).success
    np.testing.assert_allclose(running.commanded("right")[:3, 3], goal[:3, 3], atol=0.02)
    assert set(arms._gizmos) == set(SIDES)
