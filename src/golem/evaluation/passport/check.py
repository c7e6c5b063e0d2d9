"""Looks for what is wrong with a passport: by its numbers, then by a walk, then by walks with each known repair."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from golem.capabilities.legs.network import load_network
from golem.capabilities.legs.passports.base import Passport
from golem.evaluation.passport import numbers_check
from golem.evaluation.passport.base import Mistake
from golem.evaluation.passport.floor import Floor
from golem.evaluation.passport.repairs import Repair, repairs
from golem.evaluation.passport.trial import SOUND, Trial, walk

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

    Args:
        passport: what is said of it.
        progress: is told what is being done.

    Raises:
        ConfigError: there is no network, or none that can be run.
        MissingExtra: it is a TorchScript file, and torch is not installed.
    """
    found = [*numbers_check.sizes(passport)]
    found += [*numbers_check.metadata(passport), *numbers_check.numbers(passport.description)]
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
