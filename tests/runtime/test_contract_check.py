"""The guard: whatever a module does wrong becomes a fault with its name."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from golem.errors import ConfigError, MissingExtra, MissingSystemLibrary, ModuleFault
from golem.hardware.hands.base import HandController
from golem.hardware.hands.magpie import MagpieHand
from golem.runtime.contract_check import ContractCheck

GUARD = ContractCheck("hand", "mine.py:Hand")


def reason(caught: pytest.ExceptionInfo[ModuleFault]) -> str:
    """Return what the fault says, after a check that it names the module."""
    assert (caught.value.slot, caught.value.use) == ("hand", "mine.py:Hand")
    assert str(caught.value).startswith("Module hand: mine.py:Hand failed: ")
    return caught.value.reason


def raiser(error: BaseException) -> Any:
    def raise_it(*_: object) -> None:
        raise error

    return raise_it


def test_what_works_is_returned() -> None:
    assert GUARD.call(divmod, 7, 2) == (3, 1)


@pytest.mark.parametrize("error", [ValueError("x"), ConfigError("x"), KeyError("x"), RecursionError("x")])
def test_whatever_is_raised_is_the_modules_fault(error: Exception) -> None:
    with pytest.raises(ModuleFault) as caught:
        GUARD.call(raiser(error))
    assert reason(caught).startswith(type(error).__name__) and "x" in reason(caught)
    assert caught.value.__cause__ is error


@pytest.mark.parametrize("error", [ModuleFault("robot", "r", "x"), MissingExtra("p", "e"), MissingSystemLibrary("GL")])
def test_what_is_not_the_modules_fault_passes(error: Exception) -> None:
    with pytest.raises(type(error)) as caught:
        GUARD.call(raiser(error))
    assert caught.value is error


def test_an_interrupt_passes() -> None:
    with pytest.raises(KeyboardInterrupt):
        GUARD.call(raiser(KeyboardInterrupt()))


class Contract(Protocol):
    rate: float

    def step(self) -> None: ...


def test_a_module_with_everything_satisfies_its_contract() -> None:
    GUARD.satisfies(MagpieHand(), HandController)


def test_what_a_module_lacks_is_named() -> None:
    class Half:
        def step(self) -> None: ...

    with pytest.raises(ModuleFault) as caught:
        GUARD.satisfies(Half(), Contract)
    assert reason(caught) == "it lacks rate of the contract Contract"
    with pytest.raises(ModuleFault) as caught:
        GUARD.satisfies(Half(), HandController)
    assert reason(caught) == "it lacks open, close, status of the contract HandController"


class Asked(Protocol):
    def step(self, state: float, dt: float, gains: float | None = None) -> None: ...


def with_step(step: object) -> object:
    return type("Mine", (), {"step": step})()


@pytest.mark.parametrize(
    "step",
    [
        lambda self, state, dt, gains: None,
        lambda self, s, h, g=1, more=2: None,
        lambda self, *everything: None,
        staticmethod(lambda a, b, c: None),
        print,
    ],
)
def test_a_method_that_takes_the_arguments_satisfies_its_contract(step: object) -> None:
    GUARD.satisfies(with_step(step), Asked)


@pytest.mark.parametrize(
    ("step", "words"),
    [
        (lambda self, state, dt: None, "its step takes (state, dt), the contract asks for step(state, dt, gains)"),
        (lambda self, state, dt, gains, more: None, "its step takes (state, dt, gains, more), the contract asks for"),
        (lambda self, *, state, dt, gains: None, "the contract asks for step(state, dt, gains)"),
        (3.0, "its step is a float, the contract asks for a method"),
    ],
)
def test_a_method_that_takes_other_arguments_is_named(step: object, words: str) -> None:
    with pytest.raises(ModuleFault) as caught:
        GUARD.satisfies(with_step(step), Asked)
    assert words in reason(caught)


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (np.array([0.0, np.nan, 0.0]), "NaN"),
        (np.array([0.0, np.inf, -np.inf]), "NaN or infinity"),
        (np.zeros(4), "shape (4,), the contract asks for (3,)"),
        (np.zeros((3, 1)), "shape (3, 1)"),
        (np.float64(1.0), "float64"),
        ([0.0, 0.0, 0.0], "a list"),
        (None, "a NoneType"),
        ("abc", "a str"),
        (np.array(["a", "b", "c"]), "array of <U1"),
        (np.array([None, 1, 2]), "array of object"),
        (np.zeros(3, dtype=complex), "array of complex128"),
        (np.zeros(3, dtype=bool), "array of bool"),
    ],
)
def test_an_array_that_is_none_is_refused(value: object, words: str) -> None:
    with pytest.raises(ModuleFault) as caught:
        GUARD.array("q", value, 3)
    assert reason(caught).startswith("q ") and words in reason(caught)


@pytest.mark.parametrize(
    "value", [np.zeros(3), np.ones(3, dtype=np.float32), np.arange(3), np.full(3, 1e200), np.zeros(6)[::2]]
)
def test_an_array_of_numbers_is_returned_as_it_is(value: np.ndarray) -> None:
    assert GUARD.array("q", value, 3) is value


@given(st.integers(0, 15), st.sampled_from([np.nan, np.inf, -np.inf]))
def test_one_bad_number_anywhere_is_found(index: int, bad: float) -> None:
    T = np.eye(4)
    T.flat[index] = bad
    with pytest.raises(ModuleFault):
        GUARD.array("T", T, 4, 4)


def test_a_length_may_be_left_open() -> None:
    for n in (0, 1, 5):
        GUARD.array("points", np.zeros((n, 3)), None, 3)
    with pytest.raises(ModuleFault, match=r"shape \(3,\), the contract asks for \('n', 3\)"):
        GUARD.array("points", np.zeros(3), None, 3)


@pytest.mark.parametrize("value", [np.nan, np.inf, -0.1, None, "1", 1j, np.zeros(1)])
def test_a_number_that_is_none_is_refused(value: object) -> None:
    with pytest.raises(ModuleFault) as caught:
        GUARD.number("latency", value, minimum=0.0)
    assert "latency is" in reason(caught) and "finite number of at least 0" in reason(caught)


@pytest.mark.parametrize("value", [0, 0.5, np.float32(2.0), np.int64(3)])
def test_a_number_is_returned_as_float(value: float) -> None:
    got = GUARD.number("latency", value, minimum=0.0)
    assert type(got) is float and got == value


def test_another_kind_is_refused() -> None:
    with pytest.raises(ModuleFault) as caught:
        GUARD.kind("the status", (1, 2), HandController)
    assert reason(caught) == "the status is a tuple, the contract asks for a HandController"
    assert GUARD.kind("n", 3, int) == 3
