"""The twin's on-board computer: the vendor's services on the bus, and the legs it controls itself."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from golem import registry
from golem.capabilities.legs.base import STANDING
from golem.capabilities.legs.hold import STANCES, HoldConfig, JointHold
from golem.capabilities.legs.locomotion import Locomotion, LocomotionConfig
from golem.capabilities.legs.vendor import damp
from golem.errors import ModuleFault
from golem.interfaces import topics
from golem.interfaces.payloads import LegCommand
from golem.interfaces.unitree_api import LOCO_API, LOCO_APIS, LocoApi
from golem.middleware.bus import Bus, News
from golem.middleware.wire.api import ApiRequest, Response
from golem.robots.unitree.loco_service import LocoService
from golem.runtime.executor import Node
from golem.runtime.lower_body_node import CheckedLowerBody
from golem.stack import Stack
from golem.types import LEGS, TICK, BaseEstimate, LowState

ANSWER = 0.004
"""Time a call takes to be answered [s] [own: two servo periods, so that no client can count on an answer at once]."""
STANCE = "crouch"
"""Where the stand-up state ends."""


def stack_loco_api(stack: Stack) -> LocoApi:
    """Return the loco service that the legs of `stack` speak to, or the assumed. Raises ConfigError: wrong options."""
    client = stack.onboard_client
    config = None if client is None else registry.configure("lower_body", client.use, client.options)
    return getattr(config, "loco_api", LOCO_APIS[LOCO_API])


class BusOnboard:
    """The on-board computer behind the bus; see `vendor.Onboard`."""

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
        self._news: dict[str, News[Response]] = {}

    def send(self, service: str, request: ApiRequest) -> None:
        if service not in self._news:
            self._news[service] = News(self._bus, topics.api_response(service))
        self._bus.publish(topics.api_request(service), request, 0.0)  # no latency: the time has no meaning

    def receive(self, service: str) -> Response | None:
        return self._news[service].read() if service in self._news else None

    def legs(self) -> LegCommand | None:
        return self._bus.latest(topics.ONBOARD_LEGS)


class ServiceNode(Node):
    """Answers the calls to one service, one per tick."""

    period = math.inf

    def __init__(self, bus: Bus, service: str, answer: Callable[[ApiRequest, float], Response]) -> None:
        """Serve `service` on `bus`; `answer` acts on a call at a time [s]."""
        self._bus, self._answer = bus, answer
        self._topic = topics.api_response(service)
        self.wakes = (topics.api_request(service),)
        self._requests = News(bus, topics.api_request(service))

    def step(self, t: float) -> None:
        request = self._requests.read()
        if request is None:
            return
        response = self._answer(request, t)
        if not request.noreply:
            self._bus.publish(self._topic, response, t, ANSWER)


class LocoServiceNode(Node):
    """Answers calls, and controls the legs on board in the state that was called for.

    In the start state the robot is controlled by any lower body, under a base layer of its own. A controller that fails
    is not replaced: the robot damps, and the service refuses to go on.
    """

    period = TICK

    def __init__(self, bus: Bus, api: LocoApi, legs: CheckedLowerBody, config: LocomotionConfig | None = None) -> None:
        """Serve `api` on `bus`, with `legs` for the start state, under a base layer with `config`."""
        self._bus, self._legs = bus, legs
        self.service = LocoService(api)
        self._state = self.service.state
        self._hold = JointHold(HoldConfig(stance=STANCE, speed=1.0, standing=True))
        self._locomotion = Locomotion(legs.controller, config)
        self._calls = ServiceNode(bus, api.service, self.service.answer)

    def step(self, t: float) -> None:
        self._calls.step(t)
        state = self._bus.latest(topics.LOW_STATE)
        base = self._bus.latest(topics.BASE)
        if state is None or base is None:
            return
        try:
            command, latency = self._control(state, base, t), self._legs.check_latency()
        except ModuleFault as fault:
            self.service.fail(str(fault))
            command, latency = damp(state), 0.0
        self._bus.publish(topics.ONBOARD_LEGS, command, t, latency)

    def _control(self, state: LowState, base: BaseEstimate, t: float) -> LegCommand:
        """Return what the legs are told in the present state of the service."""
        service, contract = self.service, self._legs.contract
        entered, self._state = service.state != self._state, service.state
        if service.state == service.api.start:
            if entered:
                contract.call(self._locomotion.reset, state)
            command = contract.call(self._locomotion.step, state, base, service.twist(t), TICK)
            return self._legs.check(command)
        if service.state == service.api.stand_up:
            if entered:
                self._hold.reset(state)
            command = self._hold.step(state, base, STANDING, TICK)
            service.standing = bool(np.allclose(command.q, np.tile(STANCES[STANCE], 2)))
            return command
        if service.state == service.api.damp:
            return damp(state)
        zero = np.zeros(LEGS.stop)
        return LegCommand(state.q[LEGS].copy(), zero, zero, zero)
