"""Worlds without a robot, ready to step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import mujoco
import numpy as np
import pytest

from golem.robots.worlds.layout import PackLayout
from golem.robots.worlds.pack import PackNames, add_pack
from golem.robots.worlds.screws import ScrewDraw, ScrewRanges, draw_screws


@dataclass
class Compiled:
    """A compiled world with the tray out of the screws' way."""

    model: mujoco.MjModel
    data: mujoco.MjData
    names: PackNames
    draws: list[ScrewDraw]
    layout: PackLayout


Builder = Callable[..., Compiled]


@pytest.fixture
def world() -> Builder:
    """Return a builder of worlds: seed, time step, sleep."""

    def build(seed: int = 0, step: float = 0.0005, sleep: bool = True) -> Compiled:
        layout = replace(PackLayout(), tray_xy=(0.75, -0.7), tray_z=PackLayout().top_z)
        draws = draw_screws(np.random.default_rng(seed), ScrewRanges(), layout.reachable())
        spec = mujoco.MjSpec()
        spec.option.timestep = step
        names = add_pack(spec, layout, draws, sleep=sleep)
        model = spec.compile()
        return Compiled(model, mujoco.MjData(model), names, draws, layout)

    return build
