"""A base estimator whose step is compiled: in the chain of stages, or called like any other estimator."""

from __future__ import annotations

import math

from golem.finite import check_measured
from golem.hardware.estimator.attitude import sensed_rotation
from golem.native import CompiledStage, new_shared, own
from golem.native_messages import base_of, put_state
from golem.types import BaseEstimate, LowState


class CompiledEstimator:
    """Base class of an estimator that is one compiled stage, whose memory has a `heading`; see `BaseEstimator`."""

    def __init__(self, stage: CompiledStage) -> None:
        """Run `stage`, whose memory is as it begins; in a chain it is called without this class, with that memory."""
        self.stage = stage
        self._begin = stage.memory.copy()
        self._record = new_shared()

    def native(self) -> CompiledStage | None:
        """Return the stage; see `HasStage`."""
        return self.stage if own(self, CompiledEstimator, "step") else None

    def reset(self, state: LowState) -> None:
        """Start at rest above the origin of odom, heading zero."""
        self.stage.memory[:] = self._begin
        R = sensed_rotation(state)
        self.stage.memory["heading"] = math.atan2(R[1, 0], R[0, 0])

    def step(self, state: LowState, dt: float) -> BaseEstimate:
        check_measured(state)
        put_state(self._record, state)
        self._record["dt"] = dt
        self.stage.run(self._record)
        return base_of(self._record)
