"""rclpy's modules, classes, messages and profiles for those of the node contract; see `rclpy_node`."""

from __future__ import annotations

import importlib
from typing import Any, TypeVar

from golem.errors import ConfigError, MissingSystemLibrary
from golem.middleware.dds.base import Qos
from golem.middleware.ros import codec
from golem.middleware.ros.message import Message

M = TypeVar("M", bound=Message)


def rclpy_module(name: str) -> Any:
    """Return rclpy's module `name`, e.g. `"rclpy.qos"`.

    Raises:
        MissingSystemLibrary: ROS 2 is not installed, or not sourced.
    """
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        raise MissingSystemLibrary(
            "rclpy cannot be imported. It is part of ROS 2: source /opt/ros/<distro>/setup.bash first, with the Python "
            "of that distro; or use the DDS node, which needs no ROS."
        ) from error


def rclpy_type(name: str) -> Any:
    """Return rclpy's class of a message, service or action, e.g. `"std_srvs/srv/SetBool"`.

    Raises:
        ConfigError: ROS does not know it.
    """
    package, kind, short = name.split("/")
    try:
        return getattr(importlib.import_module(f"{package}.{kind}"), short)
    except (ModuleNotFoundError, AttributeError) as error:
        raise ConfigError(
            f"ROS does not know '{name}'; build its package (GOLEM's are in ros/: colcon build) and source its "
            "install/setup.bash."
        ) from error


def to_rclpy(message: Message, kind: Any) -> Any:
    """Return rclpy's message of class `kind` for one of `codec`'s."""
    return rclpy_module("rclpy.serialization").deserialize_message(codec.serialize(message), kind)


def from_rclpy(message: Any, kind: type[M]) -> M:
    """Return `codec`'s message of class `kind` for one of rclpy's."""
    return codec.deserialize(rclpy_module("rclpy.serialization").serialize_message(message), kind)


def qos_profile(qos: Qos) -> Any:
    """Return rclpy's profile of a quality of service."""
    policies = rclpy_module("rclpy.qos")
    reliability, durability = policies.ReliabilityPolicy, policies.DurabilityPolicy
    return policies.QoSProfile(
        history=policies.HistoryPolicy.KEEP_ALL if qos.depth is None else policies.HistoryPolicy.KEEP_LAST,
        depth=qos.depth or 1,
        reliability=reliability.RELIABLE if qos.reliable else reliability.BEST_EFFORT,
        durability=durability.TRANSIENT_LOCAL if qos.transient_local else durability.VOLATILE,
    )


class Counter:
    """Counts what rclpy's executor has handled for us, for it does not tell."""

    def __init__(self) -> None:
        """Start at zero."""
        self.value = 0

    def up(self) -> None:
        """Count one more."""
        self.value += 1


class Closing:
    """Something that can be closed, once.

    Attributes:
        closed: whether it was.
    """

    closed = False

    def close(self) -> None:
        """Stop; calling it again does nothing."""
        if not self.closed:
            self.closed = True
            self._leave()

    def _leave(self) -> None:
        raise NotImplementedError
