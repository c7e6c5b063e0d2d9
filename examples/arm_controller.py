"""An arm controller of your own: the shipped inverse kinematics, at half the speed. How far behind is the palm?"""

from __future__ import annotations

import numpy as np

from golem.capabilities.arms.arm_kinematics import UpperKinematics
from golem.capabilities.arms.diff_ik import DiffIK
from golem.interfaces.payloads import ArmCommand
from golem.runtime.lockstep import start_posture
from golem.types import UPPER, Array


class Unhurried(DiffIK):
    """Goes half as far in every step."""

    def step(self, targets_left: Array | None, targets_right: Array | None, q: Array, dt: float) -> ArmCommand:
        return super().step(targets_left, targets_right, q, 0.5 * dt)


def main() -> None:
    kinematics, dt = UpperKinematics(), 0.01
    for arms in (DiffIK(), Unhurried()):
        q = start_posture()
        arms.reset(q)
        start, off = kinematics.pose("left", q[UPPER]), []
        for i in range(200):
            phase, target = np.pi * i * dt, start.copy()
            target[:3, 3] += 0.05 * np.array([np.sin(phase), 0.0, 1.0 - np.cos(phase)])  # a circle [m]
            q[UPPER] = arms.step(target, None, q, dt).q
            off.append(np.linalg.norm(target[:3, 3] - kinematics.pose("left", q[UPPER])[:3, 3]))
        print(f"{type(arms).__name__}: palm {1e3 * np.mean(off):.1f} mm from its target in the mean")


if __name__ == "__main__":
    main()
