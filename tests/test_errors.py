"""Errors say what is wrong and what would be right."""

from __future__ import annotations

import pytest

from golem.errors import (
    ConfigError,
    GolemError,
    MissingExtra,
    MissingSystemLibrary,
    ModuleFault,
    OutputError,
    unknown_name,
)


@pytest.mark.parametrize("kind", [ConfigError, OutputError, MissingExtra, MissingSystemLibrary, ModuleFault])
def test_every_user_error_has_one_root(kind: type[Exception]) -> None:
    assert issubclass(kind, GolemError)


def test_an_unknown_name_is_answered_with_the_nearest_and_all_valid_ones() -> None:
    error = unknown_name("profile", "feild", ["ideal", "field", "bench"])
    assert str(error) == "Unknown profile 'feild'; valid: bench, field, ideal. Did you mean 'field'?"


def test_a_name_like_no_other_gets_no_hint() -> None:
    assert str(unknown_name("rung", "xyz", ["tether"])) == "Unknown rung 'xyz'; valid: tether."


def test_no_valid_names_at_all() -> None:
    assert str(unknown_name("rung", "x", [])) == "Unknown rung 'x'; valid: (none)."


def test_a_module_fault_names_slot_use_and_reason() -> None:
    fault = ModuleFault("localizer", "mine.py:Eyes", "it raised")
    assert str(fault) == "Module localizer: mine.py:Eyes failed: it raised"
    assert (fault.slot, fault.use, fault.reason) == ("localizer", "mine.py:Eyes", "it raised")


def test_a_missing_extra_says_how_to_install_it() -> None:
    said = str(MissingExtra("pink", "pink"))
    assert "make venv-pink in a clone" in said and "pip install 'golem-humanoid[pink]' where its wheel" in said
    assert "make venv-record" in str(MissingExtra("foxglove", "foxglove"))
