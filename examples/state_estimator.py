"""A state estimator of your own: gyroscope integrated, accelerometer as plumb line. How wrong is its tilt?"""

from __future__ import annotations

import numpy as np

from golem.hardware.estimator.attitude import Attitude
from golem.interfaces import topics
from golem.runtime.lockstep import build
from golem.stack import load_stack
from golem.types import BaseEstimate, LowState


class TiltOnly:
    """Tilt of the base by the IMU; the position stays at the origin of odom, as of a robot in its hoist."""

    def __init__(self) -> None:
        self.attitude = Attitude()

    def reset(self, state: LowState) -> None:
        self.attitude.reset(state)

    def step(self, state: LowState, dt: float) -> BaseEstimate:
        T = np.eye(4)
        T[:3, :3] = self.attitude.rotation(state)
        return BaseEstimate(state.t, T_odom_base=T)


def main() -> None:
    stack = load_stack("tether", profile="field").with_choice("estimator", f"{__file__}:TiltOnly")
    running, robot = build(stack, seed=0)
    running.executor.run(1.0)
    believed, true = running.bus.latest(topics.BASE), robot.truth.base().T_world_base
    assert believed is not None
    cosine = min(1.0, believed.T_odom_base[2, :3] @ true[2, :3])  # of the two verticals
    print(f"tilt off by {np.degrees(np.arccos(cosine)):.2f} deg")


if __name__ == "__main__":
    main()
