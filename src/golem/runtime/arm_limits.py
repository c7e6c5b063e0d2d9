"""Watches that the targets of the upper body keep the limits of its joints, as their contract asks for."""

from __future__ import annotations

import math

import numpy as np

from golem.kernels import njit
from golem.robots.model.table import JOINT_NAMES, load_limits
from golem.runtime.contract_check import ContractCheck
from golem.types import UPPER, Array

ROUNDING = 1e-3
"""How far targets may exceed a limit [rad]: sums of steps and single precision."""
BEGINNING = 0.1
"""How much further the first targets after a reset may be from the measured joints [rad]: a controller with narrower
limits of its own, or with an encoder's offset at a limit, starts inside them."""


@njit(cache=True, nogil=True)
def _furthest(q: Array, lower: Array, upper: Array) -> tuple[int, float]:
    """Return which of `q` (n,) is furthest outside its range, and by how much; negative where all are inside."""
    worst, excess = 0, -math.inf
    for i in range(len(q)):
        outside = max(lower[i] - q[i], q[i] - upper[i])
        if outside > excess:
            worst, excess = i, outside
    return worst, excess


class ArmLimits:
    """Remembers the targets of the previous tick, and compares."""

    def __init__(self, contract: ContractCheck, period: float) -> None:
        """Watch the module of `contract`, which runs every `period` [s]."""
        limits = load_limits()
        self._contract, self._period = contract, period
        self._lower: Array = limits.lower[UPPER]
        self._upper: Array = limits.upper[UPPER]
        self._step: Array = limits.velocity[UPPER] * period + ROUNDING
        self._q: Array = np.empty(len(self._lower))
        self._last: Array | None = None
        self._slack = 0.0

    def reset(self, q: Array) -> None:
        """Start from the measured joints `q` (27,) [rad]."""
        self._last = np.clip(q[UPPER], self._lower, self._upper)
        self._slack = BEGINNING

    def check(self, q: Array) -> None:
        """Check the targets `q` (15,) of this tick [rad].

        Raises:
            ModuleFault: one is outside its position limits, or further from the previous one than its joint can move.
        """
        self._q[:] = q
        i, excess = _furthest(self._q, self._lower, self._upper)
        if excess > ROUNDING:
            raise self._contract.fault(
                f"it sends {_joint(i)} to {q[i]:.3g} rad, outside its limits, "
                f"{self._lower[i]:.3g} to {self._upper[i]:.3g} rad"
            )
        if self._last is not None:
            i, excess = _furthest(self._q - self._last, -self._step, self._step)
            if excess > self._slack:
                raise self._contract.fault(
                    f"its target of {_joint(i)} jumps by {abs(q[i] - self._last[i]):.3g} rad in a tick of "
                    f"{self._period:g} s; the joint moves {self._step[i] - ROUNDING:.3g} rad at most"
                )
        self._last, self._slack = self._q.copy(), 0.0


def _joint(i: int) -> str:
    return JOINT_NAMES[UPPER][i]
