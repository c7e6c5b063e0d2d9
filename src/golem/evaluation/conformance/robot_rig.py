"""How the checks of a robot move it and hear it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from golem.evaluation.conformance.base import Inapplicable
from golem.hardware.servo.gains import default_gains
from golem.robots.base import HasLidar, Robot, Unmoved
from golem.types import NUM_JOINTS, SIDES, TICK, Array, HandCommand, HandState, LowCommand, LowState, Side

OPEN, GRIP = 0.08, 6.0
"""Opening of a hand that nobody asks about [m], and the ceiling on its force [N]."""
LIDAR_PATIENCE = 1.0
"""How long a scan is waited for [s]: ten of them."""
Path = Callable[[float], Array]
"""Time since the begin of a motion [s] -> (27,) joints to be sent [rad]."""


class RobotRig:
    """A robot under test."""

    def __init__(self, robot: Robot, posture: Array) -> None:
        """Take hold of `robot`, which is in `posture` (27,) [rad]."""
        self.cameras, self.calibration = robot.cameras, robot.calibration
        self._robot, self._at, self._t = robot, posture, 0.0
        gains = default_gains()
        self._kp, self._kd = gains.kp, gains.kd
        self._hands: dict[Side, HandCommand] = {side: HandCommand(0.0, OPEN, GRIP) for side in SIDES}

    def follow(self, path: Path, seconds: float) -> list[LowState]:
        """Send the joints along `path` with the gains of the servo; return the state of each tick, from time 0 on.

        Raises Inapplicable: no command moves this robot.
        """
        self._need_motion()
        begin, states = self._t, [self._state(0.0)]
        for _ in range(round(seconds / TICK)):
            self._at = path(self._t - begin)
            self._advance()
            states.append(self._state(self._t - begin))
        return states

    def rest(self, seconds: float) -> list[LowState]:
        """Let time pass with the joints where they were sent last; return the state of each tick."""
        states: list[LowState] = []
        for _ in range(round(seconds / TICK)):
            self._advance()
            states.append(self._state(self._t))
        return states

    def grip(self, side: Side, gap: float, force: float, seconds: float) -> HandState:
        """Send one hand to an opening [m] with a ceiling on its force [N]; return what it reports `seconds` later.

        Raises Inapplicable: no command moves this robot.
        """
        self._need_motion()
        self._hands[side] = HandCommand(self._t, gap, force)
        self.rest(seconds)
        return self._robot.hand(side, self._t)

    def picture(self, camera: str) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """Return one exposure: (height, width, 3) colours and (height, width) depth [m], 0 where there is none."""
        return self._robot.capture(camera)

    def scan(self) -> NDArray[np.float32]:
        """Return the (n, 3) points of one LiDAR scan in lidar_link [m]. Raises Inapplicable: it has no LiDAR."""
        if not isinstance(self._robot, HasLidar):
            raise Inapplicable("it has no LiDAR")
        scan = None
        for _ in range(round(2.0 * LIDAR_PATIENCE / TICK)):
            self._advance()
            # The first scan is not whole: the LiDAR may have begun within it.
            _, new = self._robot.lidar(self._t)
            if scan is not None and new is not None:
                return new.points
            scan = new or scan
        raise Inapplicable(f"no scan arrived within {2.0 * LIDAR_PATIENCE:g} s")

    def _advance(self) -> None:
        zero = np.zeros(NUM_JOINTS)
        self._robot.advance(LowCommand(self._t, self._at, zero, zero, self._kp, self._kd), self._hands, TICK)
        self._t += TICK

    def _state(self, t: float) -> LowState:
        q, dq, tau = self._robot.joints()
        return LowState(t, q.copy(), dq.copy(), tau.copy(), self._robot.imu())

    def _need_motion(self) -> None:
        if isinstance(self._robot, Unmoved):
            raise Inapplicable(f"no command moves it: {self._robot.unmoved}")
