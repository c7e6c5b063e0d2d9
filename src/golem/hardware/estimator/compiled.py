"""A base estimator whose step is compiled: in the chain of stages, or called like any other estimator."""

from __future__ import annotations

from golem.finite import check_measured
from golem.native import CompiledStage, new_shared, own
from golem.native_messages import base_of, put_state
from golem.types import BaseEstimate, LowState


class CompiledEstimator:
    """Base class of an estimator that is one compiled stage; see `BaseEstimator`."""

    def __init__(self, stage: CompiledStage) -> None:
        """Run `stage`; in a chain it is called without this class, with the same memory."""
        self.stage = stage
        self._record = new_shared()

    def native(self) -> CompiledStage | None:
        """Return the stage; see `HasStage`."""
        return self.stage if own(self, CompiledEstimator, "step") else None

    def step(self, state: LowState, dt: float) -> BaseEstimate:
        check_measured(state)
        put_state(self._record, state)
        self._record["dt"] = dt
        self.stage.run(self._record)
        return base_of(self._record)
