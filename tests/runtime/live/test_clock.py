"""The robot's time as others see it."""

from __future__ import annotations

from golem.runtime.live.clock import GONE, RobotClock


class Watched(RobotClock):
    """A robot's clock beside a wall clock that is told what it is."""

    def __init__(self) -> None:
        self.wall, self.there = 0.0, {1, 2}
        super().__init__(lambda: self.wall, lambda: self.there)


def test_the_first_state_is_new_and_no_restart() -> None:
    clock = Watched()
    assert clock.advances(53.0, writer=1) and not clock.restarted


def test_a_state_that_repeats_or_was_overtaken_is_not_new() -> None:
    clock = Watched()
    assert clock.advances(1.004, 1)
    for t in (1.004, 1.002, 0.91):
        assert not clock.advances(t, 1) and not clock.restarted
    assert clock.advances(1.006, 1) and clock.t == 1.006


def test_time_that_jumps_back_is_a_restart() -> None:
    clock = Watched()
    clock.advances(5.0, 1)
    assert clock.advances(0.0, 1) and clock.restarted
    assert clock.t == 0.0 and clock.advances(0.002, 1) and not clock.restarted


def test_a_young_robot_that_is_started_anew_is_known_by_its_writer() -> None:
    clock = Watched()
    clock.advances(0.05, 1)
    clock.wall += GONE
    assert clock.advances(0.0, 2) and clock.restarted


def test_a_writer_that_was_lost_and_comes_back_as_another_is_no_restart() -> None:
    clock = Watched()
    clock.advances(5.0, 1)
    clock.wall += GONE
    assert clock.advances(17.0, 2) and not clock.restarted
    assert clock.advances(17.002, 2)


def test_a_second_robot_is_not_the_first_one_started_anew() -> None:
    clock = Watched()
    for k in range(5):
        clock.wall += 0.002
        assert clock.advances(5.0 + 0.002 * k, 1)
        for t in (3.0 + 0.002 * k, 9.0 + 0.002 * k):
            assert not clock.advances(t, 2) and not clock.restarted
    clock.there.remove(1)  # it said goodbye
    assert clock.advances(3.0, 2) and clock.restarted


def test_a_robot_that_fell_silent_may_be_followed_by_another() -> None:
    clock = Watched()
    clock.advances(5.0, 1)
    assert not clock.advances(3.0, 2)
    clock.wall += GONE
    assert clock.advances(3.0, 2) and clock.restarted
