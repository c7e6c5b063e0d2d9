"""ROS 2 names: what is valid, how they are made absolute, and what they are called on the wire.

Rules of validity: ros2/rmw, rmw/src/validate_{full_topic_name,namespace,node_name}.c. Expansion: ros2/rcl,
rcl/src/rcl/expand_topic_name.c, without `{substitutions}`. Prefixes on the wire: ros2/rmw_cyclonedds, rmw_node.cpp.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

from golem.errors import ConfigError

MAX_NODE = 255
"""Longest name of a node (RMW_NODE_NAME_MAX_NAME_LENGTH)."""
MAX_TOPIC = 247
"""Longest absolute name of a topic, service or action (RMW_TOPIC_MAX_NAME_LENGTH)."""
MAX_NAMESPACE = MAX_TOPIC - 2
"""Longest namespace (RMW_NAMESPACE_MAX_LENGTH)."""
DISCOVERY_INFO = "ros_discovery_info"
"""Topic, without prefix, on which participants say which node owns which endpoint."""

_TOKEN = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_RULE = "a name is made of tokens of letters, digits and '_' that do not start with a digit"


def check_node(name: str) -> str:
    """Return `name` if a node can be called so. Raises ConfigError: it cannot."""
    if not _TOKEN.fullmatch(name) or len(name) > MAX_NODE:
        raise ConfigError(
            f"'{name}' cannot be the name of a node: one token of letters, digits and '_', not starting with a "
            f"digit, up to {MAX_NODE} characters."
        )
    return name


def check_namespace(namespace: str) -> str:
    """Return `namespace` if nodes can live in it: `/` or an absolute name. Raises ConfigError: they cannot."""
    return namespace if namespace == "/" else _check("namespace", namespace, MAX_NAMESPACE)


def resolve(name: str, node: str, namespace: str) -> str:
    """Return the absolute name of a topic, service or action. Raises ConfigError: it is none of these.

    Args:
        name: absolute (`/a/b`), relative to the namespace (`a/b`), or private to the node (`~/a`).
    """
    root = "" if namespace == "/" else namespace
    if name.startswith("~/"):
        full = f"{root}/{node}/{name[2:]}"
    else:
        full = name if name.startswith("/") else f"{root}/{name}"
    try:
        return _check("topic, service or action", full, MAX_TOPIC)
    except ConfigError as error:
        raise error if full == name else ConfigError(f"{error} It was given as '{name}'.") from None


def _check(kind: str, name: str, maximum: int) -> str:
    if not name.startswith("/") or not all(map(_TOKEN.fullmatch, name[1:].split("/"))):
        raise ConfigError(f"'{name}' cannot be the name of a {kind}: {_RULE}, each after one '/', e.g. '/arm/left'.")
    if len(name) > maximum:
        raise ConfigError(f"'{name[:40]}...' cannot be the name of a {kind}: it is longer than {maximum}.")
    return name


def topic(name: str) -> str:
    """Return the wire name of the topic with absolute `name`."""
    return f"rt{name}"


def request(name: str) -> str:
    """Return the wire name on which requests to service `name` travel."""
    return f"rq{name}Request"


def reply(name: str) -> str:
    """Return the wire name on which replies of service `name` travel."""
    return f"rr{name}Reply"


@dataclass(frozen=True, slots=True)
class ActionNames:
    """The absolute names of the three services and two topics that make up an action.

    Source: ros2/rcl, rcl_action/src/rcl_action/names.c.
    """

    send_goal: str
    cancel_goal: str
    get_result: str
    feedback: str
    status: str


def action(name: str) -> ActionNames:
    """Return the names of the parts of the action with absolute `name`."""
    parts = ("send_goal", "cancel_goal", "get_result", "feedback", "status")
    return ActionNames(*(f"{name}/_action/{part}" for part in parts))


Kind = Literal["topic", "request", "reply", "other"]


def from_wire(wire: str) -> tuple[Kind, str]:
    """Return what a wire name stands for, and its absolute ROS name; `other` names are returned as they are."""
    if wire.startswith("rt/"):
        return "topic", wire[2:]
    if wire.startswith("rq/") and wire.endswith("Request"):
        return "request", wire[2 : -len("Request")]
    if wire.startswith("rr/") and wire.endswith("Reply"):
        return "reply", wire[2 : -len("Reply")]
    return "other", wire
