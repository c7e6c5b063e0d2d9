"""The measuring half of `golem bench loop`: one process that answers requests on its standard input with JSON.

It imports only what golem has long had, so that a checkout of before runs it, too:
`PYTHONPATH=BEFORE/src python -P loop_measure.py stand`, then lines such as `totals 10 29`.
"""

from __future__ import annotations

import importlib
import inspect
import json
import os
import resource
import statistics
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, nullcontext, suppress
from dataclasses import dataclass
from typing import Any, Literal

TICK, SPAN = 0.002, 0.1
"""A tick of the clock, and the time between two looks at it [s]."""
Mode = Literal["totals", "nodes", "calls"]
"""What a trial is run for; each disturbs the others."""
IMPORTS = ("numpy", "scipy.spatial", "numba", "mujoco", "pinocchio", "onnxruntime", "golem.runtime.lockstep")
"""What a robot in lock-step needs, in the order in which it is imported."""


@dataclass(frozen=True, slots=True)
class LoopCase:
    """A stack at its work.

    Attributes:
        rung, method: the trial that is run; without a rung a robot that is asked nothing, on the open floor.
        warm: robot time before it is measured [s]: the robot has begun what it is there for.
        case: the condition of the trial.
    """

    rung: str
    method: str
    warm: float
    case: tuple[tuple[str, str], ...] = ()


CASES = {
    "stand": LoopCase("", "almi", 4.0),
    "push": LoopCase("push", "almi", 2.0),
    "navigate-line": LoopCase("navigate-line", "almi", 5.0),
    "tether": LoopCase("tether", "visual_servo", 1.0),
    "pick": LoopCase("stand", "visual_servo", 4.0),
    "counter": LoopCase("counter-tether", "antipodal", 1.0),
    "fridge": LoopCase("fridge-stand", "antipodal", 4.0),
    "navigate": LoopCase("navigate", "costmap_astar", 8.0, (("map", "none"),)),
}
"""What can be measured, by name."""


class Measured(BaseException):
    """Ends a trial that has been measured; no module may catch it."""


class Probe:
    """The last node of a trial: looks at the clocks every `SPAN` of robot time, and runs the physics alone in turn.

    Attributes:
        stack, physics: CPU time of each span of the whole process, and of a plain `mj_step` loop over the same time,
            from the same state, under the torques held [s].
        calls: Python and C functions called a tick, span by span.
        spent: thread CPU time by class of node since the warming [ns].
    """

    period = SPAN

    def __init__(self, mode: Mode, warm: float, seconds: float) -> None:
        """Look from robot time `warm` on, for `seconds` [s]."""
        self._mode, self._warm, self._end = mode, warm, warm + seconds
        self._robot: Any = None
        self._since: float | None = None
        self._count = 0
        self.stack: list[float] = []
        self.physics: list[float] = []
        self.calls: list[float] = []
        self.spent: Counter[str] = Counter()

    def begin(self, running: Any, robot: Any) -> None:
        """Join a trial; an `Onlooker`."""
        import mujoco

        self._robot, self._copy = robot, mujoco.MjData(robot.data.model)
        running.executor.add(self)

    def step(self, t: float) -> None:
        """Close a span and open the next; see `Node`."""
        sys.setprofile(None)
        now = time.process_time()
        if t < self._warm - 1e-6:
            return
        if self._since is None:
            self.spent.clear()
        else:
            self.stack.append(now - self._since)
            self.calls.append(self._count * TICK / SPAN)
            if self._mode == "totals":
                self.physics.append(self._alone())
        if t > self._end - 1e-6:
            raise Measured
        self._count = 0
        self._since = time.process_time()
        if self._mode == "calls":
            sys.setprofile(self._called)

    def _called(self, frame: object, event: str, argument: object) -> None:
        if event == "call" or event == "c_call":
            self._count += 1

    def _alone(self) -> float:
        """Return the CPU time of the physics alone over a span [s], at the time step of now."""
        import mujoco

        model = self._robot.data.model
        mujoco.mj_copyData(self._copy, model, self._robot.data)
        start = time.thread_time()
        for _ in range(round(SPAN / model.opt.timestep)):
            mujoco.mj_step(model, self._copy)
        return time.thread_time() - start


@contextmanager
def timed_nodes(spent: Counter[str]) -> Iterator[None]:
    """Count the thread CPU time of every node, and of the chain, of the executors that are made meanwhile [ns]."""
    from golem.runtime.executor import Executor

    original = Executor.__init__

    def start(self: Executor, bus: Any, nodes: Any, *rest: Any, **named: Any) -> None:
        for node in nodes:
            node.step = _timed(type(node).__name__, node.step, spent)
        for chain in (*rest, *named.values()):  # one with a chain runs some of the nodes in it
            for method in ("run", "run_ticks"):
                if hasattr(chain, method):
                    setattr(chain, method, _timed("the chain", getattr(chain, method), spent))
        original(self, bus, nodes, *rest, **named)

    Executor.__init__ = start
    try:
        yield
    finally:
        Executor.__init__ = original


def _timed(name: str, step: Callable[..., Any], spent: Counter[str]) -> Callable[..., Any]:
    def timed(*arguments: Any) -> Any:
        start = time.thread_time_ns()
        try:
            return step(*arguments)
        finally:
            spent[name] += time.thread_time_ns() - start

    return timed


