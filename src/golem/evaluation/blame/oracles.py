"""What can be exchanged for truth, slot by slot, and which defects can be planted: two tables, a line each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from golem import registry
from golem.errors import ConfigError, unknown_name
from golem.robots.mujoco.config import WITH_PACK
from golem.robots.sensors.profiles import load_profile
from golem.runtime.node_groups import hears_lidar
from golem.slots import KEYS
from golem.stack import Choice, Stack

HERE = "golem.evaluation.blame."
ALTERED = f"{HERE}altered_twin:AlteredTwin"
TRUE = f"{HERE}true_modules:"
MASKS = "golem.evaluation.episodes.true_masks:TrueMasks"
STANDS, HANGS, HEARS, PACK = "stands", "hangs", "listens to its LiDAR", "works on a pack"


class NotHere(ConfigError):
    """An oracle has nothing to exchange in a stack."""


@dataclass(frozen=True, slots=True)
class Exchange:
    """One thing of a stack that is exchanged.

    Attributes:
        words: what takes its place.
        parts: of the realism profile that become those of `ideal`.
        choices: key of the stack file -> implementation.
        twin: options of the altered twin.
        only: what a robot does that has it, `STANDS` to `PACK`; empty is all.
        sizes: of a defect, from small to large: what `SIZE` stands for.
        option: of a defect: key of the stack file and option that is a size; the twin's where the key is `robot`.
        rung, right: of a defect: where it is tried, and the oracle that makes up for it.
    """

    words: str
    parts: tuple[str, ...] = ()
    choices: Mapping[str, str] = field(default_factory=dict[str, str])
    twin: Mapping[str, Any] = field(default_factory=dict[str, Any])
    only: str = ""
    sizes: tuple[float, ...] = ()
    option: tuple[str, str] = ("", "")
    rung: str = ""
    right: str = ""


# fmt: off
ORACLES: dict[str, Exchange] = {
    "detections": Exchange("the simulator's masks in the localizer's place", choices={"localizer": MASKS}),
    "depth": Exchange("depth and colour without noise", ("depth", "colour_noise")),
    "head": Exchange("a head camera that is where its calibration says", ("head",)),
    "palm": Exchange("palm cameras that are where their calibration says", ("palm",)),
    "lenses": Exchange("lenses as the cameras claim them", ("focal", "principal")),
    "grasp": Exchange("the shipped closed loop in the grasp method's place", choices={"grasp_method": "visual_servo"},
                      only=PACK),
    "arms": Exchange("arms without encoder error and dry friction under the shipped control",
                     ("arm_offset", "zeros", "arm_friction"), {"upper_body": "diff_ik", "planner": "rrt_connect"}),
    "hand": Exchange("the shipped hand with pads of three times the friction", choices={"hand": "magpie"},
                     twin={"grip": 3.0}),
    "base": Exchange("the true pose and velocity of the base", ("imu",), {"estimator": f"{TRUE}TrueBase"}),
    "odometry": Exchange("the true way of the base", choices={"odometry": f"{TRUE}TrueOdometry"}, only=HEARS),
    "legs": Exchange("a pelvis that is held, on legs without error", ("leg_offset", "leg_friction"),
                     twin={"held": True, "leg_torque": 1.0}, only=STANDS),
    "delay": Exchange("commands that act at once, and sound reports of the motors", ("actuator_delay", "motors"),
                      twin={"latency": 0.0}),
    "sway": Exchange("a hoist that hangs still", ("hoist_sway",), only=HANGS),
}
"""Oracle -> what it exchanges. Skills, memory, navigator, mapper, servo and gate have none."""

DEFECTS: dict[str, Exchange] = {
    "shifted_detector": Exchange("objects are seen beside their places [m]",
        choices={"localizer": f"{TRUE}ShiftedDetector"}, option=("localizer", "shift"),
        sizes=(0.004, 0.008, 0.012, 0.018, 0.026), rung="tether", right="detections"),
    "slow_ik": Exchange("speed of the arms [rad/s]", option=("upper_body", "arm_speed"),
        sizes=(0.4, 0.2, 0.1, 0.05, 0.025), rung="tether", right="arms"),
    "weak_legs": Exchange("share of the leg motors' torque", option=("robot", "leg_torque"),
        sizes=(0.5, 0.4, 0.3, 0.2, 0.1), rung="stand", right="legs"),
    "odometry_scale": Exchange("length of a way over the true one",
        choices={"odometry": f"{TRUE}ScaledOdometry"}, option=("odometry", "scale"),
        sizes=(1.02, 1.05, 1.1, 1.15, 1.2), rung="navigate", right="odometry"),
    "loose_grip": Exchange("share of the force of the fingers", choices={"hand": f"{TRUE}LooseHand"},
        option=("hand", "share"), sizes=(0.5, 0.3, 0.2, 0.1, 0.05), rung="tether", right="hand"),
    "late_gate": Exchange("time by which commands pass late [s]", option=("robot", "latency"),
        sizes=(0.02, 0.04, 0.08, 0.12, 0.2), rung="stand", right="delay"),
}
"""Defect -> what it spoils; `--use defect=NAME:1` plants its smallest size, 5 its largest."""
# fmt: on


def with_modules(stack: Stack, overrides: Mapping[str, str]) -> Stack:
    """Return `stack` with what a command replaces in it.

    Args:
        stack: any.
        overrides: key of the stack file -> implementation; `defect` -> NAME:SIZE of `DEFECTS`, several with `+`;
            `oracle` -> names of `ORACLES`, several with `+`. Oracles come last. `localizer=truth` is one, too.

    Raises:
        ConfigError: a slot, a name or an option is wrong; `NotHere` where an oracle exchanges nothing.
    """
    others = dict(overrides)
    defects, oracles = (others.pop(key, "") for key in ("defect", "oracle"))
    if others.get("localizer") == "truth":
        del others["localizer"]
        oracles = f"{oracles}+detections".strip("+")
    for slot, use in others.items():
        stack = stack.with_choice(slot, use)
    for word in defects.split("+") if defects else ():
        name, _, size = word.partition(":")
        if name not in DEFECTS:
            raise unknown_name("defect", name, DEFECTS)
        if size not in ("1", "2", "3", "4", "5"):
            raise ConfigError(f"A defect reads NAME:SIZE with a size from 1 to 5, e.g. {name}:3, not '{word}'.")
        one = DEFECTS[name]
        stack = exchanged(stack, one)
        stack = stack.with_options(one.option[0], **{one.option[1]: one.sizes[int(size) - 1]})
    for name in oracles.split("+") if oracles else ():
        if name not in ORACLES:
            raise unknown_name("oracle", name, ORACLES)
        one, before = ORACLES[name], stack
        if one.only and one.only not in _does(stack):
            raise NotHere(f"The oracle '{name}' is for a robot that {one.only}, and this one does not.")
        stack = exchanged(stack, one)
        if _numbers(stack) == _numbers(before):
            raise NotHere(f"The oracle '{name}' would exchange nothing here.")
    return stack


def _does(stack: Stack) -> set[str]:
    does = {STANDS if stack.on_ground else HANGS, *([HEARS] if hears_lidar(stack) else ())}
    return does | ({PACK} if stack.choice("robot").options.get("world", "pack") in WITH_PACK else set())


def _numbers(stack: Stack) -> tuple[object, ...]:
    """Return what a trial of `stack` depends on."""
    choices = {key: stack.choice(key) for key in KEYS}
    robot = registry.configure("robot", ALTERED, choices.pop("robot").options)
    return choices, robot, replace(load_profile(stack.profile), name="")


def exchanged(stack: Stack, what: Exchange) -> Stack:
    """Return `stack` with one exchange.

    Raises:
        ConfigError: its robot is not the MuJoCo twin.
    """
    robot = stack.choice("robot")
    if robot.use not in ("mujoco", ALTERED):
        raise ConfigError(f"Only robot: mujoco can be altered for --use oracle=... and defect=..., not {robot.use}.")
    for key, use in what.choices.items():
        stack = stack.with_choice(key, Choice(use))
    if what.parts:
        stack = replace(stack, profile=f"{stack.profile}:{'+'.join(what.parts)}")
    return stack.with_choice("robot", Choice(ALTERED, {**robot.options, **what.twin}))
