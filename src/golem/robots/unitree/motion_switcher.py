"""The vendor's motion switcher: which of the robot's own controllers has the motors, if any.

The robot starts with one in charge. A client that commands motors itself asks for the mode (check), and releases it
until nobody is in charge; the robot goes limp then, and again when a mode is selected. Numbers: unitree_sdk2_python,
unitree_sdk2py/comm/motion_switcher; status codes: Unitree's G1 developer documents, "Motion switcher service
interface".
"""

from __future__ import annotations

from typing import Final

from golem.interfaces.unitree_api import GET_VERSION, NOT_IMPLEMENTED, OK, decode, encode
from golem.middleware.wire.api import ApiRequest, Response
from golem.robots.unitree.loco_service import LocoService

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
    """Answers calls.

    Attributes:
        mode: the mode in charge; empty after a release.
    """

    def __init__(self, loco: LocoService | None = None) -> None:
        """Begin in the one mode there is.

        Args:
            loco: the service that runs in it; None if this robot has no leg controller of its own.
        """
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
