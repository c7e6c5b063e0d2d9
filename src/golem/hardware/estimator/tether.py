"""The base of a robot in a hoist: it stays where it hangs, and tilts as its IMU says."""

from __future__ import annotations

import numpy as np

from golem.finite import finite_state
from golem.hardware.estimator.attitude import Attitude, base_rotation
from golem.hardware.estimator.compiled import CompiledEstimator
from golem.kernels import njit
from golem.native import ORDINARY, UNUSUAL, CompiledStage, Record, new_record, shared, stage_code, view
from golem.robots.model.imu_mount import TORSO
from golem.types import LowState

TETHER = np.dtype([("heading", "f8")])
"""Memory of the estimator."""
_memory_at = view(TETHER)


@njit(cache=True, nogil=True)
def tether(r: Record, m: Record) -> None:
    """Write the pose of a base that hangs into the shared record `r`; `m` is a `TETHER`."""
    T = r.T_odom_base
    base_rotation(r.quat, r.q[TORSO], m.heading, T)
    for a in range(3):
        T[a, 3] = T[3, a] = 0.0
    T[3, 3] = 1.0
    r.base_t = r.state_t


@stage_code
def _code(record: int, memory: int) -> int:
    r = shared(record)
    if not finite_state(r):
        return UNUSUAL
    tether(r, _memory_at(memory))
    return ORDINARY


class TetherEstimator(CompiledEstimator):
    """Position fixed at the origin of odom, orientation from the IMU with the torso's yaw undone. Never stale."""

    requires = ("hoist",)

    def __init__(self) -> None:
        super().__init__(CompiledStage(_code(), new_record(TETHER)))

    def reset(self, state: LowState) -> None:
        """Take the present heading of base_link as zero."""
        attitude = Attitude()
        attitude.reset(state)
        self.stage.memory["heading"] = attitude.heading
