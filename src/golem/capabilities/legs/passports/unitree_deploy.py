"""Unitree's `deploy.yaml`, as unitree_rl_lab writes it and unitree_rl_mjlab has it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

from golem.capabilities.legs.base import Envelope
from golem.capabilities.legs.description import ActionScaling, Description
from golem.capabilities.legs.gait import GaitConfig
from golem.capabilities.legs.observation import HistoryOrder, Term
from golem.capabilities.legs.passports import base
from golem.errors import ConfigError
from golem.robots.model.table import JOINT_NAMES
from golem.types import LEGS

NAME = "Unitree's deploy.yaml"
MARK = "joint_ids_map"
"""A key that only this format has."""
KEYS = base.KEYS_OF["unitree_deploy"]


def read(path: Path, data: Mapping[str, Any], network: Path | None) -> base.Passport:
    """Return the passport in the `data` of the file `path`. Raises ConfigError: a key is missing or cannot be meant."""
    motors = [int(i) for i in base.numbers(MARK, base.at(data, MARK), len(base.at(data, MARK)))]
    if sorted(motors) != list(range(len(motors))) or len(motors) not in (LEGS.stop, len(JOINT_NAMES)):
        raise ConfigError(
            f"The {MARK} names each motor once, {LEGS.stop} of the legs or all {len(JOINT_NAMES)}; not {len(motors)}."
        )
    names = tuple(JOINT_NAMES[i] for i in motors)
    n = len(names)
    sdk = JOINT_NAMES[:n]
    posture = base.numbers("default_joint_pos", base.at(data, "default_joint_pos"), n)
    action = next(iter(cast("Mapping[str, Mapping[str, Any]]", base.at(data, "actions")).values()), {})
    ids = action.get("joint_ids")
    moved = tuple(names[int(i)] for i in ids) if isinstance(ids, list) else names
    m = len(moved)
    offset = base.numbers("offset of the action", action.get("offset", list(posture)), m)
    if base.by_motor(moved, offset) != base.by_motor(moved, [posture[names.index(j)] for j in moved]):
        raise ConfigError("The action's offset is not the default_joint_pos, which the joints are seen relative to.")
    groups = cast("Mapping[str, Any]", base.at(data, "observations"))
    if groups and not any(isinstance(v, Mapping) and "params" in v for v in groups.values()):
        groups = cast("Mapping[str, Any]", next(v for v in groups.values() if isinstance(v, Mapping)))
    by_frame = bool(groups.get("use_gym_history", False))
    shown = {k: v for k, v in groups.items() if isinstance(v, Mapping)}
    terms = tuple(_term(k, v, names, moved, bool(groups.get("scale_first"))) for k, v in shown.items())
    period = next((v["params"].get("period", base.PERIOD) for k, v in shown.items() if "phase" in k), None)
    order: HistoryOrder = "frame" if by_frame else "term"
    ranges = base.at(data, "commands", "base_velocity", "ranges")
    axes = [base.numbers(k, base.at(ranges, k), 2) for k in ("lin_vel_x", "lin_vel_y", "ang_vel_z")]
    vx, vy, wz = cast("list[tuple[float, float]]", axes)
    description = Description(
        network="policy.onnx",
        observation=terms,
        posture=base.by_motor(names, posture),
        kp=base.of_legs(sdk, base.numbers("stiffness", base.at(data, "stiffness"), n)),
        kd=base.of_legs(sdk, base.numbers("damping", base.at(data, "damping"), n)),
        action=ActionScaling(
            base.of_legs(moved, base.numbers("scale of the action", action.get("scale", 1.0), m)),
            targets=base.target_limits(moved, action.get("clip")),
        ),
        gait=GaitConfig(
            base.PERIOD if period is None else float(period), start="never" if period is None else "always"
        ),
        envelope=Envelope(vx, vy, wz),
        rate=1.0 / base.numbers("step_dt", base.at(data, "step_dt"), 1)[0],
        joints=moved,
        history=order,
    )
    assumed = ["stiffness and damping are in the order of the motors, default_joint_pos in that of joint_ids_map."]
    if any(t.history > 1 for t in terms):
        assumed.append(f"Past ticks are laid out {order} by {order}, the oldest first.")
    if period is not None:
        assumed.append("The gait clock never rests.")
    folder = path.parent
    places = [p / name for name in ("policy.onnx", "policy.pt") for p in (folder.parent / "exported", folder)]
    keys = KEYS | {str(i): k for i, k in enumerate(shown)}
    return base.Passport(NAME, path, description, network or base.first_file(places), tuple(assumed), keys)


def _term(name: str, own: Mapping[str, Any], names: tuple[str, ...], moved: tuple[str, ...], scaled: bool) -> Term:
    ids = own.get("params", {}).get("asset_cfg", {}).get("joint_ids")
    joints = tuple(names[int(i)] for i in ids) if isinstance(ids, list) else names
    scale, clip = own.get("scale"), own.get("clip")
    if scaled and isinstance(clip, list):
        if isinstance(scale, list) and len(set(scale)) > 1:
            raise ConfigError(f"The term {name} has a clip after scales that differ, which is not supported.")
        factor = abs(float(scale[0] if isinstance(scale, list) else scale or 1.0))
        clip = [float(x) / factor for x in clip]
    return base.read_term(name, joints, moved, scale, clip, own.get("history_length", 1))
