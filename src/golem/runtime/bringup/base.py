"""The words of the bring-up: a check, what it found, and the person beside the robot."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Protocol

from tyro.conf import OmitArgPrefixes

from golem.errors import ConfigError, GolemError
from golem.hardware.estop.estop_config import EstopConfig
from golem.interfaces.public import CAMERAS
from golem.middleware.dds.domain import DdsConfig
from golem.runtime.bringup.robot_link import RobotLink
from golem.runtime.live.launch import Process
from golem.types import SIDES

DEVICES = (*(f"{camera} camera" for camera in CAMERAS), "lidar", *(f"{side} hand" for side in SIDES))
"""What can be declared absent."""


class StepRefused(GolemError):
    """A check failed; the bring-up goes no further until it passes."""


class Act(StrEnum):
    """What a person is asked to do with the robot; the check looks at what comes of it."""

    MOVE = "move"
    LET_GO = "let go"
    PRESS = "press"
    RELEASE = "release"


@dataclass(frozen=True, slots=True)
class Task:
    """Something a person is asked to do.

    Attributes:
        text: how, in one sentence.
        joint: index of the joint that is to be moved; -1 for other acts.
        positive: whether in its positive direction.
    """

    act: Act
    text: str
    joint: int = -1
    positive: bool = True


class BringupPerson(Protocol):
    """Whoever stands beside the robot."""

    def tell(self, text: str) -> None:
        """Say something."""

    def confirm(self, question: str, word: str) -> bool:
        """Return whether they answer with exactly `word`."""
        ...

    def act(self, task: Task) -> None:
        """Ask for something to be done; returns at once."""


@dataclass(frozen=True, slots=True)
class StepFinding:
    """What a check found.

    Attributes:
        passed: whether the bring-up may go on.
        figures: what was measured, by name with unit.
    """

    passed: bool
    text: str
    figures: dict[str, float | str] = field(default_factory=dict[str, float | str])


@dataclass(frozen=True)
class BringupConfig:
    """Bring a robot up step by step: each step is checked, and nothing goes on where one fails.

    A report is written at the end. What passed before is not repeated, but for what has to hold each time.
    """

    report: str = "runs/bringup"
    """Folder of the report; its `bringup.json` says what has passed."""
    again: tuple[str, ...] = ()
    """Checks to repeat that have passed before: joints, motion, sensors."""
    without: tuple[str, ...] = ()
    """Devices that this robot does not have, e.g. "lidar" "left hand"; the report says so."""
    share: float = 0.25
    """Share of the servo's gains in the first motion under power."""
    patience: float = 60.0
    """How long is waited for what a person was asked to do [s]."""
    estop: EstopConfig = field(default_factory=EstopConfig)
    """The emergency stop; a real robot has a serial one."""
    dds: OmitArgPrefixes[DdsConfig] = field(default_factory=DdsConfig)

    def __post_init__(self) -> None:
        unknown = [name for name in self.without if name not in DEVICES]
        if unknown:
            raise ConfigError(f"There is no device '{unknown[0]}'; choose among: {', '.join(DEVICES)}.")
        if not 0.05 <= self.share <= 0.5:
            raise ConfigError(f"The share of the gains is 0.05 to 0.5, not {self.share:g}.")
        if self.dds.robot and self.estop.use != "serial":
            raise ConfigError("A real robot needs its e-stop board: --estop.use serial --estop.port /dev/ttyACM0.")


@dataclass
class Workbench:
    """What the checks work with; `gate` is there once it was started."""

    link: RobotLink
    person: BringupPerson
    config: BringupConfig
    start_gate: Callable[[], Process]
    gate: Process | None = None

    def need_gate(self) -> None:
        """Start the gate unless it runs. Raises StepRefused: it has ended."""
        if self.gate is None:
            self.gate = self.start_gate()
        if self.gate.code is not None:
            raise StepRefused(f"The safety gate has ended with exit code {self.gate.code}.")


@dataclass(frozen=True, slots=True)
class BringupStep:
    """One step.

    Attributes:
        name: one word, in the report and the file of what has passed.
        lasting: whether it holds beyond this session, so that it is not repeated.
    """

    name: str
    title: str
    run: Callable[[Workbench], StepFinding]
    lasting: bool = False
