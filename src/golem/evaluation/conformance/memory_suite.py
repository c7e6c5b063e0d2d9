"""What a memory promises: see `golem.capabilities.memory.base`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from golem.capabilities.memory.base import WHENS, Memory, MemoryFault, Observation, Place
from golem.evaluation.conformance import samples
from golem.evaluation.conformance.base import Candidate, check
from golem.evaluation.conformance.suite import Suite
from golem.runtime.checked import check_place
from golem.runtime.contract_check import ContractCheck
from golem.types import Array, Detection, LocalizedObject

LABEL, OTHER, NEVER = "mug", "bowl", "submarine"
APART = np.array([4.0, 0.0, 0.0])
"""From the place where the first thing was seen to that of the other [m]."""
HIT = 1.0
"""How far from where it was seen a thing may be answered [m] [own]: a frame's own memory knows no better."""
ALLOWED = 0.1
"""CPU time that a look and a question may take [s]: a tenth of what the slowest localizer takes."""


def look(t: float, label: str = LABEL, at: Array | float = 0.0) -> Observation:
    """Return a look from above at a thing called `label`, `at` (3,) from the origin of the sample image [m]."""
    frame = samples.image(t)
    T = frame.T_odom_optical.copy()
    T[:3, 3] += at
    place = T[:3, 3] - (0.0, 0.0, 0.5)
    rng = np.random.default_rng(3)
    cloud = place + rng.uniform(-0.03, 0.03, (100, 3))
    box = np.array([310.0, 230.0, 330.0, 250.0])
    found = LocalizedObject(Detection(label, 0.9, box, np.array([320.0, 240.0])), t, place, cloud)
    return Observation(replace(frame, T_odom_optical=T), [found], (LABEL, OTHER))


class MemorySuite(Suite):
    """Inputs are looks, answers what is remembered of both things then, for every time that can be asked for."""

    slot, contracts, forgets = "memory", (Memory,), False
    takes = ALLOWED

    def declared(self, contract: ContractCheck, module: Any) -> None:
        """Check that it has seen nothing yet."""
        last = contract.kind("last", module.last, float)
        if last != -math.inf:
            raise contract.fault(f"last is {last} before the first look, the contract asks for -inf")

    def inputs(self) -> Sequence[Observation]:
        """Return looks at two things in turn, far from each other."""
        looks = [look(0.2 * i, LABEL if i % 2 == 0 else OTHER, (i % 2) * APART) for i in range(8)]
        return [replace(one, objects=list(one.objects)) for one in looks]

    def edges(self) -> Mapping[str, Sequence[Observation]]:
        """Return looks that show nothing, or a great deal, or lie far apart."""
        first = look(0.0)
        blind = replace(first.frame, depth=np.zeros_like(first.frame.depth))
        bare = replace(first.objects[0], points=np.zeros((0, 3)))
        return {
            "a look without objects": [replace(first, objects=[]), look(0.2)],
            "a look without depth": [replace(first, frame=blind), look(0.2)],
            "an object without points": [replace(first, objects=[bare]), look(0.2)],
            "a hundred equal things in one look": [replace(first, objects=list(first.objects) * 100)],
            "a year between two looks": [first, look(3e7)],
            "a thing 10 km away": [first, look(0.2, LABEL, np.array([1e4, 0.0, 0.0]))],
        }

    def spoiled(self) -> Mapping[str, Observation]:
        one = look(0.6)
        T = samples.with_nan(one.frame.T_odom_optical)
        thing = one.objects[0]
        return {
            "the pose": replace(one, frame=replace(one.frame, T_odom_optical=T)),
            "an object's place": replace(one, objects=[replace(thing, position=samples.with_nan(thing.position, 0))]),
            "the time": replace(one, frame=replace(one.frame, t=samples.NAN)),
        }

    def call(self, module: Memory, given: Observation) -> list[Place]:
        """Return what is remembered after one look."""
        module.observe(given)
        return [
            place
            for label in (LABEL, OTHER)
            for when in WHENS
            for place in module.query(label, when, given.frame.t if when == "at" else None)
        ]

    def judge(self, contract: ContractCheck, answer: Any) -> None:
        for place in contract.kind("what it returns", answer, list):
            check_place(contract, place)

    def _after(self, candidate: Candidate) -> Memory:
        module = candidate.make()
        self.run(candidate, self.inputs(), module)
        return module

    @check
    def answers_with_where_it_was_seen(self, candidate: Candidate) -> None:
        """Of two things that were seen, each is answered where it was."""
        module = self._after(candidate)
        for one in self.inputs()[:2]:
            thing = one.objects[0]
            found = candidate.contract.call(module.query, thing.label)
            if not found:
                raise candidate.fault(f"asked for a {thing.label} that was seen four times, it knows of none")
            off = float(np.linalg.norm(found[0].position - thing.position))
            if off > HIT:
                raise candidate.fault(f"the {thing.label} is answered {off:.2f} m from where it was seen")

    @check
    def knows_nothing_of_what_was_never_seen(self, candidate: Candidate) -> None:
        """A question for what nobody saw is answered with no place."""
        found = candidate.contract.call(self._after(candidate).query, NEVER)
        if found:
            raise candidate.fault(f"asked for a {NEVER}, it answers with a {found[0].label}")

    @check
    def answers_with_as_many_as_asked_for(self, candidate: Candidate) -> None:
        """No more places come than were asked for, best first."""
        module = self._after(candidate)
        one = candidate.contract.call(module.query, LABEL, "anywhere", None, 1)
        if len(one) > 1:
            raise candidate.fault(f"asked for one place, it answers with {len(one)}")
        scores = [place.score for place in candidate.contract.call(module.query, LABEL, "anywhere", None, 9)]
        if scores != sorted(scores, reverse=True):
            raise candidate.fault("a better place comes after a worse one")

    @check
    def refuses_looks_from_before(self, candidate: Candidate) -> None:
        """A look that is older than the last one is refused with a `MemoryFault`, and changes nothing."""
        module = self._after(candidate)
        before = module.last
        try:
            candidate.contract.call(module.observe, look(before - 1.0))
        except Exception as error:
            if not isinstance(error.__cause__, MemoryFault):
                raise
        else:
            raise candidate.fault("it takes a look that is older than the last one")
        if module.last != before or module.last != self.inputs()[-1].frame.t:
            raise candidate.fault(f"last is {module.last}, the newest look is of {self.inputs()[-1].frame.t} s")

    @check
    def forgets_what_it_is_told_to(self, candidate: Candidate) -> None:
        """What it forgot is not answered any more, and the rest is."""
        module, call = self._after(candidate), candidate.contract.call
        if call(module.forget, LABEL) < 1:
            raise candidate.fault(f"told to forget a {LABEL} that was seen four times, it forgets nothing")
        if call(module.query, LABEL, "anywhere"):
            raise candidate.fault(f"told to forget the {LABEL}, it still answers with it")
        if not call(module.query, OTHER):
            raise candidate.fault(f"told to forget the {LABEL}, it forgets the {OTHER}, too")
