"""`golem bench loop`: robot seconds per CPU second of whole stacks, beside their physics alone.

Every figure comes from a process of its own (`loop_measure`), so that another checkout can be asked the same, in turn.
"""

from __future__ import annotations

import importlib.util
import json
import os
import statistics
import subprocess
import sys
from collections.abc import Iterable, Sequence
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

from rich.console import Console
from rich.table import Table

from golem.errors import ConfigError, GolemError, check_known
from golem.evaluation.speed import loop_measure
from golem.evaluation.speed.loop_measure import CASES

HERE, THERE = "this", "other"
"""What two checkouts are called."""
PLAIN = 4.0
"""Robot time of the loop without a stack [s]."""
WARP_STEPS = 200
"""Physics steps of mjlab's."""


@dataclass(frozen=True)
class LoopBenchConfig:
    """Time whole stacks in lock-step: robot seconds per CPU second, us a tick by node, function calls a tick."""

    stack: tuple[str, ...] = ("stand", "push", "navigate-line", "tether", "counter", "fridge", "navigate")
    """What to time: stand (asked nothing), push, navigate-line, tether, pick, counter, fridge, navigate."""
    seconds: float = 10.0
    """Robot time that is measured after warming, at most what the trial lasts [s]."""
    repetitions: int = 5
    """Times that it is measured."""
    seed: int = 29
    """Seed of the trials."""
    against: Path | None = None
    """Another checkout, that of before for example: both in turn, and their ratio."""
    json: bool = False
    """Print the figures as a last line of JSON."""


def run_loop_bench(config: LoopBenchConfig) -> dict[str, Any]:
    """Measure and print; return what is printed, by stack and checkout.

    Raises:
        ConfigError: a number or a name is wrong, or there is no such checkout.
        GolemError: a trial could not be measured.
    """
    check_known("stack", CASES, *config.stack)
    if config.seconds < loop_measure.SPAN or config.repetitions < 1 or config.seed < 0:
        raise ConfigError("--seconds must be 0.1 or more, --repetitions 1 or more, --seed 0 or more.")
    trees = {HERE: Path(loop_measure.__file__).parents[3]}
    if config.against is not None:
        trees[THERE] = config.against / "src"
        if not (trees[THERE] / "golem").is_dir():
            raise ConfigError(f"--against {config.against} is no checkout: it has no src/golem.")
    console = Console()
    found = {name: _measured(name, trees, config) for name in config.stack}
    first = found[config.stack[0]][HERE]
    console.print(_rates(found))
    if config.against is not None:
        console.print(_ratios(found))
    for name, by_tree in found.items():
        console.print(_nodes(name, by_tree))
    console.print(_start(first["start"]))
    console.print(f"Without a stack, NumPy PD and mj_step in Python: {first['plain']:.3g} robot s / CPU s.")
    console.print(_mjlab(trees[HERE]))
    if config.json:
        print(json.dumps(found))
    return found


class Worker(AbstractContextManager["Worker", None]):
    """A process that measures one stack of one checkout; closed when its block is left."""

    def __init__(self, source: Path, name: str) -> None:
        """Start it with the package in `source`."""
        self._name = name
        paths = [str(source.resolve()), *filter(None, [os.environ.get("PYTHONPATH")])]
        self._errors = TemporaryFile("w+")
        command, pipe = [sys.executable, "-P", loop_measure.__file__, name], subprocess.PIPE
        env = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
        self._process = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=self._errors, text=True, env=env)

    def ask(self, *words: object) -> Any:
        """Return its answer to a request; see `loop_measure.main`. Raises GolemError: it ended instead."""
        process = self._process
        assert process.stdin is not None and process.stdout is not None
        try:
            print(*words, file=process.stdin, flush=True)
            answer = process.stdout.readline()
        except BrokenPipeError:
            answer = ""
        if not answer:
            process.wait()
            self._errors.seek(0)
            said = self._errors.read().strip().splitlines()[-1:]
            raise GolemError(f"The stack {self._name} could not be measured: {''.join(said) or 'it ended.'}")
        return json.loads(answer)

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.communicate()
        self._errors.close()


