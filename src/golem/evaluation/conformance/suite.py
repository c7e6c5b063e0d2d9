"""The checks that every contract shares, in terms of a sequence of inputs, and how a module is called with one."""

from __future__ import annotations

import copy
import dataclasses
import math
import statistics
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, cast

import numpy as np

from golem.errors import GolemError, ModuleFault
from golem.evaluation.conformance.base import Candidate, Inapplicable, check, gate
from golem.evaluation.conformance.impurities import CLOCK, FILE, RANDOM, THREAD, Impurity, impurities
from golem.runtime.contract_check import FAR, ContractCheck
from golem.runtime.nodes import MIN_RATE


def difference(a: Any, b: Any, where: str = "the answer") -> str:
    """Return where `a` and `b` differ, the first place that does; empty where they are equal bit for bit.

    Dataclasses, mappings, lists, tuples and arrays are compared by what they hold; two NaN are equal.
    """
    if type(a) is not type(b):
        return f"{where} is a {type(a).__name__}, then a {type(b).__name__}"
    if isinstance(a, np.ndarray):
        equal = a.shape == b.shape and a.dtype == b.dtype and a.tobytes() == b.tobytes()
        return "" if equal else f"{where} is {_short(a)}, then {_short(b)}"
    if dataclasses.is_dataclass(a):
        names = [field.name for field in dataclasses.fields(a)]
        return _first((getattr(a, name), getattr(b, name), f"{where}.{name}") for name in names)
    if isinstance(a, Mapping):
        left, right = cast("Mapping[Any, Any]", a), cast("Mapping[Any, Any]", b)
        if left.keys() != right.keys():
            return f"{where} has the keys {list(left)}, then {list(right)}"
        return _first((left[key], right[key], f"{where}[{key!r}]") for key in left)
    if isinstance(a, list | tuple):
        left, right = cast("list[Any]", a), cast("list[Any]", b)
        if len(left) != len(right):
            return f"{where} has {len(left)} members, then {len(right)}"
        return _first((x, y, f"{where}[{i}]") for i, (x, y) in enumerate(zip(left, right, strict=True)))
    if a == b or (a != a and b != b):
        return ""
    if type(a).__eq__ is object.__eq__:  # nothing tells two of them apart but where they are
        return difference(vars(a), vars(b), where) if hasattr(a, "__dict__") else ""
    return f"{where} is {a!r}, then {b!r}"


def _first(pairs: Any) -> str:
    return next(filter(None, (difference(*pair) for pair in pairs)), "")


def _short(values: Any) -> str:
    return np.array2string(values.ravel()[:4], precision=6, threshold=4) if values.size else "empty"


WARM_UP = 2
"""Calls whose time does not count: caches fill, libraries load."""


def check_fields(contract: ContractCheck, answer: Any, **shapes: tuple[int | None, ...]) -> None:
    """Check fields of an answer: finite arrays of `shapes`, finite numbers where a shape is empty; as `judge` does."""
    for name, shape in shapes.items():
        value = getattr(answer, name)
        contract.array(name, value, *shape) if shape else contract.number(name, value)


