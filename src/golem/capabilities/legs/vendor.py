"""Lower body that leaves the legs to the vendor's own controller and tells it, by remote calls, what to do.

The calls are those of the vendor's LocoClient: damp, stand up, start, velocity. On the robot the on-board controller
then moves the legs itself: nobody else may command them, so that the stack's leg targets must not reach `rt/lowcmd`
while this module is in charge. In the twin the on-board controller's targets are handed back here and take the way of
every other controller's, through motor control and the safety gate.
"""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from golem.capabilities.legs.base import Envelope, LocomotionCommand
from golem.capabilities.legs.gait import GaitConfig
from golem.errors import ConfigError, GolemError
from golem.interfaces.payloads import LegCommand
from golem.interfaces.unitree_api import LOCO_API, OK, LocoApi, decode_int, encode, loco_api
from golem.middleware.wire.api import ApiRequest, Response
from golem.options import require
from golem.types import LEGS, Array, BaseEstimate, LowState, Twist

DAMPING: Array = np.full(LEGS.stop, 5.0)
"""Damping of legs that nobody controls [N m s/rad], as in the safety gate's damping stop."""
SETTLE = 0.1
"""Time without a reset before the robot is spoken to [s]: while the safety gate is shut, every tick begins with one."""

Wait = Generator[None, None, None]


class VendorFault(GolemError):
    """The on-board controller does not answer, refuses, or was to be told something it must not be told."""


class Onboard(Protocol):
    """The robot's own computer, as a client sees it."""

    def send(self, service: str, request: ApiRequest) -> None:
        """Send `request` to `service`."""

    def receive(self, service: str) -> Response | None:
        """Return the newest response of `service` if it came since the last call, else None."""
        ...

    def legs(self) -> LegCommand | None:
        """Return what the on-board controller tells the legs now; None while it tells them nothing that can be seen."""
        ...


@dataclass(frozen=True, slots=True)
class VendorConfig:
    """Options of `Vendor`.

    Attributes:
        robot: whose loco service is spoken to, a name in `LOCO_APIS`.
        envelope: twists that are passed on; the vendor publishes none for this robot [own: what users drive it at].
        timeout: time within which a call must be answered [s]; the SDK's default.
        stand_up: time between the calls to stand up and to start [s].
        refresh: time between two velocities [s].
        duration: how long the robot may follow a velocity that is not refreshed [s].
    """

    robot: str = LOCO_API
    envelope: Envelope = Envelope((-0.4, 0.8), (-0.3, 0.3), (-0.6, 0.6))
    timeout: float = 1.0
    stand_up: float = 1.0
    refresh: float = 0.1
    duration: float = 0.5

    @property
    def loco_api(self) -> LocoApi:
        """The loco service that is spoken to. Raises ConfigError: `robot` has none."""
        return loco_api(self.robot)


