"""Looking again at a handle: the hand goes before what it saw, until that is where it was expected."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from golem.capabilities.grasping.base import Grasp
from golem.capabilities.planning.base import PlanRefused, Refusal
from golem.skills.open_door import VIEWS, OpenConfig, seen_before
from golem.types import Array, Side

HANDLE, SAID = np.array([0.57, 0.15, 0.14]), np.array([0.58, 0.08, 0.14])
AT_THE_EDGE = np.array([0.51, 0.13, 0.14])
"""Where the palm camera has the handle while it is at the edge of its image."""


class Motion:
    """Brings hands where they are to go, or refuses; remembers where."""

    def __init__(self, refuses: bool) -> None:
        self.refuses = refuses
        self.went: list[Array] = []

    def displace(self, by: Array) -> None:
        pass

    async def to(self, targets: Mapping[Side, Array], speed: float, near: float) -> None:
        if self.refuses:
            raise PlanRefused(Refusal.UNREACHABLE, "The left hand gets no nearer.")
        (T,) = targets.values()
        self.went.append(T[:3, 3].copy())


@pytest.mark.parametrize("refuses", [False, True])
def test_the_hand_goes_before_the_handle_that_it_saw(world: Any, thing: Any, refuses: bool) -> None:
    motion, config, found = Motion(refuses), OpenConfig(), list[Grasp]()
    world.objects["left_hand"] = lambda: [thing("handle", HANDLE if motion.went else AT_THE_EDGE, world.t)]
    T = np.eye(4)
    T[:3, 3] = SAID + (0.02, 0.0, 0.0)

    async def look() -> None:
        handle, grasp = thing("handle", SAID, 0.0), Grasp(T, 0.06, 1.0)
        found.append(await seen_before(world.context, motion, config, handle, grasp, "left"))  # pyright: ignore

    world.run(look())
    true = AT_THE_EDGE if refuses else HANDLE
    np.testing.assert_allclose(found[0].T_odom_gripper[:3, 3], true + (0.02, 0.0, 0.0), atol=1e-9)
    assert len(motion.went) == (0 if refuses else 2)


@pytest.mark.parametrize("shown_from", [0, 1, 2, None])
def test_a_handle_that_is_not_seen_is_looked_for_from_elsewhere(world: Any, thing: Any, shown_from: int | None) -> None:
    motion, config, found = Motion(False), OpenConfig(), list[Grasp]()
    world.objects["left_hand"] = lambda: (
        [thing("handle", HANDLE, world.t)] if shown_from is not None and len(motion.went) > shown_from else []
    )
    T = np.eye(4)
    T[:3, 3] = SAID

    async def look() -> None:
        handle, grasp = thing("handle", SAID, 0.0), Grasp(T, 0.06, 1.0)
        found.append(await seen_before(world.context, motion, config, handle, grasp, "left"))  # pyright: ignore

    world.run(look())
    ends = SAID if shown_from is None else HANDLE
    np.testing.assert_allclose(found[0].T_odom_gripper[:2, 3], ends[:2], atol=1e-9)
    back = SAID[2] - config.before
    looked = VIEWS if shown_from is None else VIEWS[: shown_from + 1]
    views = [(SAID[0], SAID[1] + across, back - further) for across, further in looked]
    np.testing.assert_allclose(motion.went[:-1], views, atol=1e-9)
    # From wherever it looked, it ends before the handle.
    np.testing.assert_allclose(motion.went[-1], (*ends[:2], back), atol=1e-9)
