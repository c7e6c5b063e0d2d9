from __future__ import annotations

import threading
import time
import urllib.request
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from golem.dashboard.live import LiveView
from golem.dashboard.panel import Button
from golem.errors import ConfigError
from golem.hardware.safety.base import GateState, Reason
from golem.middleware import topics
from golem.runtime.assembly import Running
from golem.skills.base import Feedback


@pytest.fixture
def view(twin: tuple[Running, Any], monkeypatch: pytest.MonkeyPatch) -> Iterator[LiveView]:
    with LiveView(*twin, port=0) as view:
        monkeypatch.setattr(view._server, "get_clients", lambda: {0: None})  # somebody looks
        yield view


def until_state(view: LiveView, running: Running, state: GateState, seconds: float = 2.0) -> None:
    end = running.executor.t + seconds
    view.idle(
        lambda: running.executor.t > end or (running.safety is not None and running.safety.state is state)
    )
    assert running.safety is not None and running.safety.state is state


def test_it_serves_a_page_at_the_address_it_names(view: LiveView) -> None:
    with urllib.request.urlopen(view.url, timeout=10) as answer:
        assert answer.status == 200
        assert b"<html" in answer.read(4096).lower()


def test_a_port_that_is_taken_is_named(twin: tuple[Running, Any], view: LiveView) -> None:
    port = int(view.url.rsplit(":", 1)[1])
    with pytest.raises(ConfigError, match=rf"{port}.*--port"):
        LiveView(*twin, port=port)


def test_bodies_cameras_and_target_follow(twin: tuple[Running, Any], view: LiveView) -> None:
    running, robot = twin
    running.bus.publish(
        topics.FEEDBACK, Feedback(0.0, "pick", "servo", "<b>", {"target": [0.4, 0, -0.04]}), 0.0
    )
    view._busy = True
    robot.data.body("right_hand").xpos[:] = (1.0, 2.0, 3.0)
    view.update()
    np.testing.assert_allclose(view._bodies["right_hand"].position, (1.0, 2.0, 3.0))
    for marker in (view._target, view._target_label):
        np.testing.assert_allclose(marker.position, (0.4, 0.0, robot.config.hoist.height - 0.04))
    assert view._target.visible
    assert set(view.panel._cameras) == {"right palm camera", "head camera"}
    assert "&lt;b&gt;" in view.panel._status.content


def test_the_button_stops_the_robot_through_the_gate_and_a_reset_revives_it(
    twin: tuple[Running, Any], view: LiveView
) -> None:
    running, _ = twin
    until_state(view, running, GateState.ACTIVE)
    view.panel.press(Button.PRESS)
    until_state(view, running, GateState.STOP1)
    assert running.safety is not None and running.safety.reason is Reason.ESTOP_PRESSED
    assert (running.safety.command.kp == 0.0).all()
    view.panel.press(Button.REVIVE)  # refused: still pressed
    end = running.executor.t + 0.7
    view.idle(lambda: running.executor.t > end)
    assert running.safety.state is GateState.STOP1
    assert "refuses" in view.panel._status.content
    view.panel.press(Button.RELEASE)
    view.panel.press(Button.REVIVE)
    until_state(view, running, GateState.ACTIVE)


def test_pause_lets_time_stand_still(twin: tuple[Running, Any], view: LiveView) -> None:
    running, _ = twin
    view.panel.press(Button.PAUSE)
    resume = threading.Timer(0.3, view.panel.press, (Button.PAUSE,))
    resume.start()
    begin = time.perf_counter()
    view.idle(lambda: running.executor.t >= 0.1)
    assert time.perf_counter() - begin >= 0.3 + 0.1 - 0.05


def test_a_pick_can_be_asked_for_only_when_none_runs(twin: tuple[Running, Any], view: LiveView) -> None:
    view._busy = True
    view.panel.press(Button.PICK)
    view._serve_buttons()
    assert not view._wanted
    view._busy = False
    view.panel.press(Button.PICK)
    view.wait_for_pick()
    assert not view._wanted  # taken