class Vendor:
    """Brings the on-board controller from whatever state it is in to its start state, then passes twists on.

    A controller that has started already is not damped first: it may carry the robot.

    Attributes:
        rate, latency, envelope, gait: see `LowerBody`; the gait clock is the on-board controller's own.
        started: whether the on-board controller has confirmed its start state.
    """

    requires = ("onboard",)

    def __init__(self, config: VendorConfig | None = None, onboard: Onboard | None = None) -> None:
        """Speak to `onboard`. Raises ConfigError: there is none, the robot is unknown, or a time is not positive."""
        self.config = c = config or VendorConfig()
        if onboard is None:
            raise ConfigError(
                "lower_body: vendor needs the robot's own computer, which only a stack that runs on a twin connects to."
            )
        times = {name: getattr(c, name) for name in ("timeout", "stand_up", "refresh", "duration")}
        require("vendor's ", *((n, t, 0.0 < t < math.inf, "a positive time in seconds") for n, t in times.items()))
        if c.refresh >= c.duration:
            raise ConfigError(
                f"vendor's refresh ({c.refresh:g} s) must be shorter than its duration ({c.duration:g} s), "
                "or the robot stops between two velocities."
            )
        self.rate = 500.0
        self.latency = 0.0
        self.envelope = c.envelope
        self.gait = GaitConfig(start="never")
        self.started = False
        self._api = c.loco_api
        self._onboard = onboard
        self._t = 0.0
        self._id = 0
        self._twist = Twist()
        self._fault: VendorFault | None = None
        self._session = self._run()

    @property
    def follows(self) -> bool:
        """Whether velocities are passed on now; see `Following`."""
        return self.started

    def reset(self, state: LowState) -> None:
        """Begin a new session; answers to earlier calls are void."""
        self.started = False
        self._fault = None
        self._session = self._run()

    def step(self, state: LowState, base: BaseEstimate, motion: LocomotionCommand, dt: float) -> LegCommand:
        """Go on with the session; return what the on-board controller tells the legs. See `LowerBody.step`.

        Raises VendorFault: a call was not answered in time or was refused, or the twist is not finite. The session is
        over until `reset`.
        """
        if self._fault is not None:
            raise self._fault
        self._t += dt
        self._twist = motion.twist
        try:
            next(self._session)
        except VendorFault as fault:
            self.started = False
            self._fault = fault
            raise
        legs = self._onboard.legs()
        # A controller that lets go commands no damping: limp legs are not passed on while the next call tells why.
        return legs if legs is not None and bool((legs.kd > 0.0).all()) else damp(state)

    def _run(self) -> Wait:
        api = self._api
        yield from self._wait(SETTLE)
        state = yield from self._ask_state()
        if state not in (api.stand_up, api.start):
            if state != api.damp:
                yield from self._set_state(api.damp)
            yield from self._set_state(api.stand_up)
        if state != api.start:
            yield from self._wait(self.config.stand_up)
            yield from self._set_state(api.start)
        self.started = True
        while True:
            sent, sent_at = self._twist, self._t
            yield from self._call(api.set_velocity, self._velocity(sent))
            # The base layer corrects the twist at every tick; starts and stops alone are not to wait.
            while (self._twist == Twist()) == (sent == Twist()) and self._t < sent_at + self.config.refresh:
                yield

    def _velocity(self, twist: Twist) -> str:
        values = [twist.vx, twist.vy, twist.wz]
        try:
            return encode({"velocity": values, "duration": self.config.duration})
        except ValueError as error:
            raise VendorFault(f"The twist {values} is not finite; the robot is not sent one.") from error

    def _ask_state(self) -> Generator[None, None, int]:
        data = yield from self._call(self._api.get_fsm_id, repeat=True)
        try:
            return decode_int(data)
        except ValueError as error:
            raise VendorFault(f"The robot's '{self._api.service}' service answered nonsense: {error}.") from error

    def _set_state(self, state: int) -> Wait:
        yield from self._call(self._api.set_fsm_id, encode({"data": state}))

    def _call(self, api_id: int, parameter: str = "", repeat: bool = False) -> Generator[None, None, str]:
        """Call a function of the loco service; return the data of the answer.

        With `repeat` the call is sent once more after half of the time: DDS may lose what is written before the
        two sides know each other, and so the first call or its answer.
        """
        api, deadline = self._api, self._t + self.config.timeout
        again = self._t + self.config.timeout / 2 if repeat else math.inf
        self._id += 1
        request = ApiRequest(self._id, api_id, parameter)
        self._onboard.send(api.service, request)
        call = f"{api.function(api_id)}({parameter})"
        while True:
            yield
            response = self._onboard.receive(api.service)
            if response is not None and (response.id, response.api_id) == (self._id, api_id):
                if response.code != OK:
                    why = response.data or api.meaning(response.code)
                    raise VendorFault(
                        f"The robot's '{api.service}' service refused {call}: code {response.code}, {why}."
                    )
                return response.data
            if self._t >= again:
                again = math.inf
                self._onboard.send(api.service, request)
            if self._t >= deadline:
                raise VendorFault(
                    f"The robot's '{api.service}' service did not answer {call} within {self.config.timeout:g} s."
                )

    def _wait(self, seconds: float) -> Wait:
        end = self._t + seconds
        while self._t < end:
            yield


def damp(state: LowState) -> LegCommand:
    """Return the command under which the legs of the robot in `state` give way slowly."""
    zero = np.zeros(LEGS.stop)
    return LegCommand(state.q[LEGS].copy(), zero, DAMPING.copy(), zero)