def _measured(name: str, trees: dict[str, Path], config: LoopBenchConfig) -> dict[str, dict[str, Any]]:
    """Return the figures of one stack by checkout; what is repeated is repeated in turn."""
    seconds, seed = config.seconds, config.seed
    with ExitStack() as stack:
        workers = {tree: stack.enter_context(Worker(source, name)) for tree, source in trees.items()}
        found: dict[str, dict[str, Any]] = {}
        for tree, worker in workers.items():
            # What is not timed to the percent comes first: kernels are loaded meanwhile.
            found[tree] = {"start": worker.ask("start"), "plain": worker.ask("plain", PLAIN)["rate"]}
            found[tree]["calls"] = worker.ask("calls", min(seconds, 2.0), seed)["calls"]
            found[tree] |= {"by_node": worker.ask("nodes", seconds, seed), "rates": [], "shares": []}
        for _ in range(config.repetitions):
            for tree, worker in workers.items():
                total = worker.ask("totals", seconds, seed)
                found[tree]["seconds"] = total["seconds"]
                found[tree]["rates"].append(total["seconds"] / total["cpu"])
                found[tree]["shares"].append(total["physics"] / total["cpu"])
        for tree, worker in workers.items():
            found[tree]["rss"] = worker.ask("rss")
    return found


def _rates(found: dict[str, dict[str, dict[str, Any]]]) -> Table:
    heads = ("stack", "robot s", "robot s / CPU s", "of the physics alone", "calls a tick", "peak RSS MB")
    table = Table(*heads, title="Whole stacks in lock-step, profile field: median (range)")
    for name, by_tree in found.items():
        for tree, f in by_tree.items():
            label = name if len(by_tree) == 1 else f"{name}, {tree}"
            share = _spread((100.0 * share for share in f["shares"]), " %")
            calls, rss = f"{f['calls']:.0f}", f"{f['rss']:.0f}"
            table.add_row(label, f"{f['seconds']:g}", _spread(f["rates"]), share, calls, rss)
    return table


def _ratios(found: dict[str, dict[str, dict[str, Any]]]) -> Table:
    table = Table("stack", "robot s / CPU s", "calls a tick", title="This checkout over the other, in turn")
    for name, by_tree in found.items():
        one, other = by_tree[HERE], by_tree[THERE]
        pairs = [a / b for a, b in zip(one["rates"], other["rates"], strict=True)]
        table.add_row(name, _spread(pairs), f"{one['calls'] / other['calls']:.3g}")
    return table


def _nodes(name: str, by_tree: dict[str, dict[str, Any]]) -> Table:
    """Return the table of thread CPU time by node, in place; what no node's `step` took is the last row."""
    table = Table("node", *(f"us a tick, {tree}" for tree in by_tree), title=f"{name}: by node, with the timers")
    rows = {tree: dict(f["by_node"]["nodes"]) for tree, f in by_tree.items()}
    for tree, f in by_tree.items():
        whole = 1e6 * loop_measure.TICK * f["by_node"]["cpu"] / f["by_node"]["seconds"]
        rows[tree]["all else: clock, bus, judges, other threads"] = whole - sum(rows[tree].values())
    for node in dict.fromkeys(node for row in rows.values() for node in row):
        table.add_row(node, *(f"{row[node]:.1f}" if node in row else "-" for row in rows.values()))
    return table


def _start(steps: dict[str, float]) -> Table:
    table = Table("step", "CPU s", title="Start-up of a process")
    for step, spent in (*steps.items(), ("all", sum(steps.values()))):
        table.add_row(step, f"{spent:.2f}")
    return table


def _spread(values: Iterable[float], unit: str = "") -> str:
    these: Sequence[float] = list(values)
    return f"{statistics.median(these):.3g}{unit} ({min(these):.3g} - {max(these):.3g})"


def _mjlab(source: Path) -> str:
    """Return how fast mjlab's physics is with one robot, or why that is left out."""
    missing = [name for name in ("mujoco_warp", "warp") if importlib.util.find_spec(name) is None]
    if missing:
        return f"mjlab's physics is left out: {missing[0]} is not installed."
    with Worker(source, "mjlab") as worker:
        warp = worker.ask("warp", WARP_STEPS)
    return f"mjlab's physics, one robot, on {warp['device']}: {warp['rate']:.3g} robot s / s of the wall clock."
