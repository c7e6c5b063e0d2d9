"""Says that nobody answers the calls of the vendor's LocoClient: the SDK's side learns it by a timeout alone."""

from __future__ import annotations

from collections.abc import Callable

from golem.interfaces import topics
from golem.interfaces.unitree_api import LocoApi
from golem.middleware.bus import Bus, News
from golem.types import TICK


class UnansweredCalls:
    """Reads the calls to the loco service of a robot that has no such service, and says so at the first."""

    period = TICK

    def __init__(self, bus: Bus, api: LocoApi, tell: Callable[[str], None]) -> None:
        """Read the calls to the service of `api` on `bus`; `tell` says a line to a person."""
        self._news, self._api, self._tell = News(bus, topics.api_request(api.service)), api, tell
        self._reported = False

    def step(self, t: float) -> None:
        """Look for a call."""
        call = self._news.read()
        if call is None or self._reported:
            return
        self._reported = True
        self._tell(
            f"A LocoClient calls {self._api.function(call.api_id)} of the service '{self._api.service}'. "
            "Nobody answers it: this robot has no legs on board. "
            "They come with this line in the stack file: lower_body: {use: vendor}."
        )
