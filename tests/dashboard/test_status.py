from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from golem.dashboard.status import Timeline, camera_picture, read_status
from golem.interfaces import topics
from golem.interfaces.payloads import Detections, Feedback, GateState
from golem.robots.mujoco.spectator import SpectatorView
from golem.runtime.lockstep import LockstepRunner
from golem.types import Detection, LocalizedObject, RgbdImage


def say(running: LockstepRunner, t: float, stage: str, **data: object) -> None:
    running.bus.publish(topics.FEEDBACK, Feedback(t, "pick", stage, f"In {stage}.", dict(data)), t)


def test_before_the_first_tick_there_is_a_status(twin: tuple[LockstepRunner, Any]) -> None:
    status = read_status(twin[0])
    assert (status.t, status.stage, status.safety, status.reason) == (0.0, "", GateState.INIT, "")


def test_the_timeline_counts_each_stage_and_keeps_the_last_target(twin: tuple[LockstepRunner, Any]) -> None:
    running, _ = twin
    say(running, 0.5, "of an earlier run")
    timeline = Timeline.of(running)
    timeline.update(running)
    assert timeline.stages == [] and timeline.durations(0.7) == []
    for t, stage, data in (
        (1.0, "detect", {}),
        (1.5, "servo", {"target": [0.4, 0.0, 0.1]}),
        (1.6, "servo", {"target": [0.4, 0.0, 0.2]}),
        (3.0, "extract", {}),
    ):
        say(running, t, stage, **data)
        timeline.update(running)
        timeline.update(running)
    assert timeline.durations(4.0) == [("detect", 0.5), ("servo", 1.5), ("extract", 1.0)]
    assert timeline.target == pytest.approx([0.4, 0.0, 0.2])


def test_a_fresh_frame_is_shown_with_what_was_found_and_a_stale_one_is_not(twin: tuple[LockstepRunner, Any]) -> None:
    running, robot = twin
    view = SpectatorView(robot)
    info = robot.cameras["head"]
    grey = np.full((info.height, info.width, 3), 90, np.uint8)
    frame = RgbdImage(0.0, info, grey, np.zeros((info.height, info.width), np.float32), np.eye(4))
    box = Detection("screw", 0.9, np.array([100.0, 100.0, 140.0, 120.0]), np.array([120.0, 110.0]))
    found = LocalizedObject(box, 0.0, np.zeros(3), np.zeros((1, 3)))
    running.bus.publish(topics.rgbd_images("head"), frame, 0.0)
    running.bus.publish(topics.detections("head"), Detections(0.0, "head", (found,)), 0.0)
    picture = camera_picture(running, view, "head")
    assert picture.shape == (240, 320, 3)
    assert (picture[50, 50:70] != 90).any() and (picture[10, 10] == 90).all()
    assert (grey == 90).all()  # the robot's own frame stays clean
    running.executor.run(0.3)
    assert camera_picture(running, view, "head").std() > 10.0  # rendered now
    view.close()
