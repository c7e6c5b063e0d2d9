"""Rung `memory`: memories on the same walks through a room in which something was moved."""

from __future__ import annotations

import time
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from golem.capabilities.memory.base import Memory, Observation, Place, When
from golem.evaluation.base import DONE, Outcomes, Rung, TrialOutcome, TrialSpec
from golem.evaluation.episodes.relocation import Rates, Relocation, Setting, Thing, relocation
from golem.evaluation.harness.arguments import new_module
from golem.evaluation.metrics.statistics import mean_interval
from golem.evaluation.metrics.text_table import TextTable
from golem.evaluation.report.svg_figure import COLOUR
from golem.provenance import stack_facts
from golem.runtime.contract_check import ContractCheck
from golem.stack import Stack
from golem.true_runs import true_runs

HIT = 1.0
"""Distance up to which an answer is right [m]: the same counter, the next ones being 2.4 m away [own]."""
Belief = Literal["", "there", "gone"]
"""Of a place: nothing is remembered of it, something is taken to be there, something was there once."""


@dataclass(slots=True)
class ObjectTimeline:
    """One object at one place.

    Attributes:
        present: whether it stands there, at each look.
        beliefs: one after each look.
        told: whether "where is it now?" was answered rightly after each look; None where it does not stand there, or no
            look had shown it so far.
        seen: the looks in which the localizer found one of its kind there.
    """

    name: str
    thing: Thing
    present: tuple[bool, ...]
    beliefs: list[Belief] = field(default_factory=list["Belief"])
    told: list[bool | None] = field(default_factory=list["bool | None"])
    seen: list[int] = field(default_factory=list[int])


def hits(place: Place, thing: Thing) -> bool:
    """Return whether an answer names the place of a thing."""
    return bool(np.linalg.norm(place.position[:2] - thing.position[:2]) <= HIT)


def timeline(memory: Memory, episode: Relocation) -> list[ObjectTimeline]:
    """Show an episode to a new memory, which is asked after each look, and return a row per object."""
    old, always = episode.at_old, (True,) * len(episode.observations)
    rows = [
        ObjectTimeline(f"{episode.target}, old place", episode.before[0], old),
        ObjectTimeline(f"{episode.target}, new place", episode.after[0], tuple(not there for there in old)),
        *(
            ObjectTimeline(f"{thing.kind}{', another' if thing.kind == episode.target else ''}", thing, always)
            for thing in episode.before[1:]
        ),
    ]
    for k, look in enumerate(episode.observations):
        memory.observe(look)
        for row in rows:
            kind = row.thing.kind
            found = (f.position for f in look.objects if f.label == kind)
            if any(np.linalg.norm(at[:2] - row.thing.position[:2]) <= HIT for at in found):
                row.seen.append(k)
            known = [p for p in memory.query(kind, "anywhere", None, 20) if hits(p, row.thing)]
            there = any(p.evidence in ("seen", "similar") for p in known)
            row.beliefs.append("there" if there else "gone" if known else "")
            now = memory.query(kind, "now", None, 1) if row.present[k] and row.seen else None
            row.told.append(
                None if now is None else bool(now) and now[0].evidence != "moved" and hits(now[0], row.thing)
            )
    return rows


ROW = 0.29
"""Height of a row [inch]."""


def timeline_plot(episodes: Mapping[str, tuple[Sequence[ObjectTimeline], int]], figure: Any) -> None:
    """Draw one axis per episode, a row per object, looks from left to right."""
    rows = sum(len(found) for found, _ in episodes.values())
    figure.set_figheight(ROW * rows + 0.75 * len(episodes) + 0.7)
    ratios = [len(found) + 0.6 for found, _ in episodes.values()]
    every = figure.subplots(len(episodes), squeeze=False, gridspec_kw={"height_ratios": ratios})[:, 0]
    for axes, (title, (found, split)) in zip(every, episodes.items(), strict=True):
        _draw(axes, found, split)
        axes.set_title(title)
    every[-1].set_xlabel("look")
    marks = [
        every[-1].barh(0, 0, color=COLOUR["track"], label="it stands there"),
        every[-1].barh(0, 0, color=COLOUR["m0"], label="remembered as there"),
        every[-1].barh(0, 0, color=COLOUR["m0"], alpha=0.3, label="remembered as gone"),
        every[-1].plot([], [], "|", color=COLOUR["ink"], label="found in the image")[0],
        every[-1].plot([], [], "o", ms=4, color=COLOUR["won"], label="told where it is")[0],
        every[-1].plot([], [], "x", ms=5, color=COLOUR["lost"], label="told wrongly")[0],
    ]
    figure.legend(handles=marks, loc="outside lower center", ncols=3, labelcolor=COLOUR["ink"], fontsize=9)


