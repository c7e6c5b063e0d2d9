"""Whose the motors are: a real robot's own controllers', until they have let go of them."""

from __future__ import annotations

import math
from collections.abc import Callable

from golem.interfaces.unitree_api import OK, decode
from golem.middleware.wire.api import ApiRequest, RpcClient, request_topic, response_topic
from golem.robots.unitree.loco_service import CHECK_MODE, RELEASE_MODE, SERVICE
from golem.runtime.live.clock import Every
from golem.runtime.live.onboard_bridge import Identities
from golem.runtime.live.role_endpoints import RoleEndpoints

CALLS = f"/{request_topic(SERVICE)}"
"""Topic of the calls of the motion switcher."""

ASK = 0.5
"""Time between two questions [s]."""
SILENCE = 2.0
"""Time without an answer after which nobody knows [s]: three questions in a row."""


class MotionSwitcherClient:
    """Asks the motion switcher, again and again, which controller, the `owner`, has the motors; empty if none has."""

    def __init__(self, client: RpcClient, clock: Callable[[], float]) -> None:
        """Ask through `client`, by `clock` [s]."""
        self._client, self._clock = client, clock
        self._identities, self._ask = Identities(), Every(ASK)
        self._asked = 0
        self._answered = -math.inf
        self.owner = ""

    @classmethod
    def on(cls, endpoints: RoleEndpoints, clock: Callable[[], float]) -> MotionSwitcherClient:
        """Ask as the role whose `surface` it is."""
        return cls(RpcClient(endpoints.writer(CALLS), endpoints.reader(f"/{response_topic(SERVICE)}")), clock)

    @property
    def free(self) -> bool:
        """Whether the robot has said lately that none of its own controllers has the motors."""
        return self.known and not self.owner

    @property
    def known(self) -> bool:
        """Whether the robot has said lately who has the motors."""
        return self._clock() - self._answered <= SILENCE

    def poll(self) -> None:
        """Take the answers that have come, and ask again when it is time."""
        now = self._clock()
        for response in self._client.take():
            if self._identities.incoming(response) is None or response.api_id != CHECK_MODE:
                continue
            try:
                name = decode(response.data).get("name")
            except ValueError:
                continue
            if response.code == OK and isinstance(name, str):
                # Escaped: what cannot be encoded could not be reported.
                self._answered, self.owner = now, name.encode("unicode_escape").decode()
        if self._client.connected and self._ask.due(now):
            self._call(CHECK_MODE)

    def release(self) -> None:
        """Tell the robot's controller to let go of the motors; the robot goes limp."""
        self._call(RELEASE_MODE)

    def doubt(self, moving: bool) -> str:
        """Return why the motors may be somebody else's; empty if not. While `moving`, only an answer says so."""
        if self.owner:
            return (
                f"the robot's own controller '{self.owner}' has the motors; "
                "hang the robot up, then: golem safety take --hanging"
            )
        if moving or self.known:
            return ""
        return "the robot's motion switcher does not say whether one of its own controllers has the motors"

    def _call(self, function: int) -> None:
        self._asked += 1
        self._client.send(self._identities.outgoing(ApiRequest(self._asked, function)))
