"""The vendor's loco service as a client meets it: a state machine behind calls, and a velocity that runs out.

States: zero torque, damp, stand up, start; in the last one the robot balances and follows velocities. zero torque and
damp are reached from everywhere, stand up from damp, start once the robot has stood up. Which calls the real service
refuses is not published; these are the transitions that its examples make.

The vendor's motion switcher: which of the robot's own controllers has the motors, if any.

The robot starts with one in charge. A client that commands motors itself asks for the mode (check), and releases it
until nobody is in charge; the robot goes limp then, and again when a mode is selected. Numbers: unitree_sdk2_python,
unitree_sdk2py/comm/motion_switcher; status codes: Unitree's G1 developer documents, "Motion switcher service
interface".
"""

from __future__ import annotations

import math
from typing import Final

from golem.interfaces import unitree_api
from golem.interfaces.unitree_api import GET_VERSION, NOT_IMPLEMENTED, OK, decode, encode
from golem.middleware.wire.api import ApiRequest, Response
from golem.types import Twist


class LocoService:
    """Answers calls; whoever moves the legs asks it for the state and the twist.

    Attributes:
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


SERVICE: Final = "motion_switcher"
VERSION: Final = "1.0.0.1"
CHECK_MODE = 1001
SELECT_MODE = 1002
RELEASE_MODE = 1003
BAD_PARAMETER = 7001
UNKNOWN_MODE = 7004
MODE: Final = "ai"
"""The mode in which the loco service runs [own: the G1's name for it; the H1-2's is not published]."""
FORM: Final = "0"
"""Form of the robot that a check reports: legs, no wheels."""


class MotionSwitcher:
    """Answers calls; `mode` is the mode in charge, empty after a release."""

    def __init__(self, loco: LocoService | None = None) -> None:
        """Begin in the one mode there is, in which `loco` runs; None if the robot has no leg controller of its own."""
        self.mode = MODE
        self._loco = loco

    def answer(self, request: ApiRequest, t: float) -> Response:
        """Act on `request` at time `t` [s]; return the answer, whose data say why where the code is not 0."""
        try:
            code, data = self._act(request)
        except ValueError as error:
            code, data = BAD_PARAMETER, str(error)
        return Response(request.id, request.api_id, code, data)

    def _act(self, request: ApiRequest) -> tuple[int, str]:
        if request.api_id == GET_VERSION:
            return OK, VERSION
        if request.api_id == CHECK_MODE:
            return OK, encode({"form": FORM, "name": self.mode})
        if request.api_id == SELECT_MODE:
            wanted = decode(request.parameter).get("name")
            if wanted != MODE:
                return UNKNOWN_MODE, f"no mode {wanted!r:.60}; there is '{MODE}'"
            if self._loco is not None and not self.mode:
                self._loco.resume()
            self.mode = MODE
            return OK, ""
        if request.api_id == RELEASE_MODE:
            if self._loco is not None:
                self._loco.release()
            self.mode = ""
            return OK, ""
        return NOT_IMPLEMENTED, ""
