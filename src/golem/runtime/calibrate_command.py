"""`golem calibrate`: a simulated robot calibrates itself; a real one does it with `golem skill calibrate`."""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from tyro.conf import Positional

from golem.runtime.lockstep import build
from golem.skills.calibrate import CalibrateReport
from golem.stack import load_stack


@dataclass(frozen=True)
class CalibrateConfig:
    """Calibrate the head camera of a simulated robot, and the encoders of its arms, by the tags on its hands.

    On a robot that runs, simulated or real: golem skill calibrate.
    """

    what: Positional[Literal["head"]] = "head"
    """What is calibrated: head, its camera together with the zeros of both arms' encoders."""
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
        ConfigError: the stack file or an option is wrong.
    """
    stack = load_stack(config.stack, profile=config.profile).with_options("robot", tags=True)
    # What is looked for is not to be corrected by what was found before.
    stack = stack.with_part("calibration", file=None)
    file = Path(config.file)
    stack = stack.with_skill("calibrate", folder=str(file.parent))
    running, robot = build(stack, config.seed)
    with closing(robot):
        result = running.execute("calibrate", {"file": file.name, "views": config.views})
    print(result.reason)
    if not result.success:
        return False
    found = result.value
    assert isinstance(found, CalibrateReport)
    print(
        f"The largest zero error of an encoder is {found.joint:.4f} rad; none is known worse than to "
        f"{found.joint_sigma:.4f} rad.\nWritten to {config.file}; in a stack file: "
        f"'calibration: {{file: {config.file}}}'."
    )
    return True
