"""The robot's time as others see it."""

from __future__ import annotations

from golem.runtime.live.clock import RobotClock


def test_the_first_state_is_new_and_no_restart() -> None:
    clock = RobotClock()
    assert not clock.restarted(53.0, writer=1) and clock.advances(53.0, writer=1)


def test_a_state_that_repeats_or_was_overtaken_is_not_new() -> None:
    clock = RobotClock()
    assert clock.advances(1.004, 1)
    for t in (1.004, 1.002, 0.91):
        assert not clock.advances(t, 1) and not clock.restarted(t, 1)
    assert clock.advances(1.006, 1) and clock.t == 1.006


def test_time_that_jumps_back_is_a_restart() -> None:
    clock = RobotClock()
    clock.advances(5.0, 1)
    assert clock.restarted(0.0, 1) and clock.advances(0.0, 1)
    assert clock.t == 0.0 and clock.advances(0.002, 1)


def test_a_young_robot_that_is_started_anew_is_known_by_its_writer() -> None:
    clock = RobotClock()
    clock.advances(0.05, 1)
    assert clock.restarted(0.0, 2) and clock.advances(0.0, 2)


def test_a_writer_that_was_lost_and_comes_back_as_another_is_no_restart() -> None:
    clock = RobotClock()
    clock.advances(5.0, 1)
    assert not clock.restarted(17.0, 2) and clock.advances(17.0, 2)
    assert clock.advances(17.002, 2)