def _draw(axes: Any, rows: Sequence[ObjectTimeline], split: int) -> None:
    looks = len(rows[0].beliefs)
    for y, row in enumerate(rows):
        axes.broken_barh(_spans(row.present), (y - 0.4, 0.8), color=COLOUR["track"], linewidth=0)
        for belief, alpha in (("there", 1.0), ("gone", 0.3)):
            held = _spans([one == belief for one in row.beliefs])
            axes.broken_barh(held, (y + 0.03, 0.3), color=COLOUR["m0"], alpha=alpha, linewidth=0)
        axes.plot([k + 0.5 for k in row.seen], [y + 0.18] * len(row.seen), "|", ms=8, color=COLOUR["ink"])
        for right, mark, colour in ((True, "o", "won"), (False, "x", "lost")):
            at = [k + 0.5 for k, told in enumerate(row.told) if told is right]
            axes.plot(at, [y - 0.2] * len(at), mark, ms=4 if right else 5, color=COLOUR[colour])
    axes.axvline(split, color=COLOUR["muted"], lw=1, ls="--")
    axes.set(xlim=(0, looks), ylim=(len(rows) - 0.45, -0.55))
    axes.set_yticks(range(len(rows)), [row.name for row in rows])
    axes.grid(axis="y", visible=False)


def _spans(flags: ArrayLike) -> list[tuple[int, int]]:
    """Return first look and length of each run of true `flags` (n,): bars of one look each show seams."""
    return [(first, end - first) for first, end in true_runs(flags).tolist()]


SLOT = "memory"
"""What the methods of this rung are."""
METRICS = {
    "static_mrr": "static MRR",
    "current_top1": "now, first answer",
    "outdated_top1": "out of date",
    "history_at3": "old place in three",
    "absent": "absent",
}
"""What is measured of each episode -> the head of its column."""
PAPER = (
    ("VLMaps", "77.5 [60.9, 94.1]", "20.0 [2.0, 38.0]", "53.5 [31.6, 75.3]", "45.0 [35.2, 54.8]"),
    ("SigLIP+FAISS", "67.5 [50.2, 84.8]", "35.7 [15.7, 55.8]", "41.4 [19.7, 63.1]", "42.5 [26.2, 58.8]"),
    ("SigLIP+FAISS+rerank", "100.0", "95.4 [92.2, 98.6]", "0.0", "97.5 [92.6, 100]"),
)
"""What the paper publishes, from RoboCasa; of absent things it gives no figure."""
SHOWN = 4
"""Conditions whose timelines are drawn."""
ERRORS = Rates(missed=0.1, invented=0.03, confused=0.05, jitter=0.02)


CONDITIONS: dict[str, Setting] = {
    "masks": Setting(),
    "detector": Setting(ERRORS),
    "clusters": Setting(clusters=True),
    "drift": Setting(Rates(drift=0.1, jitter=0.02)),
    "twins": Setting(twins=True),
    "hidden": Setting(hidden=True),
    "dusk": Setting(clusters=True, dusk=True),
    "distractors": Setting(ERRORS, distractors=1000),
    "day": Setting(ERRORS, walks=24),
}
"""masks: every visible object is found. detector: misses, inventions and confusions. clusters: the shipped localizer of
tableware looks at the images. drift: poses of a walk are off by 10 cm. twins: there are two of what is moved. hidden:
something stands before the old place. dusk: clusters, in bad light after the move. distractors: detector, and 1,000
things of 40 other kinds were seen in other rooms before. day: detector, 24 walks an hour apart; what is moved changes
its place every six."""


class MemoryRung(Rung[Any]):
    """Tell where things are and were, after two walks of eight views between which one of them was moved.

    Every memory sees the same looks. A trial succeeds when every question is answered rightly: where the target is
    and was, where what was not moved is, and of what is not there that it is not.
    """

    name = "memory"
    varied = {"condition": tuple(CONDITIONS)}
    default_methods = ("top_down_map", "frame_index", "reranked", "object_map")
    slot = SLOT
    default_n = 20
    profiles = ("ideal",)
    default_profile = "ideal"

    def config(self, method: str, profile: str, overrides: Mapping[str, str]) -> Mapping[str, Any]:
        return stack_facts(Stack(profile=profile).with_choice(SLOT, method))

    def together(self, spec: TrialSpec) -> Hashable:
        return spec.index, spec.case["condition"]

    def run_together(self, specs: Sequence[TrialSpec]) -> Sequence[TrialOutcome]:
        condition = CONDITIONS[str(specs[0].case["condition"])]
        episode = relocation(specs[0].rng("memory"), condition)
        return [ask(spec.method, episode) for spec in specs]

    def tables(self, outcomes: Outcomes) -> Sequence[TextTable]:
        rows, n = list[tuple[str, ...]](), 0
        for condition in CONDITIONS:
            for method, trials in outcomes.items():
                mine = [o.series for spec, o in trials if spec.case["condition"] == condition and o.series]
                if mine:
                    n = max(n, len(mine))
                    rows.append((condition, method, *(_share([one[m] for one in mine]) for m in METRICS)))
        note = (
            f"{n} episodes each; in brackets the 95 % interval over episodes: Wilson's where one says yes or no, else "
            "Student's t. The paper's are of another room, other queries and other networks."
        )
        paper = tuple(("the paper", *row, "-") for row in PAPER)
        heads = ("condition", "memory", *METRICS.values())
        return (TextTable("Answers [%]", heads, (*rows, *paper), note),)

    def plot(self, outcomes: Outcomes, figure: Any) -> str | None:
        """Draw what the last memory believed of each object in some trials, lost ones first; see `Rung`."""
        method, trials = list(outcomes.items())[-1]
        order = sorted(trials, key=lambda pair: (pair[1].success, pair[0].index))
        chosen: dict[str, TrialSpec] = {}
        for spec, _ in order:
            if len(chosen) < SHOWN:
                chosen.setdefault(str(spec.case["condition"]), spec)
        episodes: dict[str, tuple[list[ObjectTimeline], int]] = {}
        for condition, spec in chosen.items():
            episode = relocation(spec.rng("memory"), CONDITIONS[condition])
            memory: Memory = new_module(SLOT, method)
            rows = timeline(memory, episode)
            memory.close()
            episodes[f"trial {spec.index}, {condition}"] = rows, episode.split
        timeline_plot(episodes, figure)
        return f"What {method} believed of each object; the line is when one was moved"


