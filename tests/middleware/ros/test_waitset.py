"""Inboxes between the transport's thread and the spinner's."""

from __future__ import annotations

import signal
import threading
import time

import pytest

from golem.middleware.dds.base import ENCAPSULATION, Qos, Sample
from golem.middleware.dds.local import LocalDomain
from golem.middleware.ros.waitset import Inbox, WaitSet

DEPTH = Qos(depth=10)


class Line:
    """A writer, and an inbox that its samples go to."""

    def __init__(self) -> None:
        domain = LocalDomain()
        self.waitset = WaitSet()
        self.seen: list[int] = []
        self.writer = domain.participant().writer("rt/a", "A", DEPTH)
        self.inbox = Inbox(self.waitset, self.handle, DEPTH)
        self.inbox.open(domain.participant(), "rt/a", "A", DEPTH, "")

    def handle(self, sample: Sample) -> None:
        self.seen.append(sample.payload[4])

    def send(self, *numbers: int) -> None:
        for number in numbers:
            self.writer.write(ENCAPSULATION + bytes([number]))


@pytest.fixture
def line() -> Line:
    return Line()


def test_samples_wait_for_the_poll(line: Line) -> None:
    line.send(1, 2)
    assert (line.seen, line.inbox.count) == ([], 2)
    assert line.waitset.poll() == 2 and line.waitset.poll() == 0
    assert line.seen == [1, 2]


def test_only_the_newest_are_kept(line: Line) -> None:
    line.send(*range(15))
    assert line.inbox.count == 15 and line.inbox.newest is not None
    line.waitset.poll()
    assert line.seen == list(range(5, 15))


def test_a_flood_does_not_keep_a_poll_from_returning(line: Line) -> None:
    def handle(sample: Sample) -> None:
        Line.handle(line, sample)
        line.send(9, 9)

    line.inbox._handle = handle
    line.send(1)
    assert [line.waitset.poll() for _ in range(3)] == [1, 2, 4]


def test_what_a_callback_leaves_by_raising_is_handled_later(line: Line) -> None:
    def handle(sample: Sample) -> None:
        Line.handle(line, sample)
        if sample.payload[4] == 1:
            raise ZeroDivisionError

    line.inbox._handle = handle
    line.send(1, 2)
    with pytest.raises(ZeroDivisionError):
        line.waitset.poll()
    line.waitset.poll()
    assert line.seen == [1, 2]


def test_a_callback_may_poll(line: Line) -> None:
    def handle(sample: Sample) -> None:
        Line.handle(line, sample)
        if sample.payload[4] == 1:
            line.send(3)
            line.waitset.poll()

    line.inbox._handle = handle
    line.send(1, 2)
    line.waitset.poll()
    line.waitset.poll()
    assert line.seen == [1, 2, 3]


def test_a_callback_may_close(line: Line) -> None:
    def handle(sample: Sample) -> None:
        Line.handle(line, sample)
        line.inbox.close()

    line.inbox._handle = handle
    line.send(1, 2)
    assert line.waitset.poll() == 1
    line.send(3)
    assert line.waitset.poll() == 0 and line.inbox.matched() == 0


def test_waiting_ends_with_the_first_sample(line: Line) -> None:
    line.waitset.wait(0.0)
    line.send(1)
    line.waitset.wait(1e6)
    assert line.waitset.poll() == 1


@pytest.mark.timeout(20)
def test_a_signal_whose_handler_outlasts_the_timeout_does_not_make_the_wait_endless() -> None:
    before = signal.signal(signal.SIGALRM, lambda *_: time.sleep(0.05))
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.01)
        WaitSet().wait(0.03)
    finally:
        signal.signal(signal.SIGALRM, before)


@pytest.mark.timeout(20)
def test_what_another_thread_sends_ends_the_wait(line: Line) -> None:
    for number in range(3):
        threading.Timer(0.02, line.send, [number]).start()
        while not line.waitset.poll():
            line.waitset.wait(100.0)
    assert line.seen == [0, 1, 2]
