"""A real ROS 2 of each kind, where it can be had; else the tests are skipped and say why."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from tests.interop.peers import Ros, Setup

    from golem.middleware.ros.node import RosNode


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Run what takes a `setup` with every one: the older distribution in CI, the newer one before a release."""
    if "setup" in metafunc.fixturenames:
        pytest.importorskip("cyclonedds")
        pytest.importorskip("rosbags")
        from tests.interop.peers import SETUPS

        newer = pytest.mark.long
        values = [pytest.param(s, marks=newer if s.distro == "kilted" else ()) for s in SETUPS]
        metafunc.parametrize("setup", values, ids=str)


@pytest.fixture
def join(setup: Setup, domain: int) -> Iterator[Callable[[], Ros]]:
    """Start a process of ROS on the test's domain."""
    from tests.interop.peers import CannotError, Ros, environment

    try:
        environment(setup, domain)
    except CannotError as reason:
        pytest.skip(str(reason))
    started: list[Ros] = []

    def start() -> Ros:
        started.append(Ros(setup, domain))
        return started[-1]

    yield start
    for ros in started:
        ros.close()


@pytest.fixture
def ros(join: Callable[[], Ros]) -> Ros:
    """A process of ROS."""
    return join()


@pytest.fixture
def node(domain: int) -> Iterator[RosNode]:
    """A node of ours."""
    from tests.interop.peers import joined

    with joined(domain) as node:
        yield node
