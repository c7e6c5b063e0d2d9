"""`golem check policy FILE`: what a trainer's leg policy is, what is assumed of it, and what is wrong with it."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from golem.capabilities.legs.description import Description
from golem.capabilities.legs.network import LOADERS, load_network, onnx_session
from golem.capabilities.legs.observation import ObservationLayout
from golem.capabilities.legs.passports.base import Passport
from golem.capabilities.legs.passports.onnx_metadata import said_joints
from golem.capabilities.legs.passports.read import read_passport
from golem.errors import ConfigError
from golem.evaluation.passport.repairs import Repair, repairs
from golem.evaluation.passport.trial import SOUND, Floor, Trial, walk
from golem.robots.model.table import JOINT_NAMES, load_limits
from golem.types import LEGS, Array


@dataclass(frozen=True, slots=True)
class Mistake:
    """One thing that is wrong.

    Attributes:
        cause: what it is, one word or two: `order`, `sign`, `scale`, `offset`, `gains`, `rate`, `gyro frame`, `gravity
            sign`, `quaternion order`, `history layout`, `history length`, `clock phase`, `clip`, `commands`, `names`,
            `sizes`, or `unknown`.
        said: what was seen, a sentence.
        field: the field of the description that is to change; the place of a term, such as `0`; may be empty.
    """

    cause: str
    said: str
    field: str = ""


STIFFNESS = (5.0, 2000.0)
"""Least and greatest stiffness of a leg motor that carries the robot [N m/rad] [own; public ones: 20 to 300]."""
RATES = (20.0, 200.0)
"""Ticks per second of a policy [Hz] [own; public ones run at 50 or 100]."""
LEAST_REACH = 0.15
"""Knees must be free to move by this to lift a foot [rad] [own]."""
MIRROR: Array = np.array([-1.0 if "_yaw" in name or "_roll" in name else 1.0 for name in JOINT_NAMES[LEGS]])[:6]
"""How a joint's angle changes from the left leg to the right one."""
ALIKE = 0.02
"""How much the default posture of both legs may differ [rad]."""


def sizes(passport: Passport) -> Iterator[Mistake]:
    """Yield where the network does not fit the description, which ends it. Raises ConfigError: no such network."""
    path, d = passport.network, passport.description
    if path.suffix not in LOADERS or not path.is_file():
        raise ConfigError(f"There is no network {path}; give its path with --network.")
    if path.suffix != ".onnx":
        return
    session = onnx_session(path)
    shown, moved = session.get_inputs()[0].shape, session.get_outputs()[0].shape
    wide, tall = (shape[-1] if shape and isinstance(shape[-1], int) else None for shape in (shown, moved))
    outputs = len(d.outputs())
    if tall is not None and tall != outputs:
        yield Mistake("sizes", f"The network moves {tall} joints, and {outputs} are named.", "joints")
    layout = d.layout()
    if wide is None or wide == layout.size:
        return
    tick = len(layout.components)
    lengths = {t.history for t in d.observation}
    if wide % tick == 0 and len(lengths) == 1:
        said = f"The network takes {wide} values: {wide // tick} ticks of {tick}, and the file says {lengths.pop()}."
        yield Mistake("history length", said, "history")
    else:
        said = f"The network takes {wide} values, and the terms make {layout.size}: see the table."
        yield Mistake("sizes", said, "observation")


def metadata(passport: Passport) -> Iterator[Mistake]:
    """Yield where the network's own metadata say otherwise than the description."""
    path, d = passport.network, passport.description
    names = said_joints(path)
    if names and names != (d.joints or JOINT_NAMES[LEGS]):
        said = f"The network's metadata name its joints {', '.join(names[:4])}, ...; the file has another order."
        yield Mistake("order", said, "joints")


def numbers(d: Description) -> Iterator[Mistake]:
    """Yield what no policy of this robot can have."""
    kp, kd = d.gains()
    q = d.q0()[LEGS]
    if not _mirrored(q) and np.allclose(q[0::2], q[1::2] * MIRROR, atol=ALIKE):
        said = "The default posture is the same for both legs only if left and right joints alternate."
        yield Mistake("order", said, "joints")
        return
    if kp.min() < kd.max():
        said = f"A stiffness is {kp.min():g} N m/rad and a damping {kd.max():g} N m s/rad: they may be exchanged."
        yield Mistake("gains", said, "kp")
    elif not STIFFNESS[0] <= kp.min() <= kp.max() <= STIFFNESS[1]:
        said = f"Stiffness is {kp.min():g} to {kp.max():g} N m/rad; {STIFFNESS[0]:g} to {STIFFNESS[1]:g} can carry it."
        yield Mistake("gains", said, "kp")
    elif not _alike(kp, 0.05 * kp.max()) or not _alike(kd, 0.05 * kd.max()):
        yield Mistake("gains", "The gains of the left and the right leg differ.", "kp")
    if not RATES[0] <= d.rate <= RATES[1]:
        said = f"The rate is {d.rate:g} Hz; policies run at {RATES[0]:g} to {RATES[1]:g}: the physics' step was given."
        yield Mistake("rate", said, "rate")
    yield from _posture(d)
    yield from _action(d)


