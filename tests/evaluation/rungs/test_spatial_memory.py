"""Episodes of relocation, and how the answers to them are judged."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from golem.capabilities.memory.frame_index import FrameIndex
from golem.capabilities.memory.object_map import ObjectMap
from golem.evaluation.base import TrialSpec, make_rung
from golem.evaluation.episodes.relocation import Relocation, Setting, relocation
from golem.evaluation.report.svg_figure import page_figure, styled
from golem.evaluation.rungs.spatial_memory import CONDITIONS, ask, timeline


@pytest.fixture(scope="module")
def episode() -> Relocation:
    return relocation(np.random.default_rng(3), Setting())


def test_an_episode_is_what_the_paper_describes(episode: Relocation) -> None:
    assert len(episode.observations) == 16
    times = [look.frame.t for look in episode.observations]
    assert times == sorted(times)
    for walk, things in ((episode.observations[:8], episode.before), (episode.observations[8:], episode.after)):
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


def test_a_timeline_tells_when_a_move_was_noticed(episode: Relocation) -> None:
    old, new, other = timeline(ObjectMap(), episode)
    first, last = (True,) * 8, (False,) * 8
    assert old.present == first + last and new.present == last + first and all(other.present)
    assert old.beliefs[old.seen[0] :].index("gone") + old.seen[0] >= 8 and old.beliefs[-1] == "gone"
    assert new.beliefs[-1] == "there" and not any(new.beliefs[:8]) and min(new.seen) >= 8
    assert new.told[-1] is True and all(other.told[other.seen[0] :])
    stale = timeline(FrameIndex(), episode)[0]
    assert stale.beliefs[-1] == "there"


def test_the_report_has_the_papers_rows_and_a_timeline() -> None:
    rung = make_rung("golem.evaluation.rungs.spatial_memory:MemoryRung")
    spec = TrialSpec("memory", "object_map", "ideal", 0, 1, case={"condition": "masks"})
    outcomes = {"object_map": [(spec, rung.run(spec, None))]}
    (table,) = rung.tables(outcomes)
    assert table.rows[0][:3] == ("masks", "object_map", "100.0 [20.7, 100]")
    assert [row[1] for row in table.rows[1:]] == ["VLMaps", "SigLIP+FAISS", "SigLIP+FAISS+rerank"]
    pytest.importorskip("matplotlib")
    with styled():
        figure = page_figure(400.0)
        assert "object_map" in (rung.plot(outcomes, figure) or "")
        assert [axes.get_title(loc="left") for axes in figure.axes] == ["trial 1, masks"]


@pytest.mark.parametrize(("condition", "looks"), [("distractors", 116), ("clusters", 16)])
def test_conditions_are_what_they_are_called(condition: str, looks: int) -> None:
    found = relocation(np.random.default_rng(3), CONDITIONS[condition])
    assert len(found.observations) == looks and found.split == looks - 8
    assert sum(len(look.objects) for look in found.observations[-16:-8]) >= 2
    assert sum(len(look.objects) for look in found.observations[: looks - 16]) == (1000 if looks == 116 else 0)


@pytest.mark.slow
def test_a_day_ends_with_the_target_at_its_last_place() -> None:
    found = relocation(np.random.default_rng(3), replace(CONDITIONS["day"], walks=8))
    assert len(found.observations) == 64 and found.split == 56
    assert found.at_old == (False,) * 8 + (True,) * 48 + (False,) * 8
    seen = [
        {o.label: o.position for o in look.objects if np.linalg.norm(o.position[:2]) < 3.0}
        for look in found.observations
    ]
    old, new = found.before[0].position, found.after[0].position
    early, last = ([one[found.target] for one in part if found.target in one] for part in (seen[:8], seen[56:]))
    assert min(np.linalg.norm(at[:2] - new[:2]) for at in early) < 0.2
    assert min(np.linalg.norm(at[:2] - new[:2]) for at in last) < 0.2
    middle = [one[found.target] for one in seen[8:56] if found.target in one]
    assert np.mean([np.linalg.norm(at[:2] - old[:2]) < 0.2 for at in middle]) > 0.5


@pytest.mark.slow
def test_a_trial_depends_on_its_spec_alone() -> None:
    rung = make_rung("golem.evaluation.rungs.spatial_memory:MemoryRung")
    spec = TrialSpec("memory", "object_map", "ideal", 0, 1, case={"condition": "detector"})
    first, again = rung.run(spec, None), rung.run(spec, None)
    assert first.series == again.series and first.stage == again.stage
