"""The rung navigate: what it compares, whom it blames, and a trial of it."""

from __future__ import annotations

from typing import Any

import pytest

from golem.evaluation.base import TrialSpec, make_rung, rung_class
from golem.evaluation.episodes.episode import Episode
from golem.evaluation.episodes.oracle import ContactWatch
from golem.evaluation.rungs.navigate_hall import HallWalk, NavigateOptions, NavigateRung, judge
from golem.interfaces import topics
from golem.interfaces.payloads import Odometry
from golem.robots.model.spatial import transform
from golem.skills.base import SkillResult
from golem.types import PlanarPose

SPEC = TrialSpec("navigate", "costmap_astar", "ideal", 0, 0, case={"map": "none"})
HERE, GOAL = PlanarPose(0.0, 0.0, 0.0), PlanarPose(6.0, 0.0, 0.0)


@pytest.fixture(scope="module")
def episode() -> Any:
    rung = NavigateRung(NavigateOptions(map=("none",)))
    episode = Episode(rung._stack("costmap_astar", "ideal", {}), 0)
    episode.run(0.05)
    yield episode
    episode.close()


class Ended:
    """An episode whose skill has ended as a test says."""

    def __init__(self, episode: Episode, result: SkillResult | None, at: PlanarPose = HERE) -> None:
        self.running, self.robot, self.result, self.loss, self.t = (episode.running, episode.robot, result, None, 9.0)
        self.running.bus.publish(topics.ODOMETRY, Odometry(9.0, transform((at.x, at.y, 0.0))), 9.0)


DONE = SkillResult(True, "done", None, "")


def outcome(episode: Episode, result: SkillResult | None, goal: PlanarPose, **how: Any) -> tuple[str, str | None]:
    contacts = ContactWatch(episode.robot)
    contacts.touched |= how.pop("touched", {})
    spec = how.pop("spec", SPEC)
    found = judge(spec, Ended(episode, result, **how), goal, HallWalk(), contacts)  # pyright: ignore
    return found.stage, found.module


def test_it_compares_navigators_under_the_maps_that_are_asked_for() -> None:
    assert rung_class("navigate") is NavigateRung
    rung = make_rung("golem.evaluation.rungs.navigate_hall:NavigateRung", {"map": ["none", "survey"]})
    assert "costmap_astar" in rung.methods() and [c["map"] for c in rung.cases(lambda case: None)] == ["none", "survey"]


def test_the_module_that_lost_it_is_named(episode: Episode) -> None:
    assert outcome(episode, DONE, HERE) == ("done", None)
    assert outcome(episode, None, GOAL) == ("timeout", "navigator: costmap_astar")
    # It believes to stand at the goal and does not: whoever tells the place has lost it.
    assert outcome(episode, DONE, GOAL, at=GOAL) == ("goal", "odometry: lio")
    known = TrialSpec("navigate", "costmap_astar", "ideal", 0, 0, case={"map": "survey"})
    assert outcome(episode, DONE, GOAL, at=GOAL, spec=known) == ("goal", "mapper: grid")
    # It knows that it is elsewhere.
    assert outcome(episode, DONE, GOAL) == ("goal", "navigator: costmap_astar")
    touched = {"left_wrist on course": 3.0}
    assert outcome(episode, DONE, HERE, touched=touched) == ("contact", "navigator: costmap_astar")
    assert outcome(episode, DONE, HERE, touched=touched, at=PlanarPose(0.5, 0.0, 0.0)) == ("contact", "odometry: lio")
    silent = SkillResult(False, "navigate", "odometry", "The odometry has been silent for 0.6 s.")
    assert outcome(episode, silent, GOAL) == ("navigate", "odometry: lio")


@pytest.mark.slow
def test_a_trial_arrives() -> None:
    found = NavigateRung().run(TrialSpec("navigate", "costmap_astar", "field", 0, 1, case={"map": "survey"}), None)
    assert found.success and found.series["goal_radial"] < 0.1
