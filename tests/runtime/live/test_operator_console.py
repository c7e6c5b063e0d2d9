"""Enter presses the emergency stop of a gate that was found before; other words ask for what they say."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from tests.runtime.live.conftest import Live

from golem.interfaces.payloads import GateState
from golem.runtime.live.operator import Console
from golem.types import TICK


def test_enter_presses_and_words_are_asked_for(live: Live) -> None:
    live.activate()
    said: list[str] = []
    states: list[GateState] = []
    _, node = live.member("console")

    def wait(answer: Any) -> Any:
        for _ in range(50):
            live.run(TICK)
            node.poll()
            if answer.done:
                break
        live.run(0.02)
        states.append(live.state)
        return answer.result()

    def lines() -> Iterator[str]:
        yield from ("\n", "release\n", "reste\n")
        live.run(1.5)  # a reset waits for a second, and for rest
        yield from ("reset\n", "activate\n")

    console = Console(node, wait, said.append)
    console.connect("start it")
    console.run(lines())
    assert states == [*[GateState.STOP1] * 4, GateState.ARMED, GateState.ACTIVE]
    assert said[1] == "pressed" and "Did you mean 'reset'?" in said[4] and said[-1] == "active"


def test_a_mistyped_stop_stops(live: Live) -> None:
    live.activate()
    _, node = live.member("console")

    def wait(answer: Any) -> Any:
        while not answer.done:
            live.run(TICK)
            node.poll()
        return answer.result()

    console = Console(node, wait, lambda text: None)
    console.connect("start it")
    console.run(["stpo\n"])
    assert live.state is GateState.STOP1