def _share(values: Sequence[float]) -> str:
    interval = mean_interval(values, 0.0, 1.0)
    bounds = "" if interval is None else f" {interval.text(100.0)}"
    return f"{100 * float(np.mean(values)):.1f}{bounds}"


def ask(method: str, episode: Relocation) -> TrialOutcome:
    """Show an episode to a new memory, with questions after either walk, and judge the answers."""
    memory = _Watched(method)
    for look in episode.observations[: episode.split]:
        memory.observe(look)
    static = [memory.query(thing.kind) for thing in _kinds(episode.before)]
    for look in episode.observations[episode.split :]:
        memory.observe(look)
    now, bystander = memory.query(episode.target), memory.query(episode.before[1].kind)
    past = memory.query(episode.target, "history", 3) or memory.query(episode.target, "anywhere", 3)
    absent = [memory.query(kind) for kind in episode.absent]
    memory.memory.close()
    kinds = _kinds(episode.before)
    ranks = [_rank(answer, thing.kind, episode.before) for answer, thing in zip(static, kinds, strict=True)]
    twin = [thing for thing in episode.after[1:] if thing.kind == episode.target]
    present = [episode.after[0], *twin]
    first = now[0] if now and now[0].evidence != "moved" else None
    current = first is not None and any(hits(first, thing) for thing in present)
    outdated = first is not None and hits(first, episode.before[0])
    series = {
        "static_mrr": float(np.mean([0.0 if rank is None else 1.0 / rank for rank in ranks])),
        "current_top1": float(current),
        "outdated_top1": float(outdated),
        "unmoved_top1": float(bool(bystander) and hits(bystander[0], episode.before[1])),
        "history_at3": float(any(hits(place, episode.before[0]) for place in past)),
        "absent": float(np.mean([not answer for answer in absent])),
    }
    wrong = [name for name, value in series.items() if value != (0.0 if name == "outdated_top1" else 1.0)]
    costs = {"query": float(np.median(memory.queries)), "update": float(np.median(memory.updates))}
    if not wrong:
        return TrialOutcome(True, DONE, detail="every answer is right", series=series, costs=costs)
    detail = f"The {episode.target} was moved; wrong: {', '.join(wrong)}."
    return TrialOutcome(False, wrong[0], f"{SLOT}: {method}", detail, series=series, costs=costs)


class _Watched:
    """A new memory whose contract is watched, and the CPU time [s] of each look and each query."""

    def __init__(self, method: str) -> None:
        self.memory: Memory = new_module(SLOT, method)
        self._contract = ContractCheck(SLOT, method)
        self.updates, self.queries = list[float](), list[float]()

    def observe(self, look: Observation) -> None:
        start = time.thread_time()
        self._contract.call(self.memory.observe, look)
        self.updates.append(time.thread_time() - start)

    def query(self, text: str, when: When = "now", limit: int = 5) -> list[Place]:
        start = time.thread_time()
        answer = list(self._contract.call(self.memory.query, text, when, None, limit))
        self.queries.append(time.thread_time() - start)
        return answer


def _kinds(things: Sequence[Thing]) -> list[Thing]:
    return list({thing.kind: thing for thing in reversed(things)}.values())


def _rank(answer: Sequence[Place], kind: str, things: Sequence[Thing]) -> int | None:
    """Return the rank of the first place where there is one of that kind, from 1."""
    alike = [thing for thing in things if thing.kind == kind]
    right = (any(hits(place, thing) for thing in alike) for place in answer)
    return next((rank for rank, hit in enumerate(right, 1) if hit), None)
