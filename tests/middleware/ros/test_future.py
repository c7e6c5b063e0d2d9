from __future__ import annotations

import pytest

from golem.middleware.ros.future import Future, RosError


def test_a_value_arrives_once() -> None:
    future: Future[int] = Future()
    seen: list[int] = []
    future.then(lambda f: seen.append(f.result()))
    with pytest.raises(RosError, match="not there yet"):
        future.result()
    future.complete(1)
    future.complete(2)
    future.fail(RosError("late"))
    future.then(lambda f: seen.append(f.result()))
    assert future.done and seen == [1, 1]


def test_a_failure_says_why() -> None:
    future: Future[int] = Future()
    future.fail(RosError("The server has gone."))
    future.complete(1)
    with pytest.raises(RosError, match="has gone"):
        future.result()


def test_cancelling_forgets() -> None:
    forgotten: list[bool] = []
    future: Future[int] = Future(lambda: forgotten.append(True))
    future.cancel("It took too long.")
    future.cancel()
    assert forgotten == [True]
    with pytest.raises(RosError, match="too long"):
        future.result()
