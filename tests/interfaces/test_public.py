"""The table of public streams: sound in itself, and what the documentation says."""

from __future__ import annotations

from collections import Counter

import pytest
from scripts.topics_page import ABSENT, page
from tests.conftest import REPOSITORY

from golem.interfaces import public
from golem.robots.sensors.cameras import CAMERAS


def test_the_documentation_is_that_of_the_table() -> None:
    path = REPOSITORY / "docs" / "reference" / "topics.md"
    advice = "write it anew: python scripts/topics_page.py docs/reference/topics.md"
    assert path.read_text(encoding="utf-8") == page(), advice


def test_nobody_publishes_a_topic_twice_and_every_name_has_one_type() -> None:
    assert max(Counter((row.name, row.by) for row in public.TOPICS).values()) == 1
    types = {(row.name, row.type) for row in public.TOPICS}
    assert len(types) == len({row.name for row in public.TOPICS})
    assert max(Counter(row.name for row in (*public.SERVICES, *public.ACTIONS)).values()) == 1
    assert not {row.name for row in public.TOPICS} & ABSENT.keys()


def test_the_motors_are_commanded_by_the_safety_process_alone() -> None:
    assert [row.by for row in public.TOPICS if row.name == "/lowcmd"] == ["safety"]


def test_the_cameras_are_those_of_the_robot() -> None:
    assert set(public.CAMERAS) == set(CAMERAS)
    rates = {row.rate for row in public.TOPICS if row.name.startswith("/realsense/")}
    assert rates == {info.rate for info in CAMERAS.values()}


def test_every_type_exists() -> None:
    pytest.importorskip("rosbags")
    from golem.middleware.ros import codec

    for row in public.TOPICS:
        codec.message(row.type)
    for row in public.SERVICES:
        codec.service(row.type)
    for row in public.ACTIONS:
        codec.action(row.type)
