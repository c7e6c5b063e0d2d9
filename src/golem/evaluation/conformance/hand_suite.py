"""What the controller of a hand promises: see `golem.hardware.hands.base`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Literal, NamedTuple

from golem.evaluation.conformance import samples
from golem.evaluation.conformance.base import Candidate, check
from golem.evaluation.conformance.suite import Suite
from golem.hardware.hands.base import HandController
from golem.interfaces.payloads import GripState, HandStatus
from golem.robots.model.magpie_model import MAX_FORCE, MAX_GAP
from golem.runtime.contract_check import ContractCheck
from golem.types import HandCommand, HandState

PERIOD = 0.01
PART = 0.012
"""Width of what the hand closes on [m]."""
FORCE = 8.0


class HandInput(NamedTuple):
    """What the hand reports, and what it was asked for just before."""

    state: HandState
    asked: tuple[Literal["open", "close"], float] | None = None


class HandAnswer(NamedTuple):
    """What the controller sends to the servos, and what it reports to the skills."""

    command: HandCommand
    status: HandStatus


class HandSuite(Suite):
    """Inputs are reports and requests, answers commands with the status."""

    slot, contracts, forgets = "hand", (HandController,), False
    takes = PERIOD

    def context(self) -> Mapping[str, object]:
        """Return which hand it is."""
        return {"side": "right"}

    def inputs(self) -> Sequence[HandInput]:
        """Return a hand that opens, closes on a part, holds it, and lets it go."""
        given: list[HandInput] = [HandInput(samples.hand_state(0.0, 0.05), ("open", 0.06))]
        for i in range(1, 80):
            t = i * PERIOD
            gap = max(PART, 0.06 - 0.2 * max(0.0, t - 0.1)) if t < 0.6 else 0.05
            pressed = FORCE if PART == gap else 0.0
            asked = ("close", FORCE) if i == 10 else ("open", 0.05) if i == 60 else None
            given.append(HandInput(samples.hand_state(t, gap, pressed), asked))
        return given

    def edges(self) -> Mapping[str, Sequence[HandInput]]:
        """Return requests at and beyond what a hand can do."""
        asked: dict[str, tuple[Literal["open", "close"], float]] = {
            "opening beyond the widest gap": ("open", 2.0 * MAX_GAP),
            "opening by less than nothing": ("open", -0.01),
            "closing with no force": ("close", 0.0),
            "closing beyond the greatest force": ("close", 10.0 * MAX_FORCE),
        }
        return {
            what: [HandInput(samples.hand_state(i * PERIOD, 0.05), one if i == 1 else None) for i in range(6)]
            for what, one in asked.items()
        }

    def spoiled(self) -> Mapping[str, HandInput]:
        t = 3 * PERIOD
        return {
            "the gap": HandInput(samples.hand_state(t, samples.NAN)),
            "the force": HandInput(samples.hand_state(t, 0.05, samples.NAN)),
            "the force that is asked for": HandInput(samples.hand_state(t, 0.05), ("close", samples.NAN)),
        }

    def call(self, module: HandController, given: HandInput) -> HandAnswer:
        """Ask for what is to be asked for; return command and status."""
        if given.asked is not None:
            what, amount = given.asked
            (module.open if what == "open" else module.close)(amount)
        return HandAnswer(module.step(given.state, given.state.t), module.status())

    def judge(self, contract: ContractCheck, answer: HandAnswer) -> None:
        command: Any = answer.command
        contract.kind("the hand command", command, HandCommand)
        contract.number("gap", command.gap, minimum=0.0)
        contract.number("force", command.force, minimum=0.0)
        status: Any = answer.status
        contract.kind("the status", status, HandStatus)
        contract.kind("the state of the grip", status.state, GripState)
        contract.number("the gap of the status", status.gap)
        contract.number("the offset of the status", status.offset)
        contract.array("the force of the status", status.force, 2)

    @check
    def keeps_the_range_of_the_hand(self, candidate: Candidate) -> None:
        """The commands to the servos are gaps and forces that the hand has."""
        for what, inputs in {"ordinary requests": self.inputs(), **self.edges()}.items():
            for answer in self.run(candidate, inputs):
                command = answer.command
                if command.gap > MAX_GAP + 1e-9 or command.force > MAX_FORCE + 1e-9:
                    raise candidate.fault(
                        f"{what}: it tells the servos {command.gap:.3g} m and {command.force:.3g} N; "
                        f"the hand has {MAX_GAP:g} m and {MAX_FORCE:g} N"
                    )

    @check
    def says_what_it_does_not_know(self, candidate: Candidate) -> None:
        """Before the first report, gap, offset and force of its status are NaN."""
        status = candidate.contract.call(candidate.make().status)
        if not (math.isnan(status.gap) and math.isnan(status.offset)):
            raise candidate.fault(f"before the first report its status says a gap of {status.gap:g} m")

    @check
    def holds_what_it_presses_on(self, candidate: Candidate) -> None:
        """Fingers that press on a part and rest are said to hold it, and not after they were opened."""
        answers = self.answers_of(candidate)
        if not any(answer.status.holding for answer in answers[10:60]):
            raise candidate.fault("it closed on a part, presses on it, and never says that it holds it")
        if answers[-1].status.holding:
            raise candidate.fault("it was opened, and says that it still holds the part")
