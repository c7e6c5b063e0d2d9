"""Known mistakes, undone one at a time: each a description that would be right if the given one had that mistake."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import permutations
from typing import Any

import numpy as np

from golem.capabilities.legs.description import Description
from golem.capabilities.legs.observation import TERMS, ObservationLayout, Term
from golem.robots.model.table import JOINT_INDEX, JOINT_NAMES
from golem.types import LEGS, NUM_JOINTS, Array

FACTORS = (0.05, 0.25, 0.5, 2.0, 4.0, 20.0)
"""By what scales are mistaken: forgotten (0.05, 0.25 and 2 are the usual ones), or applied twice."""
POSTURES = {
    "straight": [0.0] * 6,
    "ALMI-Open's": [0, -0.4, 0, 0.8, -0.4, 0],
    "unitree_rl_gym's": [0, -0.16, 0, 0.36, -0.2, 0],
    "mjlab's": [0, -0.2, 0, 0.5, -0.3, 0],
    "Isaac Lab's": [0, -0.28, 0, 0.79, -0.52, 0],
}
"""Default postures of public policies of the H1 and the H1-2 [rad], per leg."""
GAINS = {
    "ALMI-Open's": ([200, 200, 200, 300, 40, 40], [2.5, 2.5, 2.5, 4, 2, 2]),
    "mjlab's": ([98.7, 98.7, 98.7, 157.7, 19.7, 19.7], [6.3, 6.3, 6.3, 10.1, 1.3, 1.3]),
}
"""Their gains [N m/rad, N m s/rad], per leg."""
RATES = (25.0, 50.0, 100.0, 200.0)
PERIODS = (0.4, 0.5, 0.6, 0.7, 0.8, 1.0)
_LEGS = JOINT_NAMES[LEGS]
_AXES = {"base_rate": "gyro frame", "gravity": "gravity sign", "twist": "commands"}


@dataclass(frozen=True, slots=True)
class Repair:
    """A mistake and the description without it.

    Attributes:
        cause, field: see `Mistake`.
        change: what to change, to be read after "if".
        description: without the mistake.
    """

    cause: str
    field: str
    change: str
    description: Description


def repairs(d: Description) -> Iterator[Repair]:
    """Yield every known repair of `d`, kinds of few repairs first: a search ends at one that is clearly right."""
    for rate in RATES:
        if abs(rate - d.rate) > 1.0:
            yield Repair("rate", "rate", f"the rate is {rate:g} Hz", replace(d, rate=rate))
    yield from _clock(d)
    yield from _history(d)
    for i, term in enumerate(d.observation):
        yield from _term(d, i, term)
    yield from _orders(d)
    yield from _signs(d)
    yield from _actions(d)


def _orders(d: Description) -> Iterator[Repair]:
    names = d.joints or _LEGS
    alternate = tuple(name for pair in zip(_LEGS[:6], _LEGS[6:], strict=True) for name in pair)
    upper = [name for name in JOINT_NAMES if name not in _LEGS]
    arms = [name for pair in zip(upper[1:8], upper[8:], strict=True) for name in pair]
    candidates = {
        "of the motors": (*_LEGS, *upper),
        "of Isaac, left and right in turn": (*alternate[:2], upper[0], *alternate[2:], *arms),
        "with the right leg first": (*_LEGS[6:], *_LEGS[:6], *upper),
    }
    for hips in list(permutations(range(3)))[1:]:
        inside = [*hips, 3, 4, 5]
        said = ", ".join(_LEGS[k].removeprefix("left_").removesuffix("_joint") for k in hips)
        candidates[f"{said} in each leg"] = (*(_LEGS[k] for k in inside), *(_LEGS[6 + k] for k in inside), *upper)
    for said, order in candidates.items():
        right = tuple(name for name in order if name in names)
        if right == tuple(names) or len(right) != len(names):
            continue
        now = dict(zip(names, right, strict=True))
        seen = replace(d, observation=tuple(_renamed(t, now) for t in d.observation))
        both = replace(seen, joints=right)
        posture = replace(both, posture=_moved(d.q0(), now))
        kp, kd = d.gains()
        change = f"the joints are in the order {said}"
        yield Repair("order", "joints", change, both)
        yield Repair("order", "joints", f"{change}, and so is the posture", posture)
        gains: dict[str, Any] = {"kp": _moved(kp, now)[LEGS], "kd": _moved(kd, now)[LEGS]}
        yield Repair("order", "joints", f"{change}, and so are posture and gains", replace(posture, **gains))
        yield Repair("order", "joints", f"the actions are in the order {said}", replace(d, joints=right))
        yield Repair("order", "observation", f"the observed joints are in the order {said}", seen)
        yield Repair("order", "posture", f"the posture is in the order {said}", replace(d, posture=_moved(d.q0(), now)))


def _renamed(term: Term, now: dict[str, str]) -> Term:
    if not term.term.startswith(("joint", "last")):
        return term
    of = term.of or (_LEGS if term.term == "last_action" else JOINT_NAMES)
    of = tuple(name for word in of for name in (_LEGS if word == "legs" else (word,)))
    return replace(term, of=tuple(now.get(name, name) for name in of))


def _moved(values: Array, now: dict[str, str]) -> tuple[float, ...]:
    """Return motor values with each moved to the joint that it is of."""
    out = np.zeros(NUM_JOINTS)
    out[: len(values)] = values
    before = out.copy()
    for old, new in now.items():
        out[JOINT_INDEX[new]] = before[JOINT_INDEX[old]]
    return tuple(out.tolist())


def _signs(d: Description) -> Iterator[Repair]:
    """One kind of joint turns the other way, on both legs: in action and observation, or in one of them."""
    scale = d.action_scale()
    for k in range(6):
        kind = _LEGS[k].removeprefix("left_")
        flipped = scale.copy()
        flipped[[k, k + 6]] *= -1.0
        turned = replace(d, action=replace(d.action, scale=tuple(flipped.tolist())))
        yield Repair("sign", "action.scale", f"the action of {kind} turns the other way", turned)
        seen = tuple(_flipped(t, (_LEGS[k], _LEGS[k + 6])) for t in d.observation)
        yield Repair("sign", "observation", f"the observed {kind} turns the other way", replace(d, observation=seen))
        yield Repair("sign", "joints", f"{kind} turns the other way", replace(turned, observation=seen))
    turned = replace(d, action=replace(d.action, scale=tuple((-scale).tolist())))
    yield Repair("sign", "action.scale", "all actions turn the other way", turned)


def _flipped(term: Term, joints: Sequence[str]) -> Term:
    if term.term not in ("joint_position", "joint_velocity", "joint_angle"):
        return term
    names = _names(term)
    scale = np.resize(np.array(term.scale, dtype=np.float64), len(names))
    return replace(
        term, scale=tuple(s * (-1.0 if n in joints else 1.0) for s, n in zip(scale.tolist(), names, strict=True))
    )


def _names(term: Term) -> list[str]:
    return [name for _, name in ObservationLayout((replace(term, scale=1.0),), np.zeros(NUM_JOINTS)).components]


def _term(d: Description, i: int, term: Term) -> Iterator[Repair]:
    """What may be wrong with one term: scale, sign, axes, clip."""

    def repair(cause: str, change: str, **changes: Any) -> Repair:
        terms = list(d.observation)
        terms[i] = replace(term, **changes)
        return Repair(cause, str(i), f"{change} in {term.term}", replace(d, observation=tuple(terms)))

    size = len(_names(term))
    scale = np.resize(np.array(term.scale, dtype=np.float64), size)
    if term.clip is not None:
        yield repair("clip", "nothing is clipped", clip=None)
    if term.term in ("one", "phase", "phase_sin", "phase_cos"):
        return
    if term.term == "orientation":
        turned = {"w, x, y, z": ("w", "x", "y", "z"), "x, y, z, w": ("x", "y", "z", "w")}
        for said, of in turned.items():
            if of != (term.of or TERMS["orientation"]):
                yield repair("quaternion order", f"the order is {said}", of=of)
        return
    for f in FACTORS:
        yield repair("scale", f"the scale is {f:g} times what it is", scale=tuple((scale * f).tolist()))
    sign = _AXES.get(term.term, "sign")
    yield repair(sign, "the sign is the other one", scale=tuple((-scale).tolist()))
    if (scale < 0.0).any() and size != 3:
        yield repair("sign", "all signs are positive", scale=tuple(np.abs(scale).tolist()))
    if size != 3 or term.term not in _AXES:
        return
    cause = "gyro frame" if term.term != "twist" else "commands"
    for signs in ((1, -1, -1), (-1, 1, -1), (-1, -1, 1), (1, 1, -1), (1, -1, 1), (-1, 1, 1)):
        named = "gravity sign" if term.term == "gravity" else cause
        said = ", ".join(f"{'-' if s < 0 else '+'}{n}" for s, n in zip(signs, TERMS[term.term], strict=True))
        yield repair(named, f"the signs are {said} times what they are", scale=tuple((scale * signs).tolist()))
    for order in list(permutations(range(3)))[1:]:
        of = tuple(_names(term)[k] for k in order)
        yield repair(cause, f"the order is {', '.join(of)}", of=of)
    if term.term == "twist" and len(set(scale.tolist())) > 1:
        yield repair(cause, "the scales are in the reverse order", scale=tuple(scale[::-1].tolist()))


def _actions(d: Description) -> Iterator[Repair]:
    scale = d.action_scale()
    for f in FACTORS[1:-1]:
        turned = replace(d.action, scale=tuple((scale * f).tolist()))
        yield Repair("scale", "action.scale", f"actions are {f:g} times as large", replace(d, action=turned))
    if d.action.clip < 20.0 or d.action.targets:
        free = replace(d.action, clip=100.0, targets=())
        field = "action.targets" if d.action.targets else "action.clip"
        yield Repair("clip", field, "actions are not clipped", replace(d, action=free))
    q = d.q0()
    flipped = q.copy()
    flipped[LEGS] *= -1.0
    postures = {s: np.tile(np.array(v, np.float64), 2) for s, v in POSTURES.items()} | {"the negative": flipped[LEGS]}
    for said, legs in postures.items():
        q[LEGS] = legs
        yield Repair("offset", "posture", f"the default posture is {said}", replace(d, posture=tuple(q.tolist())))
    kp, kd = d.gains()
    for f in (0.1, 0.2, 0.5, 2.0, 5.0, 10.0):
        yield Repair("gains", "kp", f"stiffness is {f:g} times as large", replace(d, kp=tuple((kp * f).tolist())))
        yield Repair("gains", "kd", f"damping is {f:g} times as large", replace(d, kd=tuple((kd * f).tolist())))
    for said, (stiff, damp) in GAINS.items():
        yield Repair("gains", "kp", f"the gains are {said}", replace(d, kp=tuple(stiff), kd=tuple(damp)))


def _history(d: Description) -> Iterator[Repair]:
    if max(t.history for t in d.observation) < 2:
        return
    same = len({t.history for t in d.observation}) == 1
    for order in ("term", "frame") if same else ("term",):
        for first in (False, True):
            if (order, first) != (d.history, d.newest_first):
                said = f"past ticks are laid out {order} by {order}, the {'newest' if first else 'oldest'} first"
                yield Repair("history layout", "history", said, replace(d, history=order, newest_first=first))


def _clock(d: Description) -> Iterator[Repair]:
    shown = [i for i, t in enumerate(d.observation) if t.term.startswith("phase")]
    if not shown:
        return
    for period in PERIODS:
        if abs(period - d.gait.period) > 0.01:
            gait = replace(d.gait, period=period)
            yield Repair("clock phase", "gait", f"the clock's period is {period:g} s", replace(d, gait=gait))
    other = {"left": "right", "right": "left", "sin": "cos", "cos": "sin"}
    changes = {"sine and cosine are exchanged": ("sin", "cos"), "left and right are exchanged": ("left", "right")}
    for said, words in changes.items():
        terms = list(d.observation)
        for i in shown:
            term = "_".join(other[w] if w in words else w for w in terms[i].term.split("_"))
            of = tuple("_".join(other[w] if w in words else w for w in n.split("_")) for n in terms[i].of)
            terms[i] = replace(terms[i], term=term, of=of)
        yield Repair("clock phase", str(shown[0]), said, replace(d, observation=tuple(terms)))
    for sine, cosine in ((-1.0, 1.0), (1.0, -1.0)):
        terms = list(d.observation)
        for i in shown:
            names = [f"{terms[i].term}_{name}" for name in _names(terms[i])]
            scale = np.resize(np.array(terms[i].scale, dtype=np.float64), len(names)).tolist()
            turned = [s * (sine if "sin" in n else cosine) for s, n in zip(scale, names, strict=True)]
            terms[i] = replace(terms[i], scale=tuple(turned))
        said = f"the clock's {'sine' if sine < 0 else 'cosine'} has the other sign"
        yield Repair("clock phase", str(shown[0]), said, replace(d, observation=tuple(terms)))
