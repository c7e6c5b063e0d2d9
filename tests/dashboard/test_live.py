from __future__ import annotations

import threading
import time
import urllib.request
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from golem.dashboard import live
from golem.dashboard.live import PATIENCE, LiveView
from golem.dashboard.panel import Button, SkillPanel
from golem.errors import ConfigError
from golem.hardware.safety.base import OperatorRequest
from golem.interfaces import topics
from golem.interfaces.payloads import Feedback, GateState, Reason
from golem.robots.mujoco.balance import PERIOD
from golem.robots.mujoco.spectator import BodyMesh, SpectatorView
from golem.runtime.lockstep import LockstepRunner, build
from golem.skills.pick import PickGoal
from golem.skills.walk import StandGoal
from golem.stack import Stack
from golem.types import Twist

MESHES: dict[int, list[BodyMesh]] = {}


@pytest.fixture(autouse=True)
def meshes_are_made_once(monkeypatch: pytest.MonkeyPatch) -> None:
    make = SpectatorView.meshes

    def meshes(view: SpectatorView) -> list[BodyMesh]:
        world = len(view.moving)
        if world not in MESHES:
            MESHES[world] = make(view)
        return MESHES[world]

    monkeypatch.setattr(SpectatorView, "meshes", meshes)


@pytest.fixture
def view(twin: tuple[LockstepRunner, Any], monkeypatch: pytest.MonkeyPatch) -> Iterator[LiveView]:
    with LiveView(*twin, port=0) as view:
        monkeypatch.setattr(view._server, "get_clients", lambda: {0: None})  # somebody looks
        yield view


def until_state(view: LiveView, running: LockstepRunner, state: GateState, seconds: float = 3.0) -> None:
    end = running.executor.t + seconds
    view.idle(lambda: running.executor.t > end or (running.safety is not None and running.safety.state is state))
    assert running.safety is not None and running.safety.state is state


def test_it_serves_a_page_at_the_address_it_names(view: LiveView) -> None:
    with urllib.request.urlopen(view.url, timeout=10) as answer:
        assert answer.status == 200
        assert b"<html" in answer.read(4096).lower()


def test_a_port_that_is_taken_is_named(twin: tuple[LockstepRunner, Any], view: LiveView) -> None:
    port = int(view.url.rsplit(":", 1)[1])
    with pytest.raises(ConfigError, match=rf"{port}.*--port"):
        LiveView(*twin, port=port)


def test_bodies_cameras_and_target_follow(twin: tuple[LockstepRunner, Any], view: LiveView) -> None:
    running, robot = twin
    running.bus.publish(topics.FEEDBACK, Feedback(0.0, "pick", "servo", "<b>", {"target": [0.4, 0, -0.04]}), 0.0)
    view._busy = True
    robot.data.body("right_hand").xpos[:] = (1.0, 2.0, 3.0)
    view.update()
    np.testing.assert_allclose(view._stage._bodies["right_hand"].position, (1.0, 2.0, 3.0))
    for marker in (view._stage._target, view._stage._target_label):
        np.testing.assert_allclose(marker.position, (0.4, 0.0, robot.config.hoist.height - 0.04))
    assert view._stage._target.visible
    assert set(view.panel._pictures) == {"right palm camera", "head camera"}
    assert "&lt;b&gt;" in view.panel._status.content


def test_the_button_stops_the_robot_through_the_gate_and_a_reset_revives_it(
    twin: tuple[LockstepRunner, Any], view: LiveView
) -> None:
    running, _ = twin
    until_state(view, running, GateState.ACTIVE)
    view.panel.press(Button.PRESS)
    until_state(view, running, GateState.STOP1)
    assert running.safety is not None and running.safety.reason is Reason.ESTOP_PRESSED
    command = running.bus.latest(topics.LOW_CMD)
    assert command is not None and (command.kp == 0.0).all()
    view.panel.press(Button.REVIVE)  # refused: still pressed
    end = running.executor.t + PATIENCE + 0.2
    view.idle(lambda: running.executor.t > end)
    assert running.safety.state is GateState.STOP1
    assert "refuses" in view.panel._status.content
    view.panel.press(Button.RELEASE)
    view.panel.press(Button.REVIVE)
    until_state(view, running, GateState.ACTIVE)


def test_revived_right_after_a_stop_the_robot_moves_once_the_gate_takes_a_reset(
    twin: tuple[LockstepRunner, Any], view: LiveView
) -> None:
    running, _ = twin
    until_state(view, running, GateState.ACTIVE)
    running.request(OperatorRequest.STOP)
    until_state(view, running, GateState.STOP1)
    stopped = running.executor.t
    view.panel.press(Button.REVIVE)
    until_state(view, running, GateState.ACTIVE)
    assert running.executor.t > stopped + 0.9


