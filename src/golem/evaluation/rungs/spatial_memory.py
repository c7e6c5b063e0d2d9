"""Rung `memory`: memories on the same walks through a room in which something was moved."""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from golem import registry
from golem.capabilities.memory.base import Memory, Place, When
from golem.evaluation.base import DONE, Case, Results, Rung, TrialOutcome, TrialSpec
from golem.evaluation.episodes.relocation import Rates, Relocation, Thing, relocation
from golem.provenance import stack_facts
from golem.runtime.contract_check import ContractCheck
from golem.stack import Stack

SLOT = "memory"
"""What the methods of this rung are."""
HIT = 1.0
"""Distance up to which an answer is right [m]: the same counter, the next ones being 2.4 m away [own]."""
ERRORS = Rates(missed=0.1, invented=0.03, confused=0.05, jitter=0.02)


@dataclass(frozen=True, slots=True)
class _Condition:
    """What an episode is made with."""

    rates: Rates
    twins: bool = False
    hidden: bool = False


CONDITIONS: dict[str, _Condition] = {
    "masks": _Condition(Rates()),
    "detector": _Condition(ERRORS),
    "drift": _Condition(Rates(drift=0.1, jitter=0.02)),
    "twins": _Condition(Rates(), twins=True),
    "hidden": _Condition(Rates(), hidden=True),
}
"""masks: every visible object is found. detector: misses, inventions and confusions. drift: poses of a walk are off by
10 cm. twins: there are two of what is moved. hidden: something stands before the old place."""


class MemoryRung(Rung[Any]):
    """Tell where things are and were, after two walks of eight views between which one of them was moved.

    Every memory sees the same looks. A trial succeeds when every question is answered rightly: where the target is
    and was, where what was not moved is, and of what is not there that it is not.
    """

    name = "memory"
    default_methods = ("top_down_map", "frame_index", "reranked", "object_map")
    default_n = 20
    profiles = ("ideal",)
    default_profile = "ideal"

    def methods(self) -> tuple[str, ...]:
        """Return the memories."""
        return registry.names(SLOT)

    def config(self, method: str, profile: str, overrides: Mapping[str, str]) -> Mapping[str, Any]:
        """Return what determines a trial besides its seed; see `Rung`."""
        _make(method)
        return stack_facts(Stack().with_choice(SLOT, method))

    def cases(self, results: Results) -> Sequence[Case]:
        """Return what the looks suffer."""
        return [{"condition": name} for name in CONDITIONS]

    def together(self, spec: TrialSpec) -> Hashable:
        """Return what trials share that see the same looks."""
        return spec.index, spec.case["condition"]

    def run(self, spec: TrialSpec, artefacts: Path | None) -> TrialOutcome:
        """Run one trial; see `Rung`."""
        return self.run_together([spec])[0]

    def run_together(self, specs: Sequence[TrialSpec]) -> Sequence[TrialOutcome]:
        """Render the looks once, and let memories see them."""
        condition = CONDITIONS[str(specs[0].case["condition"])]
        episode = relocation(specs[0].rng("memory"), condition.rates, condition.twins, condition.hidden)
        return [ask(spec.method, episode) for spec in specs]


def _make(method: str) -> Memory:
    choice = Stack().with_choice(SLOT, method).choice(SLOT)
    return registry.create(SLOT, choice.use, choice.options)


def ask(method: str, episode: Relocation) -> TrialOutcome:
    """Show an episode to a new memory, with questions after either walk, and judge the answers."""
    contract = ContractCheck(SLOT, method)
    memory = _make(method)
    looks, times = episode.observations, _Times()
    half = len(looks) // 2
    for look in looks[:half]:
        times.updates.append(_timed(lambda look=look: contract.call(memory.observe, look))[1])
    static = [times.ask(memory, contract, thing.kind) for thing in _kinds(episode.before)]
    for look in looks[half:]:
        times.updates.append(_timed(lambda look=look: contract.call(memory.observe, look))[1])
    now = times.ask(memory, contract, episode.target)
    bystander = times.ask(memory, contract, episode.before[1].kind)
    past = times.ask(memory, contract, episode.target, "history", limit=3)
    if not past:
        past = times.ask(memory, contract, episode.target, "anywhere", limit=3)
    absent = [times.ask(memory, contract, kind) for kind in episode.absent]
    memory.close()
    kinds = _kinds(episode.before)
    ranks = [_rank(answer, thing.kind, episode.before) for answer, thing in zip(static, kinds, strict=True)]
    twin = [thing for thing in episode.after[1:] if thing.kind == episode.target]
    present = [episode.after[0], *twin]
    first = now[0] if now and now[0].evidence != "moved" else None
    current = first is not None and any(_hits(first, thing) for thing in present)
    outdated = first is not None and _hits(first, episode.before[0])
    series = {
        "static_mrr": float(np.mean([0.0 if rank is None else 1.0 / rank for rank in ranks])),
        "current_top1": float(current),
        "outdated_top1": float(outdated),
        "unmoved_top1": float(bool(bystander) and _hits(bystander[0], episode.before[1])),
        "history_at3": float(any(_hits(place, episode.before[0]) for place in past)),
        "absent": float(np.mean([not answer for answer in absent])),
    }
    wrong = [name for name, value in series.items() if value != (0.0 if name == "outdated_top1" else 1.0)]
    if not wrong:
        return TrialOutcome(True, DONE, detail="every answer is right", series=series, costs=times.costs())
    detail = f"The {episode.target} was moved; wrong: {', '.join(wrong)}."
    return TrialOutcome(False, wrong[0], f"{SLOT}: {method}", detail, series=series, costs=times.costs())


class _Times:
    """CPU times of looks and questions [s]."""

    def __init__(self) -> None:
        self.updates: list[float] = []
        self.queries: list[float] = []

    def ask(
        self, memory: Memory, contract: ContractCheck, text: str, when: When = "now", limit: int = 5
    ) -> list[Place]:
        answer, cpu = _timed(lambda: list(contract.call(memory.query, text, when, None, limit)))
        self.queries.append(cpu)
        return answer

    def costs(self) -> dict[str, float]:
        return {"query": float(np.median(self.queries)), "update": float(np.median(self.updates))}


def _timed(work: Callable[[], Any]) -> tuple[Any, float]:
    start = time.thread_time_ns()
    answer = work()
    return answer, (time.thread_time_ns() - start) * 1e-9


def _kinds(things: Sequence[Thing]) -> list[Thing]:
    """Return one thing of each kind."""
    return list({thing.kind: thing for thing in reversed(things)}.values())


def _hits(place: Place, thing: Thing) -> bool:
    return bool(np.linalg.norm(place.position[:2] - thing.position[:2]) <= HIT)


def _rank(answer: Sequence[Place], kind: str, things: Sequence[Thing]) -> int | None:
    """Return the rank of the first place where there is one of that kind, from 1."""
    alike = [thing for thing in things if thing.kind == kind]
    right = (any(_hits(place, thing) for thing in alike) for place in answer)
    return next((rank for rank, hit in enumerate(right, 1) if hit), None)
