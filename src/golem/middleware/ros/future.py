"""The answer to something asked of another process: it arrives while the asker spins its node."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

from golem.errors import GolemError

T = TypeVar("T")
U = TypeVar("U")


class RosError(GolemError):
    """Communication with another node failed: the message says which name and why."""


class Future(Generic[T]):
    """A value to come. Not for threads: it is completed inside `poll`, by whoever spins the node."""

    def __init__(self, forget: Callable[[], None] = lambda: None) -> None:
        """Start without a value; `forget` is called when nobody wants the value any more."""
        self._forget = forget
        self._value: T
        self._error: Exception | None = None
        self._callbacks: list[Callable[[Future[T]], None]] = []
        self.done = False

    def result(self) -> T:
        """Return the value. Raises RosError: it did not arrive yet, or never will, and why."""
        if self._error is not None:
            raise self._error
        if not self.done:
            raise RosError("The answer is not there yet; spin the node until it is: node.wait(future, timeout).")
        return self._value

    def then(self, callback: Callable[[Future[T]], None]) -> None:
        """Call `callback` with this future once it is done; at once if it is."""
        if self.done:
            callback(self)
        else:
            self._callbacks.append(callback)

    def map(self, convert: Callable[[T], U]) -> Future[U]:
        """Return a future of `convert(value)`; giving that up gives this up."""
        mapped: Future[U] = Future(self.cancel)

        def settle(future: Future[T]) -> None:
            if future._error is not None:
                mapped.fail(future._error)
            elif not mapped.done:
                mapped.complete(convert(future.result()))

        self.then(settle)
        return mapped

    def cancel(self, reason: str = "The answer was given up.") -> None:
        """Want the value no more; what was asked for happens all the same. Does nothing once it is done."""
        if not self.done:
            self.fail(RosError(reason))
            self._forget()

    def complete(self, value: T) -> None:
        """Deliver the value. For whoever made the promise; does nothing once it is done."""
        if not self.done:
            self._value = value
            self._finish()

    def fail(self, error: Exception) -> None:
        """Say that the value will never come. For whoever made the promise; does nothing once it is done."""
        if not self.done:
            self._error = error
            self._finish()

    def _finish(self) -> None:
        self.done = True
        callbacks, self._callbacks = self._callbacks, []
        for callback in callbacks:
            callback(self)
