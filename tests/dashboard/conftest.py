"""A running stack whose localizer sees nothing, so that no detector is loaded."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from golem.runtime.lockstep import LockstepRunner, build
from golem.stack import Stack, load_stack
from golem.types import LocalizedObject, RgbdImage


class Blind:
    """Sees nothing."""

    latency = 0.0

    def locate(self, frame: RgbdImage, labels: tuple[str, ...]) -> list[LocalizedObject]:
        return []


BLIND = f"{__file__}:Blind"


@pytest.fixture
def twin() -> Iterator[tuple[LockstepRunner, Any]]:
    running, robot = build(Stack(profile="bench").with_choice("localizer", BLIND), 0)
    yield running, robot
    robot.close()


@pytest.fixture
def standing() -> Stack:
    """A robot on its feet in the empty hall."""
    stack = load_stack("stand").with_choice("localizer", BLIND)
    return stack.with_options("robot", world="open")


@pytest.fixture
def walker(standing: Stack) -> Iterator[tuple[LockstepRunner, Any]]:
    running, robot = build(standing, 0)
    yield running, robot
    robot.close()
