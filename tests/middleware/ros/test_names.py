from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from golem.errors import ConfigError
from golem.middleware.ros import names


@pytest.mark.parametrize(
    ("name", "full"),
    [
        ("/joint_states", "/joint_states"),
        ("joint_states", "/robot/joint_states"),
        ("skill/grasp", "/robot/skill/grasp"),
        ("~/state", "/robot/twin/state"),
    ],
)
def test_names_become_absolute(name: str, full: str) -> None:
    assert names.resolve(name, "twin", "/robot") == full


def test_the_root_namespace_adds_one_slash() -> None:
    assert names.resolve("clock", "twin", "/") == "/clock"
    assert names.resolve("~/clock", "twin", "/") == "/twin/clock"


@pytest.mark.parametrize("name", ["", "/", "~", "~x", "/a/", "a//b", "/1a", "a/2b", "a-b", "/a b", "{node}/x", "/ä"])
def test_a_bad_name_is_refused_in_words(name: str) -> None:
    with pytest.raises(ConfigError, match="cannot be the name of a topic, service or action"):
        names.resolve(name, "twin", "/")


def test_length_counts_the_whole_name() -> None:
    room = names.MAX_TOPIC - len("/robot/")
    assert len(names.resolve("a" * room, "twin", "/robot")) == names.MAX_TOPIC
    with pytest.raises(ConfigError, match="longer than 247"):
        names.resolve("a" * (room + 1), "twin", "/robot")


@pytest.mark.parametrize("name", ["", "1a", "a/b", "a-b", "a" * 256])
def test_a_bad_node_is_refused(name: str) -> None:
    with pytest.raises(ConfigError, match="name of a node"):
        names.check_node(name)


@pytest.mark.parametrize("namespace", ["", "robot", "/robot/", "//"])
def test_a_bad_namespace_is_refused(namespace: str) -> None:
    with pytest.raises(ConfigError, match="name of a namespace"):
        names.check_namespace(namespace)


@given(st.lists(st.from_regex(r"[A-Za-z_][A-Za-z0-9_]{0,5}", fullmatch=True), min_size=1, max_size=5))
def test_wire_names_lead_back(tokens: list[str]) -> None:
    name = "/" + "/".join(tokens)
    assert names.from_wire(names.topic(name)) == ("topic", name)
    assert names.from_wire(names.request(name)) == ("request", name)
    assert names.from_wire(names.reply(name)) == ("reply", name)


def test_wire_names_of_an_action() -> None:
    parts = names.action("/skill/grasp")
    assert names.request(parts.send_goal) == "rq/skill/grasp/_action/send_goalRequest"
    assert names.reply(parts.get_result) == "rr/skill/grasp/_action/get_resultReply"
    assert names.topic(parts.status) == "rt/skill/grasp/_action/status"
    assert names.from_wire(names.DISCOVERY_INFO) == ("other", "ros_discovery_info")
