"""Where the operator answers: lines on a terminal, `yes 3`, `no 3` or `stop`, and the live view's two buttons."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterable
from pathlib import Path

from golem.agent.desk import Call, Desk

TERMINAL = Path("/dev/tty")
HELP = "Answer 'yes NUMBER' or 'no NUMBER'; 'stop' cancels what runs, 'stop motors' has the safety gate stop the robot."


class ToolOperator:
    """Asks and listens."""

    def __init__(self, desk: Desk, tell: Callable[[str], None], show: Callable[[str | None], None]) -> None:
        """Answer for `desk`; `tell` says a line on the console, `show` a question in the live view."""
        self._desk, self._tell, self._show = desk, tell, show
        self._shown: int | None = None
        desk.on_ask = self._asked

    def _asked(self, text: str | None) -> None:
        if text is not None:
            self._tell(f"May it? {text}   {HELP}")
        self._shown = next(iter(self._desk.asked), None)
        call = None if self._shown is None else self._desk.asked[self._shown]
        self._show(None if call is None else f"[{call.number}] {call.tool} {call.fields}"[:400])

    def decide(self, yes: bool) -> None:
        """Answer the question that the live view shows."""
        if self._shown is not None:
            self._desk.decide(self._shown, yes, "the live view")

    def listen(self, lines: Iterable[str]) -> None:
        """Do what each line says, on a thread of its own."""
        threading.Thread(target=self._listen, args=(lines,), name="operator", daemon=True).start()

    def _listen(self, lines: Iterable[str]) -> None:
        for line in lines:
            word, _, rest = line.strip().partition(" ")
            if word in ("yes", "no") and rest.strip().isdecimal():
                self._desk.decide(int(rest), word == "yes", "the console")
            elif word == "stop":
                self._desk.submit(Call("operator", "stop", {"motors": rest.strip() == "motors"}))
            elif word:
                self._tell(HELP)


def terminal() -> Iterable[str]:
    """Return the lines that an operator types, where stdin is the agent's; none where there is no terminal."""
    try:
        return TERMINAL.open(encoding="utf-8", errors="replace")
    except OSError:
        print("golem: no terminal to ask the operator on; what has to be asked is denied.", file=sys.stderr)
        return ()
