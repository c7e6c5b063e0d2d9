"""Memories that compare looks, and what a memory of objects makes of their answers."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from tests.capabilities.memory.room import look

from golem.capabilities.memory.base import Memory, MemoryFault
from golem.capabilities.memory.frame_index import FrameIndex, FrameIndexConfig
from golem.capabilities.memory.reranked import Reranked, RerankedConfig
from golem.capabilities.memory.top_down_map import TopDownMap, TopDownMapConfig
from golem.capabilities.memory.words import label_scores
from golem.errors import ConfigError

HERE, THERE = (1.6, 0.45, 1.1), (1.6, -0.45, 1.15)
BOTH: list[Callable[[], Memory]] = [FrameIndex, TopDownMap]


@pytest.mark.parametrize("make", [*BOTH, Reranked])
def test_they_are_memories_of_what_was_seen(make: Callable[[], Memory]) -> None:
    memory = make()
    assert isinstance(memory, Memory)
    assert memory.query("mug") == []
    for t in (1.0, 2.0):
        memory.observe(look(t, {"mug": HERE}))
    place = memory.query("a mug")[0]
    assert np.linalg.norm(place.position[:2] - HERE[:2]) < 1.2 and place.last_seen >= 1.0
    assert memory.query("can") == []
    with pytest.raises(MemoryFault, match="older"):
        memory.observe(look(0.5, {}))
    with pytest.raises(MemoryFault, match="empty"):
        memory.query("")
    assert memory.forget("mug") > 0
    assert memory.query("mug", "anywhere") == []
    memory.close()


@pytest.mark.parametrize("make", [*BOTH, Reranked])
def test_what_makes_no_sense_is_refused_by_each_and_changes_nothing(make: Callable[[], Memory]) -> None:
    memory = make()
    for t in (1.0, 2.0):
        memory.observe(look(t, {"mug": HERE}))
    known = [place.last_seen for place in memory.query("mug", "anywhere")]
    good = look(3.0, {"can": THERE})
    lost = replace(good.objects[0], position=np.array([1.0, math.nan, 0.0]))
    for bad in (
        replace(good, frame=replace(good.frame, T_odom_optical=np.full((4, 4), math.nan))),
        replace(good, frame=replace(good.frame, t=math.nan)),
        replace(good, frame=replace(good.frame, t=1.5)),
        replace(good, objects=[lost]),
        replace(good, pose_sigma=math.nan),
    ):
        with pytest.raises(MemoryFault):
            memory.observe(bad)
    for text in ("", "x" * 10_000_000):
        with pytest.raises(MemoryFault):
            memory.query(text)
    assert memory.query("harpsichord") == [] and memory.query("can", "anywhere") == []
    assert memory.last == 2.0 and [p.last_seen for p in memory.query("mug", "anywhere")] == known


def test_cells_answer_with_where_it_was_as_well() -> None:
    memory = TopDownMap()
    for t in range(6):
        memory.observe(look(float(t), {"mug": HERE}))
    memory.observe(look(6.0, {"mug": THERE}))
    old, new = (np.linalg.norm([p.position[:2] - at[:2] for p in memory.query("mug")], axis=1) for at in (HERE, THERE))
    assert old.min() < 0.2 and new.min() < 0.2
    assert old.argmin() < new.argmin()  # what was seen more often comes first: the failure the paper reports


def test_evidence_puts_the_present_first() -> None:
    memory = Reranked(RerankedConfig(proposer="top_down_map"))
    for t in range(6):
        memory.observe(look(float(t), {"mug": HERE}))
    memory.observe(look(6.0, {"mug": THERE}))
    places = memory.query("mug")
    assert len(places) == 1 and np.linalg.norm(places[0].position - THERE) < 0.05
    (past,) = memory.query("mug", "history")
    assert np.linalg.norm(past.position - HERE) < 0.05 and past.evidence == "gone"


def test_frames_before_a_time_are_asked_for() -> None:
    memory = FrameIndex()
    memory.observe(look(1.0, {"mug": HERE}))
    memory.observe(look(5.0, {"mug": HERE, "can": THERE}))
    assert memory.query("can", "at", at=2.0) == [] and memory.query("can", "at", at=6.0)


def test_they_stay_small() -> None:
    frames, cells = FrameIndex(FrameIndexConfig(most=2)), TopDownMap(TopDownMapConfig(most=20))
    for t in range(4):
        seen = look(float(t), {"mug": HERE})
        frames.observe(seen)
        cells.observe(seen)
    assert len(frames._times) == 2 and len(cells._cells) == 20


def test_options_without_a_meaning_are_refused() -> None:
    with pytest.raises(ConfigError, match="valid: frame_index, top_down_map"):
        RerankedConfig(proposer="voxels")  # pyright: ignore[reportArgumentType]
    with pytest.raises(ConfigError, match="above 0"):
        TopDownMapConfig(cell=0.0)
    with pytest.raises(ConfigError, match="at least 0"):
        FrameIndexConfig(spread=-1.0)


def test_a_frame_without_depth_is_where_the_eye_is() -> None:
    memory = FrameIndex()
    seen = look(1.0, {"mug": HERE})
    memory.observe(replace(seen, frame=replace(seen.frame, depth=np.zeros_like(seen.frame.depth))))
    np.testing.assert_allclose(memory.query("mug")[0].position, seen.frame.T_odom_optical[:3, 3])


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("screw", {"screw": 1.0}),
        ("Screws", {"screw": 1.0}),
        ("an empty screw hole", {"screw_hole": 0.7}),
        ("cup", {"mug": 0.9}),
        ("bottled water", {"bottle": 0.9}),
        ("can of coke", {"can": 0.7}),
        ("glass", {}),
        ("?!", {}),
    ],
)
def test_words_name_labels(text: str, found: dict[str, float]) -> None:
    scores = label_scores(text, ("screw", "screw_hole", "mug", "bottle", "can"))
    assert set(scores) == set(found)
    assert all(math.isclose(scores[label], score) for label, score in found.items())


@pytest.mark.parametrize(("text", "label"), [("ключ", "Ключ"), ("große Tasse", "GROSSE_TASSE"), ("扳手", "扳手")])
def test_words_of_any_script_name_their_label(text: str, label: str) -> None:
    assert label_scores(text, (label, "mug", "große", "螺丝")) == {label: 1.0}
