from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from golem.middleware.ros.future import RosError
from golem.middleware.ros.goals import (
    MAX_ENDED,
    MAX_REPORTED,
    NO_ID,
    CancelCode,
    GoalEvent,
    GoalState,
    GoalStatus,
    GoalTable,
)

S = 1_000_000_000


def ident(number: int) -> bytes:
    return number.to_bytes(16, "big")


def ended(table: GoalTable, number: int, at: int) -> None:
    goal = table.accept(ident(number), 0)
    table.update(goal, GoalEvent.EXECUTE, 0)
    table.update(goal, GoalEvent.SUCCEED, at)


@given(st.lists(st.sampled_from(GoalEvent), max_size=8))
def test_a_goal_only_ever_goes_forward(events: list[GoalEvent]) -> None:
    goal = GoalState(ident(1), 0)
    order = [GoalStatus.ACCEPTED, GoalStatus.EXECUTING, GoalStatus.CANCELING]
    for event in events:
        before = goal.status
        try:
            goal.update(event)
        except RosError:
            assert goal.status is before
            continue
        assert before.active
        assert goal.status.terminal or order.index(goal.status) > order.index(before)


def test_only_a_canceling_goal_becomes_canceled() -> None:
    goal = GoalState(ident(1), 0)
    goal.update(GoalEvent.EXECUTE)
    with pytest.raises(RosError, match="is executing.*cancel_goal, succeed, abort"):
        goal.update(GoalEvent.CANCELED)
    goal.update(GoalEvent.CANCEL_GOAL)
    goal.update(GoalEvent.CANCELED)
    assert goal.status is GoalStatus.CANCELED
    with pytest.raises(RosError, match="what can: nothing"):
        goal.update(GoalEvent.ABORT)


def test_cancel_by_id_means_one_goal() -> None:
    table = GoalTable(10.0)
    first = table.accept(ident(1), 1)
    table.accept(ident(2), 2)
    assert table.to_cancel(ident(1), 0) == (CancelCode.NONE, [first])
    assert table.to_cancel(ident(9), 0) == (CancelCode.UNKNOWN_GOAL_ID, [])
    first.update(GoalEvent.CANCEL_GOAL)
    assert table.to_cancel(ident(1), 0) == (CancelCode.GOAL_TERMINATED, [])
    first.update(GoalEvent.CANCELED)
    assert table.to_cancel(ident(1), 0) == (CancelCode.GOAL_TERMINATED, [])


def test_cancel_by_stamp_means_what_is_not_younger() -> None:
    table = GoalTable(10.0)
    goals = [table.accept(ident(n), n * S) for n in (1, 2, 3, 4)]
    assert table.to_cancel(NO_ID, 2 * S) == (CancelCode.NONE, goals[:2])
    assert table.to_cancel(ident(4), 2 * S) == (CancelCode.NONE, [*goals[:2], goals[3]])
    assert table.to_cancel(ident(9), 2 * S) == (CancelCode.NONE, goals[:2])
    assert table.to_cancel(NO_ID, S // 2) == (CancelCode.NONE, [])


def test_cancel_all_means_what_can_be_cancelled() -> None:
    table = GoalTable(10.0)
    goals = [table.accept(ident(n), n) for n in (1, 2, 3)]
    goals[0].update(GoalEvent.CANCEL_GOAL)
    assert table.to_cancel(NO_ID, 0) == (CancelCode.NONE, goals[1:])
    assert GoalTable(1.0).to_cancel(NO_ID, 0) == (CancelCode.NONE, [])


def test_a_result_is_kept_from_the_end_of_its_goal() -> None:
    table = GoalTable(10.0)
    table.accept(ident(1), 0)
    ended(table, 2, at=100 * S)
    assert table.expire(109 * S) == []
    assert [g.id for g in table.expire(110 * S)] == [ident(2)]
    assert ident(1) in table and ident(2) not in table


def test_a_clock_that_jumps_back_keeps_nothing_forever() -> None:
    table = GoalTable(10.0)
    ended(table, 1, at=1000 * S)
    assert table.expire(0) == []
    assert len(table.expire(10 * S)) == 1


def test_ended_goals_are_bounded_even_if_time_stands_still() -> None:
    table = GoalTable(math.inf)
    for number in range(MAX_ENDED + 5):
        ended(table, number, at=number)
    assert [g.id for g in table.expire(MAX_ENDED + 5)] == [ident(n) for n in range(5)]
    assert len(table) == MAX_ENDED


def test_the_status_of_the_newest_is_reported() -> None:
    table = GoalTable(math.inf)
    active = table.accept(ident(0), 0)
    for number in range(1, MAX_REPORTED + 5):
        ended(table, number, at=number)
    reported = table.reported()
    assert [g.id for g in reported[:-1]] == [ident(n) for n in range(5, MAX_REPORTED + 5)]
    assert reported[-1] is active
