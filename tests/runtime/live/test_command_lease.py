"""Commands are those of whom the operator activated, until he ends or an operator hands over."""

from __future__ import annotations

from golem.runtime.live.safety_process import CommandLease

FIRST, SECOND, THIRD = b"first", b"second", b"third"


def lease(*guids: bytes) -> tuple[CommandLease, dict[int, bytes]]:
    writers = dict(enumerate(guids))
    return CommandLease("/x", lambda: writers, bytes.decode), writers


def test_who_takes_the_place_of_the_holder_is_found_out_while_the_robot_moves() -> None:
    held, writers = lease(FIRST)
    held.grant()
    assert not held.doubt(moving=True)
    del writers[0]
    assert not held.doubt(moving=True)  # silence has a limit of its own
    writers[1] = SECOND
    assert held.doubt(moving=True) == "/x is now written by second, which nobody has activated"


def test_the_lease_ends_with_its_holder_and_an_activation_gives_it_to_the_next() -> None:
    held, writers = lease(FIRST)
    held.grant()
    writers.clear()
    writers[1] = SECOND
    assert not held.doubt(moving=False) and held.holder is None
    held.grant()
    assert held.holder == SECOND and not held.doubt(moving=True)


def test_two_are_one_too_many_until_an_operator_hands_over() -> None:
    held, writers = lease(FIRST)
    held.grant()
    writers[1] = SECOND
    assert "first, second" in held.doubt(moving=False)
    assert held.hand_over() == "second" and held.holder == SECOND
    assert held.ignored == {0} and not held.doubt(moving=False)
    held.grant()
    assert held.holder == SECOND and not held.doubt(moving=True)
    writers[2] = THIRD
    assert "second, third" in held.doubt(moving=True)
    del writers[0]
    held.doubt(moving=True)
    assert not held.ignored


def test_nothing_is_handed_over_where_there_is_no_holder_or_no_second() -> None:
    held, writers = lease(FIRST)
    assert held.hand_over() == ""
    held.grant()
    assert held.hand_over() == ""
    writers.update({1: SECOND, 2: THIRD})
    assert held.hand_over() == "" and held.holder == FIRST
