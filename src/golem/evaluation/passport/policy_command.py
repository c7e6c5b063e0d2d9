"""`golem check policy FILE`: what a trainer's leg policy is, what is assumed of it, and what is wrong with it."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from golem.capabilities.legs.observation import ObservationLayout
from golem.capabilities.legs.passports.base import Passport
from golem.capabilities.legs.passports.read import read_passport
from golem.evaluation.passport.check import PassportReport, check_passport
from golem.robots.model.table import JOINT_NAMES
from golem.types import LEGS


@dataclass(frozen=True, kw_only=True)
class PolicyCheckConfig:
    """Check a leg policy by what its trainer wrote, before a motor moves.

    Exit code 0: nothing is wrong. 1: something is. 2: it cannot be read.
    """

    file: Annotated[str, tyro.conf.Positional]
    """ONNX network with metadata, deploy.yaml, Isaac Lab's or unitree_rl_gym's YAML, TorchScript, or ours."""
    network: Path | None = None
    """The network, instead of the one that belongs to the file."""
    json: bool = False
    """Print JSON instead of the report."""


def run_policy_check(config: PolicyCheckConfig) -> bool:
    """Check what `config` names and print the report; return whether nothing is wrong.

    Raises:
        ConfigError: it cannot be read, or there is no network.
        MissingExtra: it is a TorchScript file, and torch is not installed.
    """
    passport = read_passport(config.file, config.network)
    console = Console(stderr=config.json)
    with console.status("reads") as status:
        verdict = check_passport(passport, lambda said: status.update(escape(said)))
    if config.json:
        print(json.dumps(_plain(passport, verdict), indent=2))
    else:
        _print(console, passport, verdict)
    return not verdict.findings


def _plain(passport: Passport, verdict: PassportReport) -> dict[str, object]:
    found = [asdict(f) | {"where": passport.where(f.field) if f.field else None} for f in verdict.findings]
    return {
        "format": passport.format,
        "network": str(passport.network),
        "assumed": list(passport.assumed),
        "findings": found,
        "notes": list(verdict.notes),
        "score": None if verdict.trial is None else verdict.trial.score,
        "repairs_tried": verdict.tried,
    }


def _print(console: Console, passport: Passport, verdict: PassportReport) -> None:
    d = passport.description
    console.print(f"[bold]{escape(str(passport.file))}[/]: {passport.format}", soft_wrap=True)
    console.print(f"network {escape(str(passport.network))}, {d.rate:g} Hz", soft_wrap=True)
    console.print(_joints(passport))
    console.print(_terms(passport))
    for said in passport.assumed:
        console.print(f"assumed: {escape(said)}", soft_wrap=True)
    for said in verdict.notes:
        console.print(f"note: {escape(said)}", soft_wrap=True)
    for f in verdict.findings:
        console.print(f"[red]✗ {f.cause}[/]: {escape(f.said)}", soft_wrap=True)
        if f.field:
            console.print(f"  change {escape(passport.where(f.field))}", soft_wrap=True)
    for said in verdict.also:
        console.print(f"  as likely: {escape(said)}", soft_wrap=True)
    if not verdict.findings:
        console.print("[green]✓ nothing is wrong with it[/]")


def _joints(passport: Passport) -> Table:
    d = passport.description
    table = Table("output", "joint", "default", "kp", "kd", "scale", box=None, padding=(0, 1))
    (kp, kd), scale, q0 = d.gains(), d.action_scale(), d.q0()
    for i, motor in enumerate(d.outputs().tolist()):
        own = [f"{v[motor]:g}" for v in (kp, kd, scale)] if motor < LEGS.stop else ["-", "-", "moves nothing"]
        table.add_row(str(i), JOINT_NAMES[motor], f"{q0[motor]:g}", *own)
    return table


def _terms(passport: Passport) -> Table:
    table = Table("values", "term", "of", "scale", "clip", "ticks", box=None, padding=(0, 1))
    d, begin = passport.description, 0
    for term in d.observation:
        names = [name for _, name in ObservationLayout((term,), d.q0()).components]
        end = begin + len(names) * term.history
        of = ", ".join(names) if len(names) < 5 else f"{names[0]}, {names[1]}, ... ({len(names)})"
        scale = term.scale if isinstance(term.scale, int | float) else sorted(set(term.scale))
        clip = "" if term.clip is None else f"{term.clip[0]:g} to {term.clip[1]:g}"
        table.add_row(f"{begin} to {end - 1}", term.term, of, str(scale), clip, str(term.history))
        begin = end
    return table