def measure(name: str, mode: Mode, seconds: float, seed: int) -> dict[str, Any]:
    """Run a trial of `CASES` until `seconds` of it are measured, or until it ends.

    Returns:
        seconds: robot time that was measured [s].
        cpu: CPU time of it [s]; physics: of the plain loop, with the mode `totals`.
        nodes: class -> us a tick, with `nodes`. calls: functions called a tick, with `calls`.
    """
    case = CASES[name]
    probe = Probe(mode, case.warm, seconds)
    with suppress(Measured), timed_nodes(probe.spent) if mode == "nodes" else nullcontext():
        _trial(case, seed, probe)
    sys.setprofile(None)  # for a trial that ended by itself
    spans = len(probe.stack)
    if not spans:
        raise RuntimeError(f"the trial of {name} ended before its {case.warm:g} s of warming.")
    ticks = spans * SPAN / TICK
    return {
        "seconds": round(spans * SPAN, 6),
        "cpu": sum(probe.stack),
        "physics": sum(probe.physics),
        "nodes": {node: 1e-3 * ns / ticks for node, ns in probe.spent.most_common()},
        "calls": statistics.median(probe.calls),
    }


def _trial(case: LoopCase, seed: int, probe: Probe) -> None:
    from golem.evaluation.base import RUNGS, TrialSpec, make_rung
    from golem.evaluation.episodes.episode import legs_stack
    from golem.runtime.lockstep import build

    if case.rung:
        rung = make_rung(RUNGS[case.rung])
        rung.onlooker = probe.begin
        rung.run(TrialSpec(case.rung, case.method, "field", seed, 0, case=dict(case.case)), None)
        return
    running, robot = build(legs_stack(case.method, "field"), seed)
    with closing(robot):
        probe.begin(running, robot)
        run: Callable[..., None] = running.executor.run
        # Where an executor can be told so, nobody has to be asked after every tick.
        run(1e9, **({"due": lambda: 1e9} if "due" in inspect.signature(run).parameters else {}))


def start_up() -> dict[str, float]:
    """Return the CPU time of each step until a robot runs and has seen its first image [s]; for a fresh process."""
    steps: dict[str, float] = {}

    def done(step: str) -> None:
        steps[step] = time.process_time() - sum(steps.values())

    done("interpreter")
    for module in IMPORTS:
        importlib.import_module(module)
        done(f"import {module}")
    from golem.runtime.lockstep import LockstepRunner, build_robot
    from golem.stack import load_stack

    stack = load_stack("stand", profile="field")
    robot = build_robot(stack, 0)
    done("robot")
    LockstepRunner(stack, robot)
    done("stack")
    robot.capture("head")
    done("first image")
    robot.close()
    return steps


def plain_loop(seconds: float) -> dict[str, float]:
    """Return robot seconds per CPU second of a loop of unitree_mujoco's kind: NumPy PD and `mj_step`, our model."""
    import mujoco
    import numpy as np

    from golem.evaluation.episodes.episode import legs_stack
    from golem.runtime.lockstep import build_robot, start_posture

    robot = build_robot(legs_stack("almi", "field"), 0)
    model, data, q = robot.data.model, robot.data, start_posture(on_ground=True)
    motors = [model.actuator(i).trnid[0] for i in range(len(q))]
    at, rate = model.jnt_qposadr[motors], model.jnt_dofadr[motors]
    start = time.thread_time()
    for _ in range(round(seconds / TICK)):
        tau = 3000.0 * (q - data.qpos[at]) - 40.0 * data.qvel[rate]
        data.ctrl[: len(q)] = np.clip(tau, -300.0, 300.0)
        mujoco.mj_step(model, data)
    spent = time.thread_time() - start
    robot.close()
    return {"rate": seconds / spent}


def warp_loop(steps: int) -> dict[str, Any]:
    """Return mjlab's robot seconds per second (MuJoCo Warp, one robot of ours), and its device. Raises ImportError."""
    from golem.evaluation.episodes.episode import legs_stack
    from golem.runtime.lockstep import build_robot

    mujoco_warp, warp = (importlib.import_module(name) for name in ("mujoco_warp", "warp"))
    robot = build_robot(legs_stack("almi", "field"), 0)
    model = mujoco_warp.put_model(robot.data.model)
    data = mujoco_warp.put_data(robot.data.model, robot.data, nworld=1)
    mujoco_warp.step(model, data)  # compiles
    warp.synchronize()
    start = time.perf_counter()
    for _ in range(steps):
        mujoco_warp.step(model, data)
    warp.synchronize()
    return {"rate": steps * TICK / (time.perf_counter() - start), "device": str(warp.get_device())}


def main(name: str) -> None:
    """Answer what comes in: `start`, `plain SECONDS`, `warp STEPS`, `rss` or `MODE SECONDS SEED`."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # what libraries print is no answer
    for line in sys.stdin:
        word, *numbers = line.split()
        if word == "start":
            answer: Any = start_up()
        elif word == "plain":
            answer = plain_loop(float(numbers[0]))
        elif word == "warp":
            answer = warp_loop(int(numbers[0]))
        elif word == "rss":
            unit = 2**20 if sys.platform == "darwin" else 2**10
            answer = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit
        else:
            answer = measure(name, word, float(numbers[0]), int(numbers[1]))  # type: ignore[arg-type]
        print(json.dumps(answer), file=answers, flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