class Suite:
    """The suite of one slot. A subclass says how its modules are called; the checks here ask the rest.

    Attributes:
        contracts: protocols that a module must have the members of.
        forgets: whether `begin` makes a module start over; else it is made anew where that matters.
        refuses_nan: whether NaN among its inputs must not come out of it again.
        late: whether its modules declare a latency.
        rated: whether they declare a rate as well, and a call may take a period beside that latency.
        takes: time that it may take where they do not [s]; infinite where none is declared.
        dt: the period [s], once it was declared.
    """

    slot: str
    contracts: tuple[type[Any], ...]
    forgets = True
    refuses_nan = True
    late = rated = False
    takes = math.inf
    dt = 0.02

    def context(self) -> Mapping[str, object]:
        """Return what a stack hands to the constructor."""
        return {}

    def declared(self, contract: ContractCheck, module: Any) -> None:
        """Check the numbers that `module` declares; raises `ModuleFault`."""
        if self.rated:
            self.dt = 1.0 / contract.number("rate", module.rate, minimum=MIN_RATE)
        if self.late:
            contract.number("latency", module.latency, minimum=0.0)

    def allowed(self, module: Any) -> float:
        """Return the time that a call may take [s]; infinite where none is declared."""
        return (1.0 / module.rate if self.rated else self.takes) + (module.latency if self.late else 0.0)

    def inputs(self) -> Sequence[Any]:
        """Return ordinary inputs, in the order in which a robot would give them."""
        raise NotImplementedError

    def edges(self) -> Mapping[str, Sequence[Any]]:
        """Return inputs at the edges of what can happen, by what they are."""
        return {}

    def spoiled(self) -> Mapping[str, Any]:
        """Return inputs with a NaN in them, by where it is."""
        return {}

    def stale(self) -> Sequence[Any]:
        """Return inputs of which one came twice, or late."""
        ordinary = self.inputs()
        return [*ordinary[:3], ordinary[2], ordinary[2], *ordinary[3:6]]

    def begin(self, module: Any, first: Any) -> None:
        """Start `module`, whose first input will be `first`."""

    def call(self, module: Any, given: Any) -> Any:
        """Return what `module` says to one input."""
        raise NotImplementedError

    def judge(self, contract: ContractCheck, answer: Any) -> None:
        """Check kinds, shapes and finiteness of one answer; raises `ModuleFault`."""
        raise NotImplementedError

    def answers(self, candidate: Candidate, inputs: Sequence[Any], module: Any = None) -> Iterator[Any]:
        """Yield what a module, by default a new one, says to `inputs` from its start on."""
        contract = candidate.contract
        module = contract.call(candidate.make) if module is None else module
        contract.call(self.begin, module, inputs[0])
        for given in inputs:
            yield contract.call(self.call, module, given)

    def run(self, candidate: Candidate, inputs: Sequence[Any], module: Any = None) -> list[Any]:
        """Return copies of the answers, see `answers`."""
        return [copy.deepcopy(answer) for answer in self.answers(candidate, inputs, module)]

    def answers_of(self, candidate: Candidate) -> list[Any]:
        """Return what a new module says to the ordinary inputs."""
        return candidate.remember("answers", lambda: self.run(candidate, self.inputs()))

    @gate
    def can_be_made(self, candidate: Candidate) -> None:
        """The constructor works with the options given, and starts no thread."""
        threads = set(threading.enumerate())
        candidate.contract.call(candidate.make)
        if set(threading.enumerate()) - threads:
            raise candidate.fault("its constructor leaves a thread behind")

    @gate
    def has_every_member(self, candidate: Candidate) -> None:
        """It has the attributes and methods of its contract, and they take its arguments."""
        for kind in self.contracts:
            candidate.contract.satisfies(candidate.make(), kind)

    @gate
    def declares_sound_numbers(self, candidate: Candidate) -> None:
        """Rate, latency and whatever else it declares are numbers that it can have."""
        self.declared(candidate.contract, candidate.make())

    @gate
    def answers_soundly(self, candidate: Candidate) -> None:
        """Ordinary input is answered with the kinds and shapes of the contract, and finite numbers."""
        for answer in self.answers_of(candidate):
            self.judge(candidate.contract, answer)

    @check
    def repeats_itself(self, candidate: Candidate) -> None:
        """Two new instances answer the same input alike, bit for bit."""
        self._compare(candidate, self.run(candidate, self.inputs()), "a second instance answers otherwise")

    @check
    def starts_over(self, candidate: Candidate) -> None:
        """After a reset it answers as a new one does: whatever it remembered is forgotten."""
        if not self.forgets:
            raise Inapplicable("the contract has no reset")
        module = candidate.make()
        self.run(candidate, self.inputs(), module)
        again = self.run(candidate, self.inputs(), module)
        self._compare(candidate, again, "after a reset it answers otherwise")

    @check
    def reads_no_clock(self, candidate: Candidate) -> None:
        """It reads no clock and never sleeps: the time comes as an argument."""
        self._pure(candidate, CLOCK, "it reads a clock")

    @check
    def opens_no_file(self, candidate: Candidate) -> None:
        """Once made, it touches no file, socket or process."""
        self._pure(candidate, FILE, "it reaches outside")

    @check
    def starts_no_thread(self, candidate: Candidate) -> None:
        """Once made, it starts no thread and no process."""
        self._pure(candidate, THREAD, "it starts a thread or a process")

    @check
    def draws_no_shared_randomness(self, candidate: Candidate) -> None:
        """It draws from no generator that others share, and none that the system seeds."""
        self._pure(candidate, RANDOM, "it draws from what others share")

    @check
    def leaves_inputs_alone(self, candidate: Candidate) -> None:
        """It changes nothing in what it is given."""
        inputs = self.inputs()
        before = copy.deepcopy(inputs)
        for given, unchanged, _ in zip(inputs, before, self.answers(candidate, inputs), strict=True):
            found = difference(unchanged, given, "its input")
            if found:
                raise candidate.fault(f"{found}: it writes into what it is given")

    @check
    def leaves_answers_alone(self, candidate: Candidate) -> None:
        """It changes nothing in what it has returned: answers travel, and arrive later."""
        for answer, unchanged in [(one, copy.deepcopy(one)) for one in self.answers(candidate, self.inputs())]:
            found = difference(unchanged, answer)
            if found:
                raise candidate.fault(f"{found}: it writes into what it has returned")

    @check
    def keeps_its_time(self, candidate: Candidate) -> None:
        """A call takes no more CPU time than three times its period and the latency that it declares."""
        module, contract = candidate.make(), candidate.contract
        allowed = self.allowed(module)
        if math.isinf(allowed):
            raise Inapplicable("the contract declares no time")
        inputs = self.inputs()
        contract.call(self.begin, module, inputs[0])
        times: list[float] = []
        for given in inputs:
            started = time.thread_time()
            contract.call(self.call, module, given)
            times.append(time.thread_time() - started)
        taken = statistics.median(times[WARM_UP:])
        if taken > FAR * allowed:
            raise candidate.fault(
                f"a call takes {1e3 * taken:.3g} ms of CPU time; period and declared latency allow "
                f"{1e3 * allowed:.3g} ms"
            )

    @check
    def stops_nan(self, candidate: Candidate) -> None:
        """NaN in its input is refused with an error or answered with finite numbers; it never comes out again."""
        cases = self.spoiled()
        if not cases:
            raise Inapplicable("no input can hold one")
        for where, spoiled in cases.items():
            module = candidate.make()
            inputs = self.inputs()
            self.run(candidate, inputs[:3], module)
            for given in (spoiled, *inputs[3:5]):
                self._finite_or_refused(candidate, module, given, f"after NaN in {where} ")
            if self.forgets:
                again = self.run(candidate, inputs, module)
                self._compare(candidate, again, f"after NaN in {where} and a reset it answers otherwise")

    @check
    def bears_stale_input(self, candidate: Candidate) -> None:
        """Input that comes twice, or late, is answered soundly."""
        for answer in self.run(candidate, self.stale()):
            self._named(candidate, answer, "to input that came twice ")

    @check
    def bears_the_edges(self, candidate: Candidate) -> None:
        """Inputs at the edges of what can happen are answered soundly."""
        cases = self.edges()
        if not cases:
            raise Inapplicable("the contract has none")
        for what, inputs in cases.items():
            try:
                answers = self.run(candidate, inputs)
            except ModuleFault as fault:
                raise ModuleFault(fault.slot, fault.use, f"{what}: {fault.reason}", fault.trace) from fault
            for answer in answers:
                self._named(candidate, answer, f"{what}: ")

    def _compare(self, candidate: Candidate, answers: list[Any], what: str) -> None:
        for i, (first, second) in enumerate(zip(self.answers_of(candidate), answers, strict=True)):
            found = difference(first, second)
            if found:
                raise candidate.fault(f"{what}: at input {i}, {found}")

    def _pure(self, candidate: Candidate, kind: str, what: str) -> None:
        found: list[Impurity] = candidate.remember("impurities", lambda: self._impurities(candidate))
        for one in found:
            if one.kind == kind:
                raise candidate.fault(f"{what}: {one.what}{f' ({one.where})' if one.where else ''}")

    def _impurities(self, candidate: Candidate) -> list[Impurity]:
        module, inputs = candidate.make(), self.inputs()
        with impurities() as found:
            self.run(candidate, inputs, module)
        return found

    def _finite_or_refused(self, candidate: Candidate, module: Any, given: Any, when: str) -> None:
        try:
            answer = candidate.contract.call(self.call, module, given)
        except GolemError:
            return
        if self.refuses_nan:
            self._named(candidate, answer, when)

    def _named(self, candidate: Candidate, answer: Any, when: str) -> None:
        try:
            self.judge(candidate.contract, answer)
        except ModuleFault as fault:
            raise candidate.fault(f"{when}{fault.reason}") from fault
