"""What is wrong with a passport by its numbers alone."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from golem.capabilities.legs.description import Description
from golem.capabilities.legs.network import LOADERS, onnx_session
from golem.capabilities.legs.passports.base import Passport
from golem.capabilities.legs.passports.onnx_metadata import said_joints
from golem.errors import ConfigError
from golem.evaluation.passport.base import Mistake
from golem.robots.model.limits import load_limits
from golem.robots.model.table import JOINT_NAMES
from golem.types import LEGS, Array

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
    """Yield where the network does not fit the description; nothing else can be tried then.

    Raises:
        ConfigError: there is no such network.
    """
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
    """Return whether the posture `q` (12,) is the same for both legs."""
    return bool(np.allclose(q[:6], q[6:] * MIRROR, atol=ALIKE))


def _alike(values: Array, by: float) -> bool:
    """Return whether the values (12,) of both legs are alike."""
    return bool(np.abs(values[:6] - values[6:]).max() <= by)
