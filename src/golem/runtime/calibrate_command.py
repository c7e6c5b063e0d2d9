"""`golem calibrate`: a simulated robot calibrates itself; a real one does it with a skill of the same kind."""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from tyro.conf import Positional

from golem.errors import ConfigError
from golem.robots.sensors.calibration import read_calibration
from golem.runtime.lockstep import build
from golem.skills.calibrate import CalibrateReport
from golem.stack import Stack, load_stack

SKILLS = {"head": "calibrate", "hand": "calibrate_hands", "lidar": "calibrate_lidar"}
"""The skill that calibrates each."""


@dataclass(frozen=True)
class CalibrateConfig:
    """Calibrate cameras, encoders of the arms and LiDAR of a simulated robot.

    On a robot that runs, simulated or real: golem skill calibrate, then golem skill calibrate_hands or
    calibrate_lidar.
    """

    what: Positional[Literal["head", "hand", "lidar"]] = "head"
    """What is calibrated: head, its camera together with the zeros of both arms' encoders, by the tags on its hands;
    hand, the palm cameras, by the same tags; lidar, the LiDAR, by what the head camera sees of a kitchen. Those two
    need the head's calibration in --file, to which they are added."""
    stack: str = "tether"
    """Path of a stack file, or the name of a shipped one."""
    profile: str = "field"
    """Realism profile: ideal, bench or field."""
    seed: int = 0
    """Seed of the episode, and so of the errors that are to be found."""
    file: str = "calibration.json"
    """File that is written; a stack takes it as `calibration: {file: calibration.json}`."""
    views: int | None = None
    """Postures of each hand, or angles of the torso; by default 16, for the LiDAR 5."""


def lidar_stack(stack: Stack) -> Stack:
    """Return `stack` with a twin that listens to its LiDAR, among the upright surfaces of a kitchen."""
    return stack.with_options("robot", world="kitchen").with_choice("odometry", "lio")


def run_calibrate(config: CalibrateConfig) -> bool:
    """Calibrate and print what was found; return whether it succeeded.

    Raises ConfigError: the stack file or an option is wrong, or the head's calibration is not there yet.
    """
    stack = load_stack(config.stack, profile=config.profile)
    file, goal = Path(config.file), dict[str, Any](file=Path(config.file).name)
    if config.views is not None:
        goal["views"] = config.views
    if config.what != "head" and not file.is_file():
        raise ConfigError(f"There is no '{file}': golem calibrate head --file {file} comes first.")
    # What is looked for is not to be corrected by what was found before.
    if config.what == "lidar":
        stack = lidar_stack(stack.with_part("calibration", file=None))
    elif config.what == "head":
        stack = stack.with_part("calibration", file=None).with_options("robot", tags=True)
    else:
        stack = stack.with_part("calibration", file=str(file)).with_options("robot", tags=True)
        if zero := float(read_calibration(file).joint_sigma.max()):
            goal["zero"] = zero
    skill = SKILLS[config.what]
    running, robot = build(stack.with_skill(skill, folder=str(file.parent)), config.seed)
    with closing(robot):
        result = running.execute(skill, goal)
    print(result.reason)
    if not result.success:
        return False
    if isinstance(result.value, CalibrateReport):
        print(
            f"The largest zero error of an encoder is {result.value.joint:.4f} rad; none is known worse than to "
            f"{result.value.joint_sigma:.4f} rad."
        )
    print(f"Written to {config.file}; in a stack file: 'calibration: {{file: {config.file}}}'.")
    return True