def test_pause_lets_time_stand_still(twin: tuple[LockstepRunner, Any], view: LiveView) -> None:
    running, _ = twin
    view.panel.press(Button.PAUSE)
    resume = threading.Timer(0.3, view.panel.press, (Button.PAUSE,))
    resume.start()
    begin = time.perf_counter()
    view.idle(lambda: running.executor.t >= 0.1)
    assert time.perf_counter() - begin >= 0.3 + 0.1 - 0.05


def test_what_an_agent_asks_for_is_shown_and_answered_by_two_buttons(
    twin: tuple[LockstepRunner, Any], view: LiveView
) -> None:
    said: list[bool] = []
    view.decide = said.append
    view.panel.ask("[3] walk <b>x</b>")
    assert view.panel._question.visible and "&lt;b&gt;" in view.panel._question.content
    view.panel.press(Button.ALLOW)
    view.panel.press(Button.DENY)
    view.idle(lambda: len(said) == 2)
    assert said == [True, False]
    view.panel.ask(None)
    assert not view.panel._question.visible and not any(handle.visible for handle in view.panel._answers)


def fill(panel: SkillPanel, name: str, **values: Any) -> None:
    """Choose a skill, and fill in some fields, as clicks and keys do."""
    panel._name.value = name
    panel._show()
    for key, value in values.items():
        panel._shown[1][key].value = value


def test_a_skill_can_be_started_only_when_none_runs(twin: tuple[LockstepRunner, Any], view: LiveView) -> None:
    running, _ = twin
    until_state(view, running, GateState.ACTIVE)
    fill(view.panel.skill, "stand", seconds=3.0)
    run = running.start("stand", StandGoal())
    view.panel.press(Button.START)
    view._serve_buttons()
    assert view._wanted is None
    run.cancel()
    view.panel.press(Button.START)
    assert view.wait_for_skill() == ("stand", StandGoal(3.0))
    assert view._wanted is None  # taken


def test_the_form_has_a_field_for_each_of_the_goal(view: LiveView) -> None:
    panel = view.panel.skill
    fill(panel, "pick", label="bolt", side="left")
    places = {"avoid": [], "wanted": [], "level": [], "container_at": [], "off": [], "landmarks": []}
    assert panel.chosen == ("pick", {"label": "bolt", "container": "tray", "side": "left"} | places)
    fill(panel, "walk", x=1.5)
    goal = {"x": 1.5, "y": 0.0, "yaw": 0.0, "frame": "base_link", "timeout": 60.0}
    assert panel.chosen == ("walk", goal)


def test_a_goal_without_sense_is_said_and_not_started(twin: tuple[LockstepRunner, Any], view: LiveView) -> None:
    fill(view.panel.skill, "stand", seconds=-1.0)
    view.panel.press(Button.START)
    view._serve_buttons()
    assert view._wanted is None and "zero or more seconds" in view._note


def test_a_skill_can_be_cancelled_and_the_robot_stays_up(twin: tuple[LockstepRunner, Any], view: LiveView) -> None:
    running, _ = twin
    until_state(view, running, GateState.ACTIVE)
    enabled: list[bool] = []

    def cancel() -> None:
        enabled.append(not view.panel.skill.cancel.disabled)
        if running.executor.t > 0.5:
            view.panel.press(Button.CANCEL)

    result = view.run("pick", PickGoal(), watch=cancel)
    assert (result.success, result.stage) == (False, "cancelled") and running.executor.t < 0.7
    assert running.safety is not None and running.safety.state is GateState.ACTIVE
    assert enabled[-1] and view.panel.skill.cancel.disabled
    assert view._note == result.reason, "the page says how it ended"


@pytest.fixture
def walk(walker: tuple[LockstepRunner, Any], monkeypatch: pytest.MonkeyPatch) -> Iterator[LiveView]:
    with LiveView(*walker, port=0, restarts=True) as view:
        monkeypatch.setattr(view._server, "get_clients", lambda: {0: None})
        monkeypatch.setattr(view, "_show_pictures", lambda: None)  # each is rendered on the CPU
        monkeypatch.setattr(view, "_wait", lambda t: None)
        yield view


def run(view: LiveView, running: LockstepRunner, seconds: float) -> None:
    end = running.executor.t + seconds
    view.idle(lambda: running.executor.t > end)


