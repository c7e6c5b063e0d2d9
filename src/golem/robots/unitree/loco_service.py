"""The vendor's loco service as a client meets it: a state machine behind calls, and a velocity that runs out.

States: zero torque, damp, stand up, start; in the last one the robot balances and follows velocities. zero torque and
damp are reached from everywhere, stand up from damp, start once the robot has stood up. Which calls the real service
refuses is not published; these are the transitions that its examples make.
"""

from __future__ import annotations

import math

from golem.interfaces import unitree_api
from golem.middleware.wire.api import ApiRequest, Response
from golem.types import Twist


class LocoService:
    """Answers calls; whoever moves the legs asks it for the state and the twist.

    Attributes:
        api: its numbers.
        state: id of the present state.
        standing: whether the legs have reached the standing posture; set by whoever moves them.
        failure: why the legs cannot be controlled; empty while they can. Set by whoever moves them.
        released: whether the motion switcher has taken the legs away; every call but for the version is refused then.
    """

    def __init__(self, api: unitree_api.LocoApi) -> None:
        """Begin limp, as after power-on."""
        self.api = api
        self.state = api.zero_torque
        self.standing = False
        self.failure = ""
        self.released = False
        self._twist = Twist()
        self._until = -math.inf

    def answer(self, request: ApiRequest, t: float) -> Response:
        """Act on `request` at time `t` [s]; return the answer, whose data say why where the code is not 0."""
        try:
            code, data = self._act(request, t)
        except ValueError as error:
            code, data = unitree_api.BAD_PARAMETER, str(error)
        return Response(request.id, request.api_id, code, data)

    def twist(self, t: float) -> Twist:
        """Return the velocity to follow at time `t` [s]; zero once the duration it was given for is over."""
        return self._twist if t < self._until else Twist()

    def fail(self, reason: str) -> None:
        """Damp, and refuse to start again: the legs cannot be controlled for `reason`."""
        self.failure = reason
        self._enter(self.api.damp)

    def release(self) -> None:
        """Go limp, and refuse calls until `resume`."""
        self.released = True
        self._enter(self.api.zero_torque)

    def resume(self) -> None:
        """Begin anew, limp, as after power-on; a failure remains."""
        self.released = False

    def _act(self, request: ApiRequest, t: float) -> tuple[int, str]:
        api = self.api
        if request.api_id == unitree_api.GET_VERSION:
            return unitree_api.OK, api.version
        if self.released:
            return api.not_available, "the motion mode is released"
        if request.api_id == api.get_fsm_id:
            return unitree_api.OK, unitree_api.encode({"data": self.state})
        if request.api_id == api.set_fsm_id:
            wanted = unitree_api.decode_int(request.parameter)
            if not self._reachable(wanted):
                return api.invalid_fsm_id, self.failure
            self._enter(wanted)
            return unitree_api.OK, ""
        if request.api_id == api.set_velocity:
            velocity, duration = unitree_api.decode_velocity(request.parameter)
            if self.state != api.start:
                return api.not_available, self.failure
            self._twist, self._until = Twist(*velocity), t + duration
            return unitree_api.OK, ""
        return unitree_api.NOT_IMPLEMENTED, ""

    def _reachable(self, state: int) -> bool:
        api = self.api
        if state in (api.zero_torque, api.damp):
            return True
        if state == api.stand_up:
            return self.state in (api.damp, api.stand_up) and not self.failure
        return state == api.start and (self.state == api.start or (self.state == api.stand_up and self.standing))

    def _enter(self, state: int) -> None:
        if state != self.state:
            self.standing = False
            self._until = -math.inf
        self.state = state
