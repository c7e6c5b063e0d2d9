"""DeliGrasp's adaptive grasp (Xie et al., 2024): close a little, allow a little more force, until both fingers press.

    until min(F_a, F_b) >= share * F:   gap <- gap - dx;   ceiling <- ceiling + df  if mean(F_a, F_b) > touch
    then once more:                     gap <- gap - dx

It stops where both fingers press with the share of F, where `MagpieHand` goes on until they press with F: a soft part
is squeezed less. The paper's loop starts at a gap that is told; this one starts where a finger touches.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from golem.hardware.hands.magpie import MagpieConfig, MagpieHand
from golem.interfaces.payloads import GripState
from golem.robots.model.magpie_model import MAX_FORCE
from golem.types import HandCommand, HandState


@dataclass(frozen=True, slots=True)
class DeliGraspConfig:
    """Options of `DeliGrasp`.

    Attributes:
        gap_step: by how much it closes at once [m] [DeliGrasp: 1 mm].
        force_step: by how much it raises the ceiling of each finger [N] [DeliGrasp: 0.2 N for both].
        touch: mean force of the fingers from which they touch something [N] [own: the servo's load reads up to 0.25 N
            without a contact; DeliGrasp has 0.1].
        period: time from one step to the next [s] [own: a finger moves by a step in a fifth of it].
        grip: how contact, rest and slip are told.
    """

    gap_step: float = 0.001
    force_step: float = 0.1
    touch: float = 0.3
    period: float = 0.050
    grip: MagpieConfig = field(default_factory=MagpieConfig)


class DeliGrasp(MagpieHand):
    """One MAGPIE hand that grasps as softly as the part allows; opens fully when it starts."""

    def __init__(self, config: DeliGraspConfig | None = None) -> None:
        self._options = config or DeliGraspConfig()
        self._due = math.inf
        self._finished = False
        super().__init__(self._options.grip)

    def close(self, force: float) -> None:
        """Close until both fingers press with the contact's share of `force` [N]."""
        super().close(force)
        self._due, self._finished = math.inf, False

    def step(self, state: HandState, t: float) -> HandCommand:
        command = super().step(state, t)
        if self._last is None:
            return command
        if self._state is GripState.CLOSING:
            # A contact that is lost again was an impact: it goes on.
            self._finished = False
            self._adapt(self._last, t)
        elif self._state is GripState.CONTACT and not self._finished:
            self._finished = True
            self._goal = max(self._goal - self._options.gap_step, 0.0)
        return HandCommand(t=t, gap=self._goal, force=self._force)

    def _adapt(self, state: HandState, t: float) -> None:
        o, touches = self._options, float(state.force.mean()) > self._options.touch
        if math.isinf(self._due):
            if not touches:
                return
            self._goal, self._due = state.gap, t
        if t < self._due - 1e-9:
            return
        self._due = t + o.period
        self._goal = max(self._goal - o.gap_step, 0.0)
        if touches:
            self._force = min(self._force + o.force_step, MAX_FORCE)

    def _share(self, at_rest: bool) -> float:
        return self.config.contact_share
