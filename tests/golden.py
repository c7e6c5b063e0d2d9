"""Records of a few runs: what they come to shall not change unless somebody means it to.

`python -m tests.golden` runs them and writes the records anew; the changed file belongs to the commit that changes what
they come to. A pick goes by what a network sees, and its last digits depend on the processor: it has a record for each
kind that is known.
"""

from __future__ import annotations

import json
from pathlib import Path

from golem.evaluation.base import RUNGS, TrialSpec, make_rung
from golem.interfaces import topics
from golem.runtime.lockstep import build
from golem.stack import load_stack

FILE = Path(__file__).resolve().parent / "evaluation" / "golden.json"
SEED = 1
"""Not that of the published figures."""
SECONDS = 0.5
"""How long the robot of `standing` stands."""

Record = dict[str, float]


def standing() -> Record:
    """Return what the motors of a standing robot do, and what it believes, after `SECONDS` of the errors of `field`."""
    running, robot = build(load_stack("stand", profile="field"), SEED)
    running.executor.run(SECONDS)
    state, base = running.bus.latest(topics.LOW_STATE), running.bus.latest(topics.BASE)
    command = running.bus.latest(topics.LOW_CMD)
    robot.close()
    assert state is not None and base is not None and command is not None
    numbers = {"q": state.q, "tau": state.tau, "command": command.q, "base": base.T_odom_base[:3, 3]}
    return {f"{name}_{i}": float(x) for name, array in numbers.items() for i, x in enumerate(array)}


def picked(rung: str) -> Record:
    """Return what one trial of a pick measures."""
    outcome = make_rung(RUNGS[rung]).run(TrialSpec(rung, "visual_servo", "field", SEED, 0), None)
    assert outcome.success, outcome.detail
    return dict(sorted({**outcome.timings, **outcome.series}.items()))


def processor() -> str:
    """Return what this machine calls its processor, and which vectors it has."""
    file = Path("/proc/cpuinfo")
    lines = file.read_text(encoding="utf-8").splitlines() if file.exists() else []
    told = {name.strip(): value.strip() for name, _, value in (line.partition(":") for line in lines)}
    vectors = sorted(flag for flag in told.get("flags", "").split() if flag.startswith(("avx", "fma", "amx")))
    return " ".join([told.get("model name", "another"), *vectors])


def records() -> dict[str, dict[str, Record]]:
    """Return the records that are kept, by name and processor."""
    return json.loads(FILE.read_text(encoding="utf-8"))


if __name__ == "__main__":
    runs = {"standing": standing()} | {rung: picked(rung) for rung in ("tether", "stand")}
    made = {name: {processor(): record} for name, record in runs.items()}
    FILE.write_text(json.dumps(made, indent=1) + "\n", encoding="utf-8")
