"""Topic names: one stream each."""

from __future__ import annotations

from golem.interfaces import topics
from golem.interfaces.payloads import DetectionRequest, HandGoal
from golem.middleware.bus import Topic
from golem.types import SIDES


def test_no_two_streams_share_a_name() -> None:
    fixed = [value.name for value in vars(topics).values() if isinstance(value, Topic)]
    per_side = (topics.hand_state, topics.hand_command, topics.hand_goal, topics.hand_status)
    per_camera = (topics.rgbd_images, topics.detection_request, topics.detections)
    names = (
        fixed
        + [topic(side).name for topic in per_side for side in SIDES]
        + [topic(camera).name for topic in per_camera for camera in ("head", "left_hand", "right_hand")]
    )
    assert len(fixed) >= 10
    assert len(set(names)) == len(names)


def test_the_silent_request_stops_the_stream_and_a_goal_without_gap_closes() -> None:
    assert DetectionRequest().labels == ()
    assert HandGoal(None, 5.0).gap is None
