"""Prints what a step of the pack world costs, with and without sleeping screws."""

from __future__ import annotations

import time
from dataclasses import replace

import mujoco
import numpy as np

from golem.robots.worlds.layout import PackLayout
from golem.robots.worlds.pack import add_pack
from golem.robots.worlds.screws import ScrewRanges, draw_screws

STEPS = 4000


def microseconds(step: float, sleep: bool) -> float:
    """Return the CPU time of a step with eight screws at rest in their bores and no robot [us]."""
    layout = replace(PackLayout(), tray_xy=(0.75, -0.7), tray_z=PackLayout().top_z)
    spec = mujoco.MjSpec()
    spec.option.timestep = step
    add_pack(spec, layout, draw_screws(np.random.default_rng(0), ScrewRanges(), layout.reachable()), sleep=sleep)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 200)
    start = time.process_time()
    mujoco.mj_step(model, data, STEPS)
    return (time.process_time() - start) / STEPS * 1e6


if __name__ == "__main__":
    for step in (0.0005, 0.002):
        costs = [microseconds(step, sleep) for sleep in (False, True)]
        print(f"dt {step * 1e3:.1f} ms: {costs[0]:.1f} us awake, {costs[1]:.1f} us asleep")
