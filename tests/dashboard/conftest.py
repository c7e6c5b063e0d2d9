"""A running stack whose localizer sees nothing, so that no detector is loaded."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from golem.runtime.assembly import Running, build
from golem.stack import Stack
from golem.types import Frame, LocalizedObject


class Blind:
    """Sees nothing."""

    latency = 0.0

    def locate(self, frame: Frame, labels: tuple[str, ...]) -> list[LocalizedObject]:
        return []


@pytest.fixture
def twin() -> Iterator[tuple[Running, Any]]:
    running, robot = build(Stack(profile="bench").with_choice("localizer", f"{__file__}:Blind"), 0)
    yield running, robot
    robot.close()
