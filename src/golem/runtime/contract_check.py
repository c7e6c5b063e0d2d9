"""Turns whatever goes wrong inside a module into a fault that names the module.

Compares the time that a module's calls take with the time that it declares, and warns of one far beyond it.

In lock-step a module pays by the latency that it declares, and no result depends on what this measures; it is a word
to the user, beside the results.
"""

from __future__ import annotations

import inspect
import math
import numbers
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np

from golem.errors import MissingExtra, MissingSystemLibrary, ModuleFault, RobotGone, SlowModule
from golem.types import Array

FIRST, STRIDE = 8, 7
"""Which calls are measured: the first ones, then one in `STRIDE`. A look at the thread's clock takes up to 2 us."""
FAR = 3.0
"""CPU time over allowed time from which on a call is slow [own: what another computer or a cold cache explains]."""
WAITING, PATIENCE = 10.0, 0.04
"""The same for the wall clock, and time that is never long [s]: it also counts sleeping, and other processes [own]."""
MIN_SLOW, MAX_SLOW_RATIO = 5, 0.2
"""A module is named once so many measured calls were slow, and this share of all."""


class CallTimes:
    """Samples the calls of a module; `allowed` [s] is its period and latency, or infinite: none is measured."""

    def __init__(self) -> None:
        self.allowed = math.inf
        self._calls = self._measured = self._slow = 0
        self._sum = 0.0

    def start(self) -> tuple[float, float] | None:
        """Return the wall clock and the thread's [s] where the call that begins is to be measured."""
        self._calls += 1
        if self.allowed == math.inf or (self._calls > FIRST and self._calls % STRIDE):
            return None
        return time.perf_counter(), time.thread_time()

    def stop(self, started: tuple[float, float], who: str) -> None:
        """Take in a call that has ended; warn, once, where the module `who` is slow."""
        wall, cpu = time.perf_counter() - started[0], time.thread_time() - started[1]
        self._measured += 1
        if cpu <= FAR * self.allowed and wall <= max(WAITING * self.allowed, PATIENCE):
            return
        self._slow += 1
        self._sum += cpu if cpu > FAR * self.allowed else wall
        if self._slow >= MIN_SLOW and self._slow > MAX_SLOW_RATIO * self._measured:
            mean = self._sum / self._slow
            text = (
                f"{who} takes {1e3 * mean:.3g} ms a call; its period and the latency it declares allow "
                f"{1e3 * self.allowed:.3g} ms, so that a real robot would wait for it."
            )
            warnings.warn(text, SlowModule, stacklevel=2)
            self.allowed = math.inf


T = TypeVar("T")
_FLOAT = np.dtype(np.float64)


@dataclass(frozen=True)
class ContractCheck:
    """Watches one module of the stack; `use` is the implementation as the stack file names it."""

    slot: str
    use: str
    times: CallTimes = field(default_factory=CallTimes, compare=False, repr=False)

    def satisfies(self, module: object, contract: type[Any]) -> None:
        """Check that `module` has every member of the protocol `contract`, and methods that take its arguments.

        Raises ModuleFault: it lacks some, or a method takes other arguments; names them.
        """
        members = {**contract.__annotations__, **vars(contract)}
        lacking = [name for name in members if not name.startswith("_") and not hasattr(module, name)]
        if lacking:
            raise self.fault(f"it lacks {', '.join(lacking)} of the contract {contract.__name__}")
        for name, asked in vars(contract).items():
            if inspect.isfunction(asked) and not name.startswith("_"):
                wrong = arity_mismatch(name, getattr(module, name), asked)
                if wrong:
                    raise self.fault(wrong)

    def call(self, function: Callable[..., T], *arguments: Any) -> T:
        """Return `function(*arguments)`.

        Raises:
            ModuleFault: the module raised anything but such a fault.
            MissingExtra, MissingSystemLibrary: it needs what this machine lacks, which is not its fault.
            RobotGone: it is the robot, and is no longer there.
        """
        started = self.times.start()
        try:
            return function(*arguments)
        except (ModuleFault, MissingExtra, MissingSystemLibrary, RobotGone):
            raise
        except (Exception, SystemExit) as error:  # a user's module may raise anything
            raise ModuleFault.of(self.slot, self.use, error) from error
        finally:
            if started is not None:
                self.times.stop(started, f"{self.slot}: {self.use}")

    def kind(self, name: str, value: object, kind: type[T]) -> T:
        """Return `value`, which is called `name` and must be a `kind`. Raises ModuleFault: it is something else."""
        if not isinstance(value, kind):
            raise self.fault(f"{name} is a {type(value).__name__}, the contract asks for a {kind.__name__}")
        return value

    def number(self, name: str, value: object, minimum: float = -math.inf) -> float:
        """Return `value`, called `name`, a finite number of at least `minimum`. Raises ModuleFault: it is none."""
        if type(value) is float and minimum <= value and -math.inf < value < math.inf:
            return value
        if not isinstance(value, numbers.Real) or not math.isfinite(value) or value < minimum:
            bound = "" if minimum == -math.inf else f" of at least {minimum:g}"
            raise self.fault(f"{name} is {value!r}, the contract asks for a finite number{bound}")
        return float(value)

    def array(self, name: str, value: object, *shape: int | None) -> Array:
        """Return `value`, called `name`, a finite array of `shape`, None being any. Raises ModuleFault: it is none."""
        if not isinstance(value, np.ndarray) or value.dtype.kind not in "fiu":
            kind = f"array of {value.dtype}" if isinstance(value, np.ndarray) else type(value).__name__
            raise self.fault(f"{name} is a {kind}, the contract asks for an array of numbers")
        if value.shape != shape and not _fits(value.shape, shape):
            asked = tuple("n" if length is None else length for length in shape)
            raise self.fault(f"{name} has shape {value.shape}, the contract asks for {asked}")
        # A product with itself costs a third of isfinite and all, and is finite unless something is not (or is huge).
        if not math.isfinite(np.vdot(value, value)) and not np.isfinite(value).all():
            raise self.fault(f"{name} contains NaN or infinity")
        return value

    def arrays(self, length: int, **values: object) -> None:
        """Check that `values` are arrays of (length,), ordinary ones in one go. Raises ModuleFault: one is none."""
        total = 0.0
        for name in values:
            value = values[name]
            if type(value) is not np.ndarray or value.dtype is not _FLOAT or value.shape != (length,):
                break
            total += float(value.dot(value))
        else:
            if math.isfinite(total):
                return
        for name, value in values.items():
            self.array(name, value, length)

    def fault(self, reason: str) -> ModuleFault:
        """Return the fault of this module for `reason`."""
        return ModuleFault(self.slot, self.use, reason)


def arity_mismatch(name: str, method: object, asked: Callable[..., Any]) -> str:
    """Return what keeps `method`, called `name`, from being called as the contract's function `asked` is.

    Nodes pass every argument by position, so names are free. Empty where it can be called, or does not tell.
    """
    if not callable(method):
        return f"its {name} is a {type(method).__name__}, the contract asks for a method"
    wanted = list(inspect.signature(asked).parameters)[1:]
    try:
        own = inspect.signature(method)
    except (TypeError, ValueError):  # of a function in C
        return ""
    try:
        own.bind(*wanted)
    except TypeError:
        has, needs = ", ".join(own.parameters), ", ".join(wanted)
        return f"its {name} takes ({has}), the contract asks for {name}({needs})"
    return ""


def _fits(shape: tuple[int, ...], asked: tuple[int | None, ...]) -> bool:
    return len(shape) == len(asked) and all(b is None or a == b for a, b in zip(shape, asked, strict=True))