def _posture(d: Description) -> Iterator[Mistake]:
    q, limits = d.q0()[LEGS], load_limits()
    outside = np.maximum(limits.lower[LEGS] - q, q - limits.upper[LEGS])
    worst = int(outside.argmax())
    if not _mirrored(q):
        i = int(np.abs(q[:6] - q[6:] * MIRROR).argmax())
        said = f"The default posture of both legs differs: {JOINT_NAMES[i]} {q[i]:g}, the right one {q[i + 6]:g} rad."
        yield Mistake("offset", said, "posture")
    elif outside[worst] > 0.0:
        said = f"{JOINT_NAMES[worst]} is {q[worst]:g} rad, beyond its limits: degrees, or another joint's."
        yield Mistake("offset", said, "posture")


def _action(d: Description) -> Iterator[Mistake]:
    scale = d.action_scale()
    names = JOINT_NAMES[LEGS]
    if scale.min() < 0.0:
        yield Mistake("sign", f"The action's scale of {names[int(scale.argmin())]} is negative.", "action.scale")
    elif not _alike(scale, 0.05 * scale.max()) or not 0.01 <= scale.min() <= scale.max() <= 2.0:
        said = f"The action's scale is {scale.min():g} to {scale.max():g} rad; 0.01 to 2, and alike on both legs, is."
        yield Mistake("scale", said, "action.scale")
    reach = float((np.abs(scale) * d.action.clip).min())
    if reach < LEAST_REACH:
        said = f"The clip lets the actions move a joint by {reach:.2g} rad, which lifts no foot."
        yield Mistake("clip", said, "action.clip")
    if len(d.action.targets):
        low, high = np.array(d.action.targets).T
        free = np.minimum(high - d.q0()[LEGS], d.q0()[LEGS] - low)
        if free[[3, 9]].min() < LEAST_REACH:
            said = f"The clip lets the knees move by {free[[3, 9]].min():.2g} rad, which lifts no foot."
            yield Mistake("clip", said, "action.targets")


def _mirrored(q: Array) -> bool:
    return bool(np.allclose(q[:6], q[6:] * MIRROR, atol=ALIKE))


def _alike(values: Array, by: float) -> bool:
    return bool(np.abs(values[:6] - values[6:]).max() <= by)


BETTER = 0.12
"""By how much a repair must be better than what is given [own: twice the spread of sound variants of one policy]."""
CLEAR = 1.82
"""Score from which the search ends [own: what is described wrongly and walks all the same has up to 1.8]."""
FINALISTS = 8
"""How many repairs that help with one twist are tried with all."""


@dataclass(frozen=True, slots=True)
class PassportReport:
    """What a check found.

    Attributes:
        findings: what is wrong; none where the policy is sound.
        trial: how it walked as it is described; None where its numbers forbid to try.
        notes: what is worth knowing and no fault.
        tried: how many repairs were tried.
    """

    findings: tuple[Mistake, ...]
    trial: Trial | None = None
    notes: tuple[str, ...] = ()
    tried: int = 0
    also: tuple[str, ...] = field(default=())


def check_passport(passport: Passport, progress: Callable[[str], None] = lambda said: None) -> PassportReport:
    """Check a policy; nothing moves but the twin.

    Raises:
        ConfigError: there is no network, or none that can be run.
        MissingExtra: it is a TorchScript file, and torch is not installed.
    """
    found = [*sizes(passport)]
    found += [*metadata(passport), *numbers(passport.description)]
    if found:
        return PassportReport(tuple(found))
    d = passport.description
    network = load_network(passport.network, d.layout().size, len(d.outputs()))
    floor = Floor(velocity_noise=0.0)
    progress("walks as described")
    given = walk(floor, d, network)
    if given.score >= SOUND:
        return PassportReport((), given)
    tries: list[tuple[float, Repair]] = []
    walked: list[tuple[Trial, Repair]] = []
    for repair in repairs(d):
        progress(f"walks if {repair.change}")
        score = walk(floor, repair.description, network, given.worst).score
        tries.append((score, repair))
        if score >= CLEAR - 0.05:
            walked.append((walk(floor, repair.description, network), repair))
            if walked[-1][0].score >= CLEAR:
                break
    else:
        tries.sort(key=lambda pair: -pair[0])
        walked = [(walk(floor, r.description, network), r) for _, r in tries[:FINALISTS]]
    walked.sort(key=lambda pair: -pair[0].score)
    best, repair = walked[0]
    # One that stays up and strays, as a policy that only stands does, is not mended by what strays less.
    if best.lasted == 1.0 and best.score > max(given.score + BETTER, SOUND if given.lasted == 1.0 else 0.0):
        also = tuple(r.change for t, r in walked[1:] if t.score > best.score - 0.05 and r.cause != repair.cause)
        said = f"{_fault(given)}; if {repair.change}, it {_course(best)}."
        return PassportReport((Mistake(repair.cause, said, repair.field),), given, tried=len(tries), also=also)
    if given.lasted < 1.0:
        said = f"{_fault(given)}, and no single repair that is known helps."
        return PassportReport((Mistake("unknown", said),), given, tried=len(tries))
    return PassportReport(
        (), given, (f"It stays up, but goes otherwise than it is told ({_course(given)}).",), len(tries)
    )


def _fault(trial: Trial) -> str:
    return "It walks badly" if trial.lasted == 1.0 else f"It falls after {trial.fell:.1f} s"


def _course(trial: Trial) -> str:
    told = ", ".join(
        f"{axis} {went[k]:.2f} of {told[k]:g}"
        for told, went in zip(trial.told[1:], trial.went[1:], strict=True)
        for k, axis in enumerate(("vx", "vy", "wz"))
        if told[k]
    )
    return f"walks: {told}" if told else "stands"


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
