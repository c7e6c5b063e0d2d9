"""`golem calibrate`: a simulated robot calibrates itself; a real one does it with a skill of the same kind."""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from tyro.conf import Positional

from golem.errors import ConfigError
from golem.robots.sensors.calibration_file import read_calibration
from golem.runtime.lockstep import build
from golem.skills.calibrate import CalibrateReport
from golem.stack import load_stack


@dataclass(frozen=True)
class CalibrateConfig:
    """Calibrate the cameras of a simulated robot, and the encoders of its arms, by the tags on its hands.

    On a robot that runs, simulated or real: golem skill calibrate, and then golem skill calibrate_hands.
    """

    what: Positional[Literal["head", "hand"]] = "head"
    """What is calibrated: head, its camera together with the zeros of both arms' encoders; hand, the palm cameras, with
    the head's calibration in --file, to which they are added."""
    stack: str = "tether"
    """Path of a stack file, or the name of a shipped one."""
    profile: str = "field"
    """Realism profile: ideal, bench or field."""
    seed: int = 0
    """Seed of the episode, and so of the errors that are to be found."""
    file: str = "calibration.json"
    """File that is written; a stack takes it as `calibration: {file: calibration.json}`."""
    views: int = 16
    """Postures of each hand."""


def run_calibrate(config: CalibrateConfig) -> bool:
    """Calibrate and print what was found; return whether it succeeded.

    Raises:
        ConfigError: the stack file or an option is wrong, or the head's calibration is not there yet.
    """
    stack = load_stack(config.stack, profile=config.profile).with_options("robot", tags=True)
    file, goal = Path(config.file), {"file": Path(config.file).name, "views": config.views}
    if config.what == "head":
        # What is looked for is not to be corrected by what was found before.
        stack, skill, more = stack.with_part("calibration", file=None), "calibrate", dict[str, Any]()
    else:
        if not file.is_file():
            raise ConfigError(f"There is no '{file}': golem calibrate head --file {file} comes first.")
        zero = float(read_calibration(file).joint_sigma.max())
        stack, skill = stack.with_part("calibration", file=str(file)), "calibrate_hands"
        more = {"zero": zero} if zero else {}
    running, robot = build(stack.with_skill(skill, folder=str(file.parent)), config.seed)
    with closing(robot):
        result = running.execute(skill, goal | more)
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
