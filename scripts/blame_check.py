"""Is the right module blamed? `python scripts/blame_check.py --out runs/blame-check -n 50 -j 8`.

Defects are planted in five sizes, each in a stack of its own; `golem blame` then says who lost the trials. Beside it
stand the sound stacks, and what the rules for single trials say of trials that only the defect has lost. It goes on
where it was interrupted. What it prints is the table of docs/how-to/blame.md.
"""

from __future__ import annotations

import sys
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro
from tyro.conf import arg

from golem.errors import unknown_name
from golem.evaluation.blame.blame_command import BlameConfig, BlameVerdict, Trials, judge
from golem.evaluation.blame.oracles import ALTERED
from golem.evaluation.harness.ladder import LadderConfig, run_ladder
from golem.evaluation.harness.records import read_records
from golem.evaluation.harness.trial_executor import make_executor
from golem.evaluation.metrics.statistics import wilson
from golem.evaluation.metrics.text_table import TextTable

HERE = Path(__file__).with_name("planted_defects.py")


@dataclass(frozen=True)
class Defect:
    """A defect in five sizes.

    Attributes:
        use: word of `--use` that plants it, with `SIZE` in the place of a size.
        sizes: from small to large.
        rung: where it is tried.
        right: the oracle that makes up for it.
    """

    use: str
    sizes: tuple[float, ...]
    rung: str
    right: str


DEFECTS = {
    # Objects are seen beside their places [m].
    "shifted_detector": Defect(
        f"localizer={{use: '{HERE}:ShiftedDetector', shift: SIZE}}",
        (0.004, 0.008, 0.012, 0.018, 0.026), "tether", "detections",
    ),
    # Speed of the arms [rad/s].
    "slow_ik": Defect(
        "upper_body={use: diff_ik, arm_speed: SIZE}", (0.4, 0.2, 0.1, 0.05, 0.025), "tether", "arms"
    ),
    # Share of the leg motors' torque.
    "weak_legs": Defect(
        f"robot={{use: '{ALTERED}', support: ground, leg_torque: SIZE}}", (0.5, 0.4, 0.3, 0.2, 0.1), "stand", "legs"
    ),
    # Length of a way over the true one.
    "odometry_scale": Defect(
        f"odometry={{use: '{HERE}:ScaledOdometry', scale: SIZE}}", (1.02, 1.05, 1.1, 1.15, 1.2), "navigate", "odometry"
    ),
    # Share of the finger pads' friction.
    "loose_grip": Defect(f"robot={{use: '{ALTERED}', grip: SIZE}}", (0.6, 0.4, 0.25, 0.15, 0.08), "tether", "hand"),
    # Time by which commands pass late [s].
    "late_gate": Defect(
        f"robot={{use: '{ALTERED}', support: ground, latency: SIZE}}", (0.02, 0.04, 0.08, 0.12, 0.2), "stand", "delay"
    ),
}  # fmt: skip

METHODS = {"navigate": "costmap_astar"}
"""Rung -> its method, where it is not `visual_servo`."""
SLOTS = {
    "detections": ("localizer",),
    "arms": ("upper_body", "planner"),
    "legs": ("lower_body",),
    "odometry": ("odometry", "mapper"),
    "hand": ("hand", "grasp_method"),
    "delay": ("lower_body", "robot"),
}
"""Oracle -> what a rule for single trials may name: no rule knows of delays, or tells a hand from its grasp."""


@dataclass(frozen=True)
class BlameCheck:
    """Plant defects and see whom golem blame names."""

    out: Path
    """Folder of all runs."""
    defects: tuple[str, ...] = tuple(DEFECTS)
    """Which."""
    sizes: tuple[int, ...] = (1, 2, 3, 4, 5)
    """Of each, from 1 (small) to 5."""
    n: Annotated[int, arg(aliases=("-n",))] = 50
    """Trials of each."""
    harm: int = 40
    """As of golem blame."""
    only: tuple[str, ...] = ()
    """Oracles to try; none tries all."""
    profile: str = "field"
    """Realism profile."""
    seed: int = 0
    """Of the trials."""
    j: Annotated[int, arg(aliases=("-j",))] = 1
    """Processes."""


