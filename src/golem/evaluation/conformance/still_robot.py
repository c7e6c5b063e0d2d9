"""A robot without physics, for suites that need a whole stack: its joints are where they are sent."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from golem.evaluation.conformance import samples
from golem.interfaces.payloads import LegCommand
from golem.interfaces.unitree_api import LOCO_API, loco_api
from golem.middleware.wire.api import ApiRequest, Response
from golem.robots.sensors.cameras import CAMERAS
from golem.robots.unitree.loco_service import LocoService
from golem.types import LEGS, NUM_JOINTS, TICK, Array, HandCommand, HandState, Imu, LowCommand, Side

HAND_SPEED = 0.2
"""How fast a hand opens and closes [m/s]."""


class StillRobot:
    """See `golem.robots.base.Robot`; cameras see a plate with dark spots, wherever they are."""

    unmoved = "it has no physics"

    def __init__(self) -> None:
        self.cameras = CAMERAS
        self.calibration: dict[str, Array] = {name: np.eye(4) for name in CAMERAS}
        self._q = samples.posture()
        self._dq: Array = np.zeros(NUM_JOINTS)
        self._gaps: dict[Side, float] = {"left": 0.108, "right": 0.108}

    def advance(self, command: LowCommand, hands: dict[Side, HandCommand], dt: float) -> None:
        """Put every joint that has a stiffness where it is sent."""
        q = np.where(command.kp > 0.0, command.q, self._q)
        self._dq, self._q = (q - self._q) / dt, q
        for side, hand in hands.items():
            way = hand.gap - self._gaps[side]
            self._gaps[side] += float(np.clip(way, -HAND_SPEED * dt, HAND_SPEED * dt))

    def joints(self) -> tuple[Array, Array, Array]:
        """Return positions, velocities and no torques."""
        return self._q.copy(), self._dq.copy(), np.zeros(NUM_JOINTS)

    def imu(self) -> Imu:
        """Return the sample of a robot that stands upright."""
        return Imu(np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), np.array([0.0, 0.0, 9.81]))

    def hand(self, side: Side, t: float) -> HandState:
        """Return the report of a hand that touches nothing."""
        return samples.hand_state(t, self._gaps[side])

    def capture(self, camera: str) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """Return the picture of the plate."""
        frame = samples.image(0.0, self.cameras[camera])
        return frame.rgb.copy(), frame.depth.copy()

    def close(self) -> None:
        """Hold nothing."""


class StillOnboard:
    """The on-board computer of a robot that stands: it answers every call, and its legs hold their joints."""

    def __init__(self) -> None:
        self._service = LocoService(loco_api(LOCO_API))
        self._service.standing = True
        self._answer: Response | None = None
        self._t = 0.0

    def send(self, service: str, request: ApiRequest) -> None:
        """Answer `request`."""
        self._answer = self._service.answer(request, self._t)
        self._service.standing = True

    def receive(self, service: str) -> Response | None:
        """Return the answer, once."""
        answer, self._answer = self._answer, None
        return answer

    def legs(self) -> LegCommand | None:
        """Return legs that stay."""
        q = samples.posture()[LEGS]
        self._t += TICK
        return LegCommand(q, np.full(LEGS.stop, 200.0), np.full(LEGS.stop, 4.0), np.zeros(LEGS.stop))
