"""The vendor's walk beside the twin's and the gate's limits, joint by joint: `python scripts/sport_mode.py`.

The real extremes are `evaluation/real/sport_mode.yaml`. What it prints is the table of docs/how-to/blame.md.
"""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass

import numpy as np
import tyro

from golem.evaluation.episodes.episode import READY
from golem.evaluation.metrics.text_table import TextTable
from golem.hardware.safety.base import SafetyLimits
from golem.interfaces import topics
from golem.package_data import load_data
from golem.robots.model.table import JOINT_NAMES
from golem.runtime.lockstep import build
from golem.skills.walk import WalkGoal
from golem.stack import load_stack
from golem.types import LEGS, NUM_JOINTS


@dataclass(frozen=True)
class SportConfig:
    """Walk with the twin, and put its extremes beside the real robot's."""

    walks: int = 1
    """Walks."""
    distance: float = 4.0
    """Length of each [m]."""
    profile: str = "field"
    """Realism profile."""
    seed: int = 0
    """Of the first."""


def walked(config: SportConfig) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float]:
    """Return least and greatest q, greatest |dq| and |tau| of the motors, (27,) each, and how long it walked [s]."""
    low, high = np.full(NUM_JOINTS, np.inf), np.full(NUM_JOINTS, -np.inf)
    speed, torque, took = np.zeros(NUM_JOINTS), np.zeros(NUM_JOINTS), 0.0
    for seed in range(config.seed, config.seed + config.walks):
        running, robot = build(load_stack("stand", profile=config.profile).with_options("robot", world="open"), seed)
        with closing(robot):
            running.executor.run(READY, lambda: not robot.on_gantry)  # noqa: B023 - called within this turn

            def look() -> None:
                state = running.bus.latest(topics.LOW_STATE)  # noqa: B023 - called within this turn
                if state is not None:
                    np.minimum(low, state.q, out=low)
                    np.maximum(high, state.q, out=high)
                    np.maximum(speed, np.abs(state.dq), out=speed)
                    np.maximum(torque, np.abs(state.tau), out=torque)

            begin = running.executor.t
            result = running.execute("walk", WalkGoal(config.distance), watch=look)
            took += running.executor.t - begin
            print(f"Walk {seed}: {result.reason}")
    return low, high, speed, torque, took


def main(config: SportConfig) -> None:
    """Print the table of the legs, and which of the real extremes the gate would stop."""
    real = load_data("golem.evaluation.real", "sport_mode.yaml")
    limits = {name: SafetyLimits.from_profile(name) for name in ("urdf", "paper")}
    low, high, speed, torque, took = walked(config)
    rows = []
    for k, name in enumerate(JOINT_NAMES[LEGS]):
        a, b, dq, tau = real[name]
        rows.append(
            (name.removesuffix("_joint"), f"{a:.2f} to {b:.2f}", f"{low[k]:.2f} to {high[k]:.2f}", f"{dq:.1f}",
             f"{speed[k]:.1f}", f"{limits['urdf'].velocity[k]:.1f}", f"{tau:.0f}", f"{torque[k]:.0f}",
             f"{limits['urdf'].torque[k]:.0f}", f"{limits['paper'].torque[k]:.0f}")
        )  # fmt: skip
    columns = ("joint", "q real [rad]", "twin", "dq real [rad/s]", "twin", "gate", "tau real [N m]", "twin",
               "gate, urdf", "gate, paper")  # fmt: skip
    title = f"Sport mode and the twin's walk: {config.walks} of {config.distance:g} m, {took:.0f} s, {config.profile}"
    print(TextTable(title, columns, tuple(rows)).markdown())
    for name, one in limits.items():
        over = [
            f"{joint} {what} {value:g} of {limit[k]:.3g}"
            for k, joint in enumerate(JOINT_NAMES)
            for what, value, limit in (("dq", real[joint][2], one.velocity), ("tau", real[joint][3], one.torque))
            if value > limit[k]
        ]
        print(f"\nThe gate of profile {name} would have stopped it at: {', '.join(over) or 'nothing'}.")


if __name__ == "__main__":
    from golem.robots.mujoco.gl import choose_backend

    choose_backend()
    main(tyro.cli(SportConfig))
