"""The YAML that Isaac Lab exports of an environment: its IO descriptors."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

from golem.capabilities.legs.description import ActionScaling, Description
from golem.capabilities.legs.gait import GaitConfig
from golem.capabilities.legs.observation import Term
from golem.capabilities.legs.passports import base
from golem.errors import ConfigError
from golem.hardware.servo.gains import default_gains
from golem.types import LEGS

NAME = "Isaac Lab's IO descriptors"
MARK = "articulations"
"""A key that only this format has."""
KEYS = base.KEYS_OF["isaac_lab"]


def read(path: Path, data: Mapping[str, Any], network: Path | None) -> base.Passport:
    """Return the passport in the `data` of the file `path`. Raises ConfigError: a key is missing or cannot be meant."""
    robot = next(iter(cast("Mapping[str, Mapping[str, Any]]", base.at(data, MARK)).values()))
    names = base.joint_names(base.at(robot, "joint_names"))
    n = len(names)
    posture = base.numbers("default_joint_pos", base.at(robot, "default_joint_pos"), n)
    actions = cast("list[Mapping[str, Any]]", base.at(data, "actions"))
    if len(actions) != 1 or "JointPosition" not in str(actions[0].get("full_path")):
        raise ConfigError("A leg policy has one action, joint positions; this one has others.")
    action = actions[0]
    moved = base.joint_names(base.at(action, "joint_names"))
    m = len(moved)
    kp = base.of_legs(names, base.numbers("default_joint_stiffness", base.at(robot, "default_joint_stiffness"), n))
    kd = base.of_legs(names, base.numbers("default_joint_damping", base.at(robot, "default_joint_damping"), n))
    assumed = [base.FOLLOWS]
    if not any(kp):
        gains = default_gains()
        kp, kd = tuple(gains.kp[LEGS].tolist()), tuple(gains.kd[LEGS].tolist())
        assumed.append("The file has no gains, as with an actuator network; those of the stack are used.")
    listed = cast("list[Mapping[str, Any]]", base.at(data, "observations", "policy"))
    terms = tuple(_term(own, names, moved) for own in listed)
    if any(t.history > 1 for t in terms):
        assumed.append("Past ticks are laid out term by term, the oldest first.")
    clocked = any(t.term == "phase" for t in terms)
    if clocked:
        assumed.append(f"The gait clock has a period of {base.PERIOD:g} s and never rests; the sine comes first.")
    if any(t.term == "orientation" for t in terms):
        assumed.append("Quaternions are w, x, y, z, as before Isaac Lab 3.")
    offset = base.numbers("offset of the action", action.get("offset", 0.0), m)
    default = dict(zip(names, posture, strict=True))
    at_rest = default | dict(zip(moved, offset, strict=True))
    apart = any(abs(at_rest[name] - default.get(name, 0.0)) > 1e-3 for name in at_rest)
    if apart and any(t.term == "joint_position" for t in terms):
        raise ConfigError("The action's offset is not the default_joint_pos, which the joints are seen relative to.")
    description = Description(
        network="policy.onnx",
        observation=terms,
        posture=base.by_motor(tuple(at_rest), tuple(at_rest.values())),
        kp=kp,
        kd=kd,
        action=ActionScaling(
            base.of_legs(moved, base.numbers("scale of the action", action.get("scale", 1.0), m)),
            targets=base.target_limits(moved, action.get("clip")),
        ),
        gait=GaitConfig(base.PERIOD, start="always" if clocked else "never"),
        envelope=base.ASSUMED_TWISTS,
        rate=1.0 / base.numbers("scene.dt", base.at(data, "scene", "dt"), 1)[0],
        joints=moved,
    )
    folder = path.parent
    places = [
        p / n for n in ("policy.onnx", "policy.pt") for p in (folder / "exported", folder.parent / "exported", folder)
    ]
    keys = KEYS | {str(i): str(own.get("name")) for i, own in enumerate(listed)}
    return base.Passport(NAME, path, description, network or base.first_file(places), tuple(assumed), keys)


def _term(own: Mapping[str, Any], names: tuple[str, ...], moved: tuple[str, ...]) -> Term:
    """Return a term by the name of its function, which says what it is; the term's own name may be any."""
    name = str(own.get("full_path", own.get("name"))).rpartition(".")[2]
    joints = base.joint_names(own["joint_names"]) if "joint_names" in own else names
    more = cast("Mapping[str, Any]", own.get("overloads") or {})
    return base.read_term(name, joints, moved, more.get("scale"), more.get("clip"), more.get("history_length", 1))
