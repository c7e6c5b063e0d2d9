"""Episodes of relocation, and how the answers to them are judged."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from golem.evaluation.base import TrialSpec, make_rung
from golem.evaluation.episodes.relocation import Rates, Relocation, relocation
from golem.evaluation.rungs.spatial_memory import ask


@pytest.fixture(scope="module")
def episode() -> Relocation:
    return relocation(np.random.default_rng(3), Rates())


def test_an_episode_is_what_the_paper_describes(episode: Relocation) -> None:
    assert len(episode.observations) == 16
    times = [look.frame.t for look in episode.observations]
    assert times == sorted(times) and times[7] < episode.moved_at < times[8]
    for walk, things in (
        (episode.observations[:8], episode.before),
        (episode.observations[8:], episode.after),
    ):
        seen = {found.label: found.position for look in walk for found in look.objects}
        assert set(seen) == {thing.kind for thing in things}
        for thing in things:
            assert np.linalg.norm(seen[thing.kind][:2] - thing.position[:2]) < 0.1
    assert np.linalg.norm(episode.before[0].position - episode.after[0].position) > 1.0


def test_objects_are_remembered_where_they_are_and_were(episode: Relocation) -> None:
    outcome = ask("object_map", episode)
    assert outcome.success, outcome.detail
    assert outcome.costs["query"] < 0.01


def test_a_memory_of_what_was_before_is_out_of_date(episode: Relocation) -> None:
    stale = replace(episode, observations=(*episode.observations[:8], *(
        replace(look, objects=()) if any(f.label == episode.target for f in look.objects) else look
        for look in episode.observations[8:]
    )))  # fmt: skip
    outcome = ask("top_down_map", stale)
    assert outcome.series["outdated_top1"] == 1.0 and outcome.series["current_top1"] == 0.0
    assert not outcome.success and outcome.module == "memory: top_down_map"


@pytest.mark.slow
def test_a_trial_depends_on_its_spec_alone() -> None:
    rung = make_rung("golem.evaluation.rungs.spatial_memory:MemoryRung")
    spec = TrialSpec("memory", "object_map", "ideal", 0, 1, case={"condition": "detector"})
    first, again = rung.run(spec, None), rung.run(spec, None)
    assert first.series == again.series and first.stage == again.stage
