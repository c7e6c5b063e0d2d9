"""A rung without a robot: outcomes are drawn from the trial's noise streams."""

from __future__ import annotations

import io
import os
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from PIL import Image, ImageDraw

from golem.errors import ConfigError, MissingExtra, ModuleFault
from golem.evaluation.base import TrialOutcome, TrialSpec

RATES = {"poor": 0.3, "good": 0.9, "slow": 0.9}
STAGES = (
    ("detect", "localization: onnx"),
    ("reach", "upper_body: diff_ik"),
    ("extract", "grasp: straight"),
    ("drop", None),
)


class Fake:
    """Draws whether a trial succeeds; the method `faulty` breaks its contract, `slow` takes a tenth of a second."""

    name = "fake"
    profiles = ("ideal", "field")

    def methods(self) -> tuple[str, ...]:
        return ("poor", "good", "slow", "faulty", "keyless", "buggy", "deadly", "threads", "sure")

    def config(self, method: str, profile: str, overrides: Mapping[str, str]) -> Mapping[str, Any]:
        for slot in overrides:
            if slot != "upper_body":
                raise ConfigError(f"Unknown slot '{slot}'; valid: upper_body.")
        return {"stack": {"upper_body": overrides.get("upper_body", "diff_ik")}, "rate": RATES.get(method)}

    def run(self, spec: TrialSpec, artefacts: Path | None) -> TrialOutcome:
        match spec.method:
            case "faulty" if spec.index % 2:
                raise ModuleFault("upper_body", "my_ik.py:MyIk", "joint targets have shape (14,), not (15,)")
            case "keyless":
                raise MissingExtra("ompl", "plan")
            case "buggy":
                raise KeyError("no such body")
            case "deadly":
                os._exit(3)
            case "threads":
                return TrialOutcome(True, "done", series={"threads": float(os.environ["OMP_NUM_THREADS"])})
            case "sure":
                return TrialOutcome(True, "done")
            case "slow":
                time.sleep(0.1)
        rng = spec.rng("scene")
        difficulty = rng.random()
        seconds = rng.normal(12, 2) if spec.method == "good" else rng.normal(6, 1)
        if difficulty < RATES.get(spec.method, 1.0):
            times = {"detect_to_grasp": seconds, "total": seconds + 14 + rng.random()}
            return TrialOutcome(
                True, "done", timings=times, series={"difficulty": difficulty}, picture=picture(spec)
            )
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