def test_a_hanging_robot_has_neither_sliders_nor_pushes(view: LiveView) -> None:
    assert view.panel.legs is None


def test_the_sliders_drive_until_nobody_looks(
    walker: tuple[LockstepRunner, Any], walk: LiveView, monkeypatch: pytest.MonkeyPatch
) -> None:
    running, legs = walker[0], walk.panel.legs
    assert legs is not None
    until_state(walk, running, GateState.ACTIVE)
    run(walk, running, 0.1)
    maximum = running.envelope.vx[1]
    assert legs._sliders["vx"].max == maximum > 0.0
    legs.twist = Twist(vx=9.0)
    run(walk, running, 0.4)
    heard = running.bus.latest(topics.LEG_STATUS)
    assert heard is not None and heard.commanded == Twist(vx=maximum)
    end = running.executor.t + 3.0  # the base estimate has to find the floor, and the legs to change hands

    def walks() -> bool:
        status = running.bus.latest(topics.LEG_STATUS)
        return running.executor.t > end or (status is not None and status.applied.vx > 0.1)

    walk.idle(walks)
    assert running.executor.t <= end
    assert "ahead" in walk.panel._status.content
    walk.panel.press(Button.STAND)
    run(walk, running, 0.1)
    assert legs.twist == Twist() == running.bus.latest(topics.TWIST)
    legs.twist = Twist(wz=0.3)
    monkeypatch.setattr(walk._server, "get_clients", dict)
    run(walk, running, 0.1)
    assert legs.twist == Twist() == running.bus.latest(topics.TWIST)


def test_an_emergency_stop_takes_the_sliders_back(walker: tuple[LockstepRunner, Any], walk: LiveView) -> None:
    running, legs = walker[0], walk.panel.legs
    assert legs is not None
    until_state(walk, running, GateState.ACTIVE)
    legs.twist = Twist(vy=0.2)
    walk.panel.press(Button.PRESS)
    until_state(walk, running, GateState.STOP1)
    run(walk, running, 0.1)
    assert legs.twist == Twist()


def test_the_button_pushes_with_the_impulse_that_is_set(walker: tuple[LockstepRunner, Any], walk: LiveView) -> None:
    running, robot = walker
    legs = walk.panel.legs
    assert legs is not None
    run(walk, running, 0.1)
    before = robot.truth.com()[1][1]
    legs._direction.value, legs._impulse.value = "left", 40.0
    walk.panel.press(Button.PUSH)
    run(walk, running, 0.1)
    assert walk._pusher.force == pytest.approx([0.0, 200.0, 0.0], abs=2.0)
    assert walk._stage._arrow.visible
    assert robot.truth.com()[1][1] - before > 0.05  # 40 N s move 75 kg at 0.5 m/s, less what legs and band hold
    run(walk, running, 1.0)
    assert not walk._pusher.force.any() and not walk._stage._arrow.visible
    pushed = walk._recorder.trace()
    assert PERIOD * pushed.force[:, 1].sum() == pytest.approx(40.0, rel=0.06)


def test_the_camera_stays_with_a_robot_that_moves(walker: tuple[LockstepRunner, Any], walk: LiveView) -> None:
    _, robot = walker
    robot.data.body("pelvis").xpos[:2] = (2.0, -1.0)
    walk._stage.show(10.0, None)
    np.testing.assert_allclose(walk._stage._world.position, (-2.0, 1.0, 0.0), atol=1e-5)


def test_starting_over_shows_the_new_episode(
    standing: Stack, walker: tuple[LockstepRunner, Any], walk: LiveView
) -> None:
    run(walk, walker[0], 0.3)
    walk.panel.press(Button.RESTART)
    assert walk.wait_for_skill() is None
    running, robot = build(standing, 0)
    walk.attach(running, robot)
    run(walk, running, 0.1)
    assert len(walk._recorder.trace().t) == pytest.approx(11, abs=1)
    assert "robot time 0.1 s" in walk.panel._status.content
    robot.close()


def test_a_passive_view_shows_a_robot_that_somebody_else_drives(
    walker: tuple[LockstepRunner, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live, "ARRIVAL", 0.0)
    running, robot = walker
    with LiveView(*walker, port=0, passive=True) as view:
        monkeypatch.setattr(view._server, "get_clients", lambda: {0: None})
        robot.push(np.array([0.0, 50.0, 0.0]))
        running.executor.run(0.2)
        assert view._stage._arrow.visible, "the push of whoever pushes"
        assert len(view._recorder.trace().t) >= 0.2 / PERIOD - 1
        assert running.bus.latest(topics.TWIST) is None, "its sliders command nothing"
