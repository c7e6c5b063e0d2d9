"""A client of the safety process that is there already when it is needed: Enter presses the emergency stop.

`golem safety press` starts an interpreter and joins the domain first, which takes seconds on a busy machine. This one
has done both, found the services, and waits for a line.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable
from typing import Any

from golem.errors import GolemError, unknown_name
from golem.interfaces import public
from golem.middleware.ros.future import Future
from golem.middleware.ros.node import RosNode
from golem.middleware.ros.service import Client
from golem.runtime.live.node_setup import ANSWER, find, log_line, member, settle
from golem.runtime.live.operator import REQUESTS, RequestConfig

WORDS = tuple(word for word, (service, _) in REQUESTS.items() if service)
"""What can be typed; an empty line is the first that helps in an emergency: press."""
HELP = (
    "Enter presses the virtual emergency stop, or asks for a stop where there is a board; "
    f"or type {', '.join(WORDS)}. Ctrl-D ends this."
)


def run_console(config: RequestConfig) -> None:
    """Wait for lines on the standard input, and ask the safety process on a domain for what each says.

    Raises:
        RosError: there is none.
    """
    with member("operator", config.dds) as (_, node):
        console = Console(node, lambda answer: node.wait(answer, ANSWER))
        console.connect(f"start it with: {config.dds.command('safety')}")
        settle()
        log_line(HELP)
        console.run(sys.stdin)


class Console:
    """The clients of the safety process's services, and what turns lines into calls."""

    def __init__(
        self, node: RosNode, wait: Callable[[Future[Any]], Any], tell: Callable[[str], None] = log_line
    ) -> None:
        """Call through `node`; `wait` returns what is answered, and `tell` says it."""
        kinds = {row.name: row.type for row in public.SERVICES}
        names = dict.fromkeys(REQUESTS[word][0] for word in WORDS)
        self._clients: dict[str, Client] = {name: node.client(name, kinds[name]) for name in names}
        self._node, self._wait, self._tell = node, wait, tell

    def connect(self, remedy: str) -> None:
        """Find every service, so that no call has to look for it.

        Raises:
            RosError: nobody offers them; `remedy` says what to do.
        """
        for name, client in self._clients.items():
            find(self._node, name, client, remedy)

    def run(self, lines: Iterable[str]) -> None:
        """Ask for what each line says, until there are no more; what fails is said, and the next line counts."""
        for line in lines:
            word = line.strip() or "press"
            try:
                if word not in WORDS:
                    raise unknown_name("request", word, WORDS)
                if not self._ask(word) and word == "press":
                    self._ask("stop")  # a robot with a button of its own has none that can be pressed from here
            except GolemError as error:
                self._tell(str(error))

    def _ask(self, word: str) -> bool:
        service, request = REQUESTS[word]
        answer = self._wait(self._clients[service].call(request))
        self._tell(answer.message)
        return bool(answer.success)