def verdict(config: BlameCheck, rung: str, name: str = "", size: int = 0) -> tuple[BlameVerdict, Path]:
    """Run the ladder of one stack, and return who lost its trials."""
    out = config.out / (f"{name}-{size}" if name else f"sound-{rung}")
    method = METHODS.get(rung, "visual_servo")
    use = (DEFECTS[name].use.replace("SIZE", str(DEFECTS[name].sizes[size - 1])),) if name else ()
    run_ladder(LadderConfig(rung, (method,), config.n, config.profile, config.seed, out, config.j, use))
    blame = BlameConfig((out,), config.only, config.n, config.harm, config.j)
    with closing(make_executor("local", config.j)) as executor:
        trials = Trials(out, read_records(out / "trials.jsonl"), blame, executor)
        return judge(trials, method, trials.candidates(), blame, rung), out


def main(config: BlameCheck) -> None:
    """Print what came out so far after each stack."""
    for name in config.defects:
        if name not in DEFECTS:
            raise unknown_name("defect", name, DEFECTS)
    rows: list[tuple[str, ...]] = []
    hits = single = lost_by_defect = cells = false = sound = 0
    for rung in dict.fromkeys(DEFECTS[name].rung for name in config.defects):
        plain, out = verdict(config, rung)
        base = {record.key: record for record in read_records(out / "trials.jsonl")}
        sound, false = sound + 1, false + bool(plain.proved)
        rows.append(_row(f"none, {rung}", "-", plain))
        for name in (one for one in config.defects if DEFECTS[one].rung == rung):
            for size in config.sizes:
                found, out = verdict(config, rung, name, size)
                right = DEFECTS[name].right
                here = [r for r in read_records(out / "trials.jsonl") if not r.success and base[r.key].success]
                named = sum((r.module or "").partition(":")[0] in SLOTS[right] for r in here)
                if here:
                    cells, hits = cells + 1, hits + (found.first == right)
                    single, lost_by_defect = single + named, lost_by_defect + len(here)
                rows.append(_row(f"{name}:{size}", right, found, f"{named} of {len(here)}"))
                _show(rows, config)
    _show(rows, config)
    for words, k, n in (
        ("Defects that cost trials, right module first", hits, cells),
        ("Single-trial rules right, of trials that only the defect lost", single, lost_by_defect),
        ("Sound stacks with a module proved to lose trials", false, sound),
    ):
        print(f"{words}: {k} of {n}{f', {wilson(k, n).text(100)} %' if n else ''}")


def _row(name: str, right: str, found: BlameVerdict, named: str = "-") -> tuple[str, ...]:
    shares = {k: v for k, v in found.shares.items() if v.value}
    parts = " ".join(f"{k} {100 * v.value:+.0f}" for k, v in sorted(shares.items(), key=lambda kv: -kv[1].value))
    s, total = found.strata, found.total
    whole = f"{100 * total.value:+.0f} {total.interval.text(100, '+')}"
    return name, f"{s.won} of {s.n}", right, found.first or "-", " ".join(found.proved) or "-", parts, whole, named


def _show(rows: list[tuple[str, ...]], config: BlameCheck) -> None:
    columns = ("defect", "won", "right", "first", "proved", "shares", "together", "single-trial rule right")
    title = f"n = {config.n}, harm {config.harm}, profile {config.profile}, seed {config.seed}"
    print(TextTable(title, columns, tuple(rows)).markdown(), "\n", sep="", flush=True)


if __name__ == "__main__":
    from golem.robots.mujoco.gl import choose_backend

    choose_backend()
    sys.exit(main(tyro.cli(BlameCheck)))
