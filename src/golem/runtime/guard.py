"""Turns whatever goes wrong inside a module into a fault that names the module."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from golem.errors import ModuleFault

T = TypeVar("T")


@dataclass(frozen=True)
class Guard:
    """Watches one module of the stack.

    Attributes:
        slot: its slot.
        use: the implementation as the stack file names it.
    """

    slot: str
    use: str

    def call(self, function: Callable[..., T], *arguments: Any) -> T:
        """Return `function(*arguments)`.

        Raises:
            ModuleFault: the module raised anything but such a fault.
        """
        try:
            return function(*arguments)
        except ModuleFault:
            raise
        except Exception as error:  # a user's module may raise anything
            raise ModuleFault(self.slot, self.use, f"{type(error).__name__}: {error}") from error

    def array(self, name: str, value: object, shape: tuple[int, ...]) -> np.ndarray:
        """Return `value` as a finite float array of `shape`.

        Raises:
            ModuleFault: it is something else.
        """
        try:
            array = np.asarray(value, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise ModuleFault(self.slot, self.use, f"{name} is not an array of numbers") from error
        if array.shape != shape:
            raise ModuleFault(
                self.slot, self.use, f"{name} has shape {array.shape}, the contract asks for {shape}"
            )
        if not np.isfinite(array).all():
            raise ModuleFault(self.slot, self.use, f"{name} contains NaN or infinity")
        return array
