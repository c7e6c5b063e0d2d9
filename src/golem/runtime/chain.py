"""The 500 Hz chain: the nodes that have a turn at every tick, run as compiled stages over one record.

A node joins by its `link`. The chain moves what the stages read from the bus into the record, runs as many of them in
one compiled call as nobody else comes between, and shows on the bus what they wrote; such messages are only made when
somebody reads them. Where a stage says that a tick is not ordinary, the node itself has its turn instead, as it would
without a chain, and the chain goes on behind it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol, runtime_checkable

import numpy as np

from golem.interfaces import topics
from golem.interfaces.payloads import ArmCommand, EstopMessage, GateState, GateStatus, LegCommand
from golem.kernels import njit
from golem.middleware.bus import Bus, Deferred, Topic
from golem.native import LOOK, UNUSUAL, CompiledStage, Records, address, call_stage, new_shared, shared
from golem.native_messages import base_of, command_of, put_command, put_legs, put_state, state_of
from golem.runtime.executor import Node
from golem.types import SIDES, TICK, BaseEstimate, HandState, LowCommand


@dataclass(frozen=True)
class Link:
    """How a node takes part in the chain.

    Attributes:
        node: the node, whose `step` does the ticks that are not ordinary.
        prepare: called with the time [s] before the stage runs; returns whether it may. None: it always may.
        passed: called with the number of ticks that it has run; None where nobody counts.
    """

    node: Node
    stage: CompiledStage
    reads: tuple[Topic[Any], ...]
    writes: tuple[Topic[Any], ...]
    prepare: Callable[[float], bool] | None = None
    passed: Callable[[int], None] | None = None


@runtime_checkable
class HasLink(Node, Protocol):
    """A node that may take part in the chain."""

    def link(self) -> Link | None:
        """Return how; None where its module has no compiled part."""
        ...


class _Port:
    """One topic as the record has it: how its messages get in, and how they are made."""

    __slots__ = ("deferred", "load", "name", "seen")

    def __init__(self, topic: Topic[Any], load: Callable[[Any], None] | None, make: Callable[[], Any] | None) -> None:
        self.name, self.load = topic.name, load
        self.deferred = None if make is None else Deferred(topic, make)
        self.seen: object = None


class _Segment:
    """Some stages in a row: what comes in before them, and what goes out."""

    __slots__ = ("loads", "names", "prepare", "written")

    def __init__(self, links: Sequence[Link], ports: dict[str, _Port]) -> None:
        written: set[str] = set()
        loads: dict[str, _Port] = {}
        for link in links:
            loads |= {topic.name: ports[topic.name] for topic in link.reads if topic.name not in written}
            written |= {topic.name for topic in link.writes}
        self.names, self.loads = tuple(loads), tuple(loads.values())
        self.written = tuple(d for name in written if (d := ports[name].deferred) is not None)


class NativeChain:
    """Runs links, whose nodes are `members`, in their order; see `executor.Chain`."""

    hears = frozenset((topics.LEG_COMMAND.name, topics.ARM_COMMAND.name))

    def __init__(self, bus: Bus, links: Sequence[Link]) -> None:
        """Run `links`, which are in the order of their turns, on `bus`."""
        self.members = tuple(link.node for link in links)
        self._bus, self._links = bus, tuple(links)
        self._record = record = new_shared()
        self._place = address(record)
        self._functions = np.array([link.stage.code.address for link in links], np.int64)
        self._memories = np.array([address(link.stage.memory) for link in links], np.int64)
        ports = {port.name: port for port in _ports(record)}
        n = len(links)
        self._segments = {(f, last): _Segment(links[f:last], ports) for f in range(n) for last in range(f + 1, n + 1)}
        self._prepare = [(k, link.prepare) for k, link in enumerate(links) if link.prepare is not None]
        self._passed = [(k, link.passed) for k, link in enumerate(links) if link.passed is not None]

    def _ready(self, t: float, first: int, last: int) -> int:
        """Return the first of the stages from `first` up to `last` that may not run at `t` [s]; `last` if all may."""
        for k, prepare in self._prepare:
            if first <= k < last and not prepare(t):
                return k
        return last

    def run(self, t: float, first: int, last: int) -> None:
        at = first
        while at < last:
            at, _ = self._run(t, 0, 0.0, at, self._ready(t, at, last), 1)
            if at < last:
                self._links[at].node.step(t)
                at += 1

    def run_ticks(self, tick: int, offset: float, ticks: int) -> int:
        t, last = offset + tick * TICK, len(self._links)
        if self._ready(t, 0, last) < last:
            self.run(t, 0, last)
            return 1
        at, done = self._run(t, tick, offset, 0, last, ticks)
        if at == last:
            return done
        t = offset + (tick + done) * TICK
        self._links[at].node.step(t)
        self.run(t, at + 1, last)
        return done + 1

    def _run(self, t: float, tick: int, offset: float, first: int, last: int, ticks: int) -> tuple[int, int]:
        """Run stages from `first` to `last` until one is not ordinary; return it, else `last`, and the whole ticks."""
        if first == last:
            return last, 0
        bus, segment = self._bus, self._segments[first, last]
        for port, value in zip(segment.loads, bus.newest(segment.names), strict=True):
            if value is port.seen or value is port.deferred or value is None:
                continue
            port.seen = value
            assert port.load is not None
            port.load(value.value() if isinstance(value, Deferred) else value)
        done, at = divmod(
            run_stages(self._place, self._functions, self._memories, first, last, t, tick, offset, ticks), _STAGES
        )
        if at > first and at < last:
            bus.defer(self._segments[first, at].written, done + 1)
        if done and at < last:
            bus.defer(self._segments[max(at, first), last].written, done)
        elif at == last:
            bus.defer(segment.written, done)
        for k, passed in self._passed:
            if first <= k < last and (count := done + (k < at < last)):
                passed(count)
        return at, done


def chain_of(bus: Bus, nodes: Sequence[Node]) -> NativeChain | None:
    """Return the chain of those of `nodes`, in the order of their turns, that have a link; None where none has."""
    links = [node.link() for node in nodes if isinstance(node, HasLink)]
    found = [link for link in links if link is not None]
    return NativeChain(bus, found) if found else None


_STAGES = 64
"""More than a chain has stages."""


@njit(cache=True, nogil=True)
def run_stages(
    record: int,
    functions: np.ndarray[Any, Any],
    memories: np.ndarray[Any, Any],
    first: int,
    last: int,
    t: float,
    tick: int,
    offset: float,
    ticks: int,
) -> int:
    """Run the stages from `first` up to `last`, tick after tick.

    Args:
        record: address of the shared record.
        functions: addresses of the stages.
        memories: addresses of what they remember.
        first: the first stage that runs.
        last: the one after the last.
        t: time of the first tick [s].
        tick: its number, by which the times of the others are told.
        offset: time of the tick number 0 [s].
        ticks: how many ticks.

    Returns:
        Whole ticks times `_STAGES`, plus the stage that has not done the next one; plus `last` where there is none.
    """
    r = shared(record)
    for k in range(ticks):
        r.t = t if k == 0 else offset + (tick + k) * TICK
        look = False
        for s in range(first, last):
            answer = call_stage(functions[s], record, memories[s])
            if answer == UNUSUAL:
                return k * _STAGES + s
            look = look or answer == LOOK
        if look:
            return (k + 1) * _STAGES + last
    return ticks * _STAGES + last


def _ports(record: Records) -> list[_Port]:
    """Return the topics that are in the shared `record`."""
    row = record[0]

    def load_base(value: BaseEstimate) -> None:
        row["base_t"], row["stale"] = value.t, value.stale

    def load_legs(value: LegCommand) -> None:
        put_legs(record, value.q, (value.kp, value.kd), value.tau)

    def load_arms(value: ArmCommand) -> None:
        row["has_arms"], row["arm_q"] = 1, value.q

    def load_estop(value: EstopMessage) -> None:
        row["estop_t"], row["estop_sequence"] = value.t, value.sequence
        row["estop_pressed"] = value.pressed

    def load_safety(value: GateStatus) -> None:
        row["moving"] = value.state is GateState.ACTIVE

    def command(name: str) -> tuple[Callable[[LowCommand], None], Callable[[], LowCommand]]:
        numbers, stamp = row[name], f"{name}_t"

        def load(value: LowCommand) -> None:
            row[stamp] = value.t
            put_command(numbers, value)

        return load, lambda: command_of(numbers, float(row[stamp]))

    def hand(k: int) -> Callable[[], Any]:
        fingers, force = row["fingers"][k], row["finger_force"][k]
        return lambda: HandState(float(row["state_t"]), float(fingers.sum()), fingers.copy(), force.copy())

    return [
        _Port(topics.LOW_STATE, partial(put_state, record), lambda: state_of(row["state"], float(row["state_t"]))),
        _Port(topics.BASE, load_base, lambda: base_of(record)),
        _Port(topics.LEG_COMMAND, load_legs, None),
        _Port(topics.ARM_COMMAND, load_arms, None),
        _Port(topics.ESTOP, load_estop, None),
        _Port(topics.LOW_CMD_REQUEST, *command("request")),
        _Port(topics.LOW_CMD, *command("command")),
        _Port(topics.SAFETY, load_safety, lambda: GateStatus(float(row["command_t"]), GateState.ACTIVE, None, "")),
        *(_Port(topics.hand_state(side), None, hand(k)) for k, side in enumerate(SIDES)),
    ]
