"""A rung without a robot: outcomes are drawn from the trial's noise streams."""

from __future__ import annotations

import ctypes
import io
import os
import signal
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from PIL import Image, ImageDraw

from golem.errors import ConfigError, MissingExtra, ModuleFault
from golem.evaluation.base import Case, Results, Rung, TrialOutcome, TrialSpec
from golem.runtime.contract_check import ContractCheck

RATES = {"poor": 0.3, "good": 0.9, "slow": 0.9}
STAGES = (
    ("detect", "localization: onnx"),
    ("reach", "upper_body: diff_ik"),
    ("extract", "grasp: straight"),
    ("drop", None),
)


@dataclass(frozen=True)
class FakeOptions:
    """What the fake rung can be told."""

    skill: float = 1.0
    """Factor of every method's rate."""


class Fake(Rung[FakeOptions]):
    """Draw whether a trial succeeds; the method `faulty` breaks its contract, `slow` takes a tenth of a second."""

    name = "fake"
    Options = FakeOptions
    profiles = ("ideal", "field")
    default_methods = ("poor", "good")

    def methods(self) -> tuple[str, ...]:
        return ("poor", "good", "slow", "faulty", "keyless", "buggy", "threads", "sure", *ENDINGS)

    def config(self, method: str, profile: str, overrides: Mapping[str, str]) -> Mapping[str, Any]:
        for slot in overrides:
            if slot != "upper_body":
                raise ConfigError(f"Unknown slot '{slot}'; valid: upper_body.")
        return {"stack": {"upper_body": overrides.get("upper_body", "diff_ik")}, "rate": RATES.get(method)}

    def run(self, spec: TrialSpec, artefacts: Path | None) -> TrialOutcome:
        if spec.method in ENDINGS and spec.index == 1:
            # As a stack does it: a module's code runs within its contract's call.
            ContractCheck("lower_body", "my_legs.py:Mine").call(ENDINGS[spec.method])
        match spec.method:
            case "faulty" if spec.index % 2:
                raise ModuleFault("upper_body", "my_ik.py:MyIk", "joint targets have shape (14,), not (15,)")
            case "keyless":
                raise MissingExtra("ompl", "plan")
            case "buggy":
                raise KeyError("no such body")
            case "threads":
                return TrialOutcome(True, "done", series={"threads": float(os.environ["OMP_NUM_THREADS"])})
            case method if method in ("sure", *ENDINGS):
                return TrialOutcome(True, "done")
            case "slow":
                time.sleep(0.1)
        rng = spec.rng("scene")
        difficulty = rng.random()
        seconds = rng.normal(12, 2) if spec.method == "good" else rng.normal(6, 1)
        if difficulty < self.options.skill * RATES.get(spec.method, 1.0):
            times = {"detect_to_grasp": seconds, "total": seconds + 14 + rng.random()}
            return TrialOutcome(True, "done", timings=times, series={"difficulty": difficulty}, picture=picture(spec))
        stage, module = STAGES[rng.choice(4, p=(0.15, 0.55, 0.2, 0.1))]
        times = {} if stage == "detect" else {"detect_to_grasp": seconds}
        detail = "the palm closed 31 mm beside the screw <head>"
        return TrialOutcome(False, stage, module, detail, times, {"difficulty": difficulty}, picture(spec))


def picture(spec: TrialSpec) -> bytes:
    image = Image.new("RGB", (320, 180), (52, 60, 72))
    ImageDraw.Draw(image).ellipse((140 + spec.index, 70, 180 + spec.index, 110), fill=(200, 160, 60))
    stream = io.BytesIO()
    image.save(stream, "PNG")
    return stream.getvalue()


def leave() -> None:
    raise SystemExit(3)


def interrupt() -> None:
    raise KeyboardInterrupt


def endless() -> None:
    while True:
        pass


def stuck() -> None:
    """Hang in native code that never lets Python run again, whatever signal comes."""
    c, mutex = ctypes.PyDLL(None), ctypes.create_string_buffer(64)  # zeros: one that is free
    for _ in range(2):
        c.pthread_mutex_lock(mutex)


def orphan() -> None:
    """Hang with a child process."""
    os.posix_spawn("/bin/sleep", ["sleep", "77.125"], os.environ)
    time.sleep(60.0)


def unlucky() -> None:
    """Be killed the first time, as by a machine that runs out of memory once."""
    mark = Path(os.environ["GOLEM_UNLUCKY"])
    if not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)


ENDINGS: dict[str, Callable[[], object]] = {
    "leaves": leave,
    "interrupts": interrupt,
    "deadly": lambda: os._exit(3),
    "segfault": lambda: ctypes.string_at(0),
    "killed": lambda: os.kill(os.getpid(), signal.SIGKILL),
    "endless": endless,
    "stuck": stuck,
    "orphans": orphan,
    "unlucky": unlucky,
}
"""Methods that do their worst in trial 1."""


class Climb(Rung[FakeOptions]):
    """Survive levels; `weak` those below 2.5, `strong` all, and `fragile` takes its process with it from level 2 on."""

    name = "climb"
    Options = FakeOptions
    profiles = ("ideal",)
    default_profile = "ideal"
    default_methods = ("weak", "strong")
    adaptive = True

    def methods(self) -> tuple[str, ...]:
        return ("weak", "strong", "fragile")

    def config(self, method: str, profile: str, overrides: Mapping[str, str]) -> Mapping[str, Any]:
        return {}

    def cases(self, results: Results) -> Sequence[Case]:
        cases: list[Case] = []
        for side in ("left", "right"):
            for level in (1.0, 2.0, 3.0, 4.0):
                cases.append({"side": side, "level": level})
                found = results(cases[-1])
                if found is None or not all(outcome.success for outcome in found):
                    break
        return cases

    def together(self, spec: TrialSpec) -> tuple[str, int]:
        return spec.method, spec.index

    def run(self, spec: TrialSpec, artefacts: Path | None) -> TrialOutcome:
        level = float(spec.case["level"])
        if spec.method == "fragile" and level > 1.5 and spec.case["side"] == "left":
            os._exit(1)
        if spec.method == "weak" and level > 2.5:
            return TrialOutcome(False, "fall", "lower_body: weak", series={"level": level})
        return TrialOutcome(True, "done", series={"level": level, "draw": spec.rng("draw").random()})
