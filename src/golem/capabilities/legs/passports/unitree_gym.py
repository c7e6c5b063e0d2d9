"""The YAML of unitree_rl_gym's deployment, to MuJoCo or to the robot."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from golem.capabilities.legs.base import Envelope
from golem.capabilities.legs.description import ActionScaling, Description
from golem.capabilities.legs.gait import GaitConfig
from golem.capabilities.legs.observation import Term
from golem.capabilities.legs.passports import base
from golem.errors import ConfigError
from golem.robots.model.table import JOINT_NAMES
from golem.types import LEGS

NAME = "unitree_rl_gym's deployment YAML"
MARK = "num_obs"
"""A key that only this format has."""
KEYS = base.KEYS_OF["unitree_gym"]


def read(path: Path, data: Mapping[str, Any], network: Path | None) -> base.Passport:
    """Return the passport in the `data` of the file `path`. Raises ConfigError: a key is missing or cannot be meant."""
    n, seen = LEGS.stop, base.at(data, MARK)
    if base.at(data, "num_actions") != n or seen != 11 + 3 * n:
        raise ConfigError(
            f"A leg policy of unitree_rl_gym for the H1-2 has {n} actions and {11 + 3 * n} observations, not "
            f"{data['num_actions']} and {seen}."
        )
    motors = [int(i) for i in base.numbers("leg_joint2motor_idx", data.get("leg_joint2motor_idx", list(range(n))), n)]
    if sorted(motors) != list(range(n)):
        raise ConfigError(f"The leg_joint2motor_idx names each of the motors 0 to {n - 1} once, not {motors}.")
    legs = tuple(JOINT_NAMES[i] for i in motors)
    rows = {key: base.numbers(key, base.at(data, key), n) for key in ("kps", "kds", "default_angles")}
    kp, kd, posture = ([row[motors.index(i)] for i in range(n)] for row in rows.values())
    keys = dict(KEYS)
    if "control_dt" in data:
        step = base.numbers("control_dt", data["control_dt"], 1)[0]
    else:
        keys["rate"] = "control_decimation"
        step = base.numbers("simulation_dt", base.at(data, "simulation_dt"), 1)[0]
        step *= base.numbers("control_decimation", base.at(data, "control_decimation"), 1)[0]
    scale = {k: base.numbers(k, base.at(data, k), 1)[0] for k in ("ang_vel_scale", "dof_pos_scale", "dof_vel_scale")}
    assumed = [f"The gait clock of its deployment: {base.PERIOD:g} s, sine, then cosine; it never rests."]
    envelope = base.ASSUMED_TWISTS
    if "max_cmd" in data:
        vx, vy, wz = ((-x, x) for x in base.numbers("max_cmd", data["max_cmd"], 3))
        envelope = Envelope(vx, vy, wz)
    else:
        assumed.append(base.FOLLOWS)
    description = Description(
        network="policy.pt",
        observation=(
            Term("base_rate", scale["ang_vel_scale"]),
            Term("gravity"),
            Term("twist", base.numbers("cmd_scale", base.at(data, "cmd_scale"), 3)),
            Term("joint_position", scale["dof_pos_scale"], legs),
            Term("joint_velocity", scale["dof_vel_scale"], legs),
            Term("last_action", 1.0, legs),
            Term("phase", 1.0, ("left_sin", "left_cos")),
        ),
        posture=tuple(posture),
        kp=tuple(kp),
        kd=tuple(kd),
        action=ActionScaling(base.numbers("action_scale", base.at(data, "action_scale"), 1)[0]),
        gait=GaitConfig(base.PERIOD, start="always"),
        envelope=envelope,
        rate=1.0 / step,
        joints=legs,
    )
    if motors == list(range(n)):
        assumed.append("The joints are in the order of the leg motors.")
    return base.Passport(
        NAME, path, description, network or _network(path, str(base.at(data, "policy_path"))), tuple(assumed), keys
    )


def _network(path: Path, said: str) -> Path:
    """Return the network at `said`, in the checkout that `path` lies in, or beside `path`."""
    _, marked, inner = said.partition("{LEGGED_GYM_ROOT_DIR}/")
    inside = [folder / inner for folder in path.resolve().parents] if marked else [path.parent / said]
    return base.first_file([path.parent / Path(said).name, *inside])
