"""A thing is searched for where it was, then where others were, then where the map ends."""

from __future__ import annotations

import pytest

from golem.errors import ConfigError
from golem.runtime.lockstep import build
from golem.skills.search import SearchGoal
from golem.stack import load_stack


def test_a_goal_without_sense_is_refused() -> None:
    for text, places in ((" ", 5), ("mug", 31), ("mug", -1)):
        with pytest.raises(ConfigError):
            SearchGoal(text, places=places)


@pytest.mark.slow
def test_what_is_in_view_is_found_and_what_is_not_is_said() -> None:
    running, robot = build(load_stack("counter-tether", profile="ideal"), 0)
    try:
        found = running.execute("search", {"text": "mug"})
        assert found.success and found.value.places[0].label == "mug"
        missing = running.execute("search", {"text": "handle"})
        assert not missing.success and "from 1 places" in missing.reason
    finally:
        robot.close()
