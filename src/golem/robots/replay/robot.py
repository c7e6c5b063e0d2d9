"""A robot that does again what one did while it was recorded, whatever it is told."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from golem.errors import RobotGone
from golem.robots.replay.log import Log
from golem.types import Array, HandCommand, HandState, Imu, LowCommand, LowState, Side


@dataclass(frozen=True)
class ReplayRobotConfig:
    """Options of the recorded robot.

    Attributes:
        file: folder of a bag, or an MCAP file, with at least /lowstate.
    """

    file: Path


class ReplayRobot:
    """The robot in a bag; see `golem.robots.base.Robot`.

    Its first state is at time 0. Commands move nothing.
    """

    unmoved = "it is a recording"

    def __init__(self, config: ReplayRobotConfig) -> None:
        """Open the bag.

        Raises:
            BagError: there is none, it is damaged, or it holds no state of a robot.
            MissingExtra: the extra `record` is not installed.
        """
        self._file = config.file
        self._log = Log(config.file)
        self._t = 0.0
        self.cameras, self.calibration = self._log.cameras, self._log.calibration

    def advance(self, command: LowCommand, hands: dict[Side, HandCommand], dt: float) -> None:
        """Let time pass; the commands go nowhere.

        Raises:
            RobotGone: the recording is over.
        """
        self._t += dt
        self._log.read(self._t)
        if self._log.end is not None and self._t > self._log.end + dt / 2.0:
            raise RobotGone(f"The recording {self._file} ends after {self._log.end:.2f} s.")

    def joints(self) -> tuple[Array, Array, Array]:
        """Return the recorded q [rad], dq [rad/s] and tau [N m], each (27,)."""
        state = self._state()
        return state.q, state.dq, state.tau

    def imu(self) -> Imu:
        """Return the recorded sample of the torso IMU."""
        return self._state().imu

    def hand(self, side: Side, t: float) -> HandState:
        """Return what one hand reported, stamped `t` [s]; one that was not recorded is closed and feels nothing."""
        state = self._log.hands[side].at(self._t)
        return HandState(t, 0.0, np.zeros(2), np.zeros(2)) if state is None else replace(state, t=t)

    def capture(self, camera: str) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """Return the last recorded exposure of `camera`; before the first it is black, and nothing is near."""
        picture = self._log.pictures[camera].at(self._t)
        if picture is not None:
            return picture
        info = self.cameras[camera]
        return np.zeros((info.height, info.width, 3), np.uint8), np.zeros(
            (info.height, info.width), np.float32
        )

    def close(self) -> None:
        """Do nothing: the bag is closed with the robot."""

    def _state(self) -> LowState:
        state = self._log.states.at(self._t)
        assert state is not None  # the log begins with one
        return state
