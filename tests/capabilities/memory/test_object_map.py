"""What the memory of objects says after looks that showed, missed, hid or looked through things."""

from __future__ import annotations

import math
import sqlite3
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.capabilities.memory.room import T_LOOK, look

from golem.capabilities.memory.base import HasPlaces, Memory, MemoryFault, Observation, Place
from golem.capabilities.memory.object_map import ObjectMap, ObjectMapConfig
from golem.errors import ConfigError, GolemError

HERE, THERE = (1.4, 0.3, 1.1), (1.6, -0.35, 1.2)
NEAR = 0.01
"""How far the middle of a ball of 6 cm may be told from where it is [m]."""


def _places(found: Sequence[Place]) -> list[tuple[float, ...]]:
    return [tuple(place.position.tolist()) for place in found]


def test_it_is_a_memory() -> None:
    assert isinstance(ObjectMap(), Memory)


def test_what_was_seen_is_where_it_was_seen() -> None:
    memory = ObjectMap()
    memory.observe(look(1.0, {"mug": HERE, "can": THERE}))
    memory.observe(look(2.0, {"mug": HERE, "can": THERE}))
    (place,) = memory.query("the red cup")
    np.testing.assert_allclose(place.position, HERE, atol=NEAR)
    assert (place.label, place.evidence, place.first_seen, place.last_seen) == ("mug", "seen", 1.0, 2.0)
    assert place.facts["looks"] == 2.0
    assert memory.query("bowl") == [] and memory.query("xylophone") == []


def test_what_was_moved_is_where_it_was_seen_last_and_its_old_place_is_history() -> None:
    memory = ObjectMap()
    for t in (1.0, 2.0):
        memory.observe(look(t, {"mug": HERE}))
    memory.observe(look(10.0, {"mug": THERE}))
    now, past = memory.query("mug"), memory.query("mug", "history")
    assert _places(now) == [pytest.approx(THERE, abs=NEAR)]
    assert _places(past) == [pytest.approx(HERE, abs=NEAR)] and past[0].evidence == "gone"
    assert _places(memory.query("mug", "at", at=1.5)) == [pytest.approx(HERE, abs=NEAR)]
    assert memory.query("mug", "at", at=0.5) == []
    assert len(memory.query("mug", "anywhere")) == 2


def test_what_is_gone_is_answered_as_moved() -> None:
    memory = ObjectMap()
    memory.observe(look(1.0, {"mug": HERE}))
    memory.observe(look(5.0, {}))
    (place,) = memory.query("mug")
    assert place.evidence == "moved" and place.last_seen == 1.0


def test_what_is_hidden_stays() -> None:
    memory = ObjectMap()
    memory.observe(look(1.0, {"mug": HERE}))
    for t in range(2, 30):
        memory.observe(look(float(t), {}, hiding=(0.8, 0.17, 1.15)))
    assert memory.query("mug")[0].evidence == "seen"


def test_one_missed_detection_does_not_take_an_object_away_but_many_do() -> None:
    memory = ObjectMap()
    for t in (1.0, 2.0, 3.0):
        memory.observe(look(t, {"mug": HERE}))
    memory.observe(look(4.0, {"mug": HERE}, seen=()))
    assert memory.query("mug")[0].evidence == "seen"
    for t in range(5, 15):
        memory.observe(look(float(t), {"mug": HERE}, seen=()))
    assert memory.query("mug")[0].evidence == "moved"


def test_what_was_seen_once_and_then_missed_again_and_again_never_was() -> None:
    memory = ObjectMap()
    memory.observe(look(1.0, {"mug": HERE}))
    for t in range(2, 9):
        memory.observe(look(float(t), {"mug": HERE}, seen=()))
    assert memory.query("mug", "anywhere") == [] and len(memory) == 0


def scored(t: float, score: float) -> Observation:
    """Return a look that shows one mug with a score."""
    one = look(t, {"mug": HERE})
    (mug,) = one.objects
    return replace(one, objects=[replace(mug, detection=replace(mug.detection, score=score))])


def test_a_doubtful_detection_is_believed_once_it_was_repeated() -> None:
    memory = ObjectMap()
    for t in (1.0, 2.0):
        memory.observe(scored(t, 0.5))
    assert memory.query("mug", "anywhere") == []
    for t in (3.0, 4.0, 5.0):
        memory.observe(scored(t, 0.5))
    assert memory.query("mug")[0].evidence == "seen"
    sure = ObjectMap()
    sure.observe(scored(1.0, 0.7))
    assert sure.query("mug")[0].evidence == "seen"


def test_a_misnamed_look_makes_no_second_object() -> None:
    memory = ObjectMap()
    for t in (1.0, 2.0, 3.0):
        memory.observe(look(t, {"mug": HERE}))
    memory.observe(look(4.0, {"can": HERE}))
    assert memory.query("can", "anywhere") == []
    assert memory.query("mug")[0].evidence == "seen"
    memory.observe(look(5.0, {"mug": HERE}))
    memory.observe(look(10.0, {}))
    assert memory.query("can", "anywhere") == []
    assert memory.query("mug")[0].evidence == "moved"


def test_of_two_names_that_were_given_equally_often_both_are_answered() -> None:
    memory = ObjectMap()
    memory.observe(look(1.0, {"mug": HERE}))
    memory.observe(look(2.0, {"can": HERE}))
    assert [memory.query(label)[0].evidence for label in ("mug", "can")] == ["seen", "seen"]


def test_what_took_the_place_of_another_kind_is_believed_at_the_second_look() -> None:
    memory = ObjectMap()
    for t in range(10):
        memory.observe(look(float(t), {"mug": HERE}))
    for t in (10.0, 11.0):
        memory.observe(look(t, {"can": HERE}))
    assert memory.query("can")[0].evidence == "seen"
    for t in range(12, 20):
        memory.observe(look(float(t), {"can": HERE}))
    assert memory.query("mug")[0].evidence == "moved" and memory.query("can")[0].evidence == "seen"
    assert len(memory.query("mug", "history")) == 1


def test_what_was_seen_from_too_far_to_tell_where_it_is_outvotes_nothing() -> None:
    memory = ObjectMap()
    one = look(0.0, {"can": HERE})
    off = np.array([100.0, 0.0, 0.0])
    far = replace(one.objects[0], position=one.objects[0].position + off, points=one.objects[0].points + off)
    for t in (0.0, 1.0, 2.0):
        memory.observe(replace(one, frame=replace(one.frame, t=t), objects=[far], labels=()))
    memory.observe(look(3.0, {"mug": HERE}))
    assert memory.query("mug")[0].evidence == "seen"


def test_neighbours_of_two_kinds_are_two() -> None:
    memory = ObjectMap()
    beside = (1.4, 0.17, 1.1)
    for t in range(8):
        memory.observe(look(float(t), {"mug": HERE}))
    memory.observe(look(8.0, {"mug": HERE, "can": beside}))
    assert memory.query("can")[0].evidence == memory.query("mug")[0].evidence == "seen"


def test_what_was_not_asked_for_is_not_missed() -> None:
    memory = ObjectMap()
    memory.observe(look(1.0, {"mug": HERE}))
    memory.observe(look(2.0, {}, labels=("can",)))
    assert memory.query("mug")[0].evidence == "seen"


def test_two_equal_objects_are_two() -> None:
    memory = ObjectMap()
    beside = (1.4, 0.15, 1.1)
    for t in (1.0, 2.0, 3.0):
        memory.observe(look(t, {"mug1": HERE, "mug2": beside}))
    assert len(memory) == 2
    memory.observe(look(4.0, {"mug2": beside}))
    assert _places(memory.query("mug")) == [pytest.approx(beside, abs=NEAR)]


def test_a_drifting_pose_makes_one_object_of_one() -> None:
    memory = ObjectMap()
    rng = np.random.default_rng(1)
    for t in range(20):
        believed = T_LOOK.copy()
        believed[:3, 3] += rng.normal(0.0, 0.05, 3)
        memory.observe(look(float(t), {"mug": HERE}, believed=believed, pose_sigma=0.05))
    assert len(memory) == 1
    assert np.linalg.norm(memory.query("mug")[0].position - HERE) < 0.06


def test_what_is_forgotten_is_not_remembered() -> None:
    memory = ObjectMap()
    memory.observe(look(1.0, {"mug": HERE, "can": THERE}))
    assert memory.forget("cup") == 1
    assert memory.query("mug", "anywhere") == [] and len(memory.query("can")) == 1


def test_the_longest_gone_are_forgotten_first() -> None:
    memory = ObjectMap(ObjectMapConfig(most=2))
    memory.observe(look(1.0, {"mug": HERE}))
    memory.observe(look(2.0, {"can": THERE}))
    memory.observe(look(3.0, {"can": THERE, "bowl": (1.5, 0.0, 0.9)}))
    assert memory.query("mug", "anywhere") == []
    assert [len(memory.query(label)) for label in ("can", "bowl")] == [1, 1]


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"t": math.nan}, "time of an observation is not finite"),
        ({"t": 0.5}, "older than the last one"),
        ({"T_odom_optical": np.full((4, 4), np.nan)}, "pose of an observation is not finite"),
    ],
)
def test_a_look_that_cannot_be_is_refused_and_changes_nothing(change: dict[str, object], why: str) -> None:
    memory = ObjectMap()
    memory.observe(look(1.0, {"mug": HERE}))
    bad = look(2.0, {"can": THERE})
    with pytest.raises(MemoryFault, match=why):
        memory.observe(replace(bad, frame=replace(bad.frame, **change)))  # pyright: ignore[reportArgumentType]
    assert len(memory) == 1 and memory.query("mug")[0].last_seen == 1.0


@pytest.mark.parametrize(
    ("words", "why"),
    [
        ({"text": " "}, "query is empty"),
        ({"text": "x" * 10_000_000}, "10000000 characters"),
        ({"text": "mug", "when": "yesterday"}, "yesterday"),
        ({"text": "mug", "when": "at"}, "needs a finite time"),
        ({"text": "mug", "limit": 0}, "at least one place"),
    ],
)
def test_a_question_that_cannot_be_is_refused(words: dict[str, object], why: str) -> None:
    with pytest.raises(GolemError, match=why):
        ObjectMap().query(**words)  # pyright: ignore[reportArgumentType]


def test_options_without_a_meaning_are_refused() -> None:
    with pytest.raises(ConfigError, match="above 0"):
        ObjectMapConfig(gate=0.0)
    with pytest.raises(ConfigError, match="below 0"):
        ObjectMapConfig(through=1.0)


def test_a_file_is_read_again(tmp_path: Path) -> None:
    config = ObjectMapConfig(str(tmp_path / "deep" / "memory.db"))
    memory = ObjectMap(config)
    memory.observe(look(1.0, {"mug": HERE, "can": THERE}))
    memory.observe(look(2.0, {"can": THERE}))
    memory.forget("bowl")
    before = [memory.query(word, "anywhere") for word in ("mug", "can")]
    memory.close()
    again = ObjectMap(config)
    for old, new in zip(before, [again.query(word, "anywhere") for word in ("mug", "can")], strict=True):
        for a, b in zip(old, new, strict=True):
            np.testing.assert_array_equal(a.position, b.position)
            told = [(p.label, p.score, p.first_seen, p.last_seen, p.evidence, p.facts) for p in (a, b)]
            assert told[0] == told[1]
    with pytest.raises(MemoryFault, match="older"):
        again.observe(look(1.5, {}))
    again.close()


def test_a_file_belongs_to_one_process(tmp_path: Path) -> None:
    config = ObjectMapConfig(str(tmp_path / "memory.db"))
    first = ObjectMap(config)
    with pytest.raises(MemoryFault, match="another process has it open"):
        ObjectMap(config)
    first.close()
    ObjectMap(config).close()


def test_a_broken_or_foreign_file_is_refused(tmp_path: Path) -> None:
    broken = tmp_path / "broken.db"
    broken.write_bytes(b"no database" * 400)
    with pytest.raises(MemoryFault, match=r"broken\.db cannot be used"):
        ObjectMap(ObjectMapConfig(str(broken)))
    foreign = sqlite3.connect(tmp_path / "foreign.db")
    foreign.execute("CREATE TABLE cats (name TEXT)")
    foreign.commit()
    foreign.close()
    with pytest.raises(MemoryFault, match="no memory of this version"):
        ObjectMap(ObjectMapConfig(str(tmp_path / "foreign.db")))


def test_a_full_disk_is_said_and_the_memory_is_as_it_was(tmp_path: Path) -> None:
    memory = ObjectMap(ObjectMapConfig(str(tmp_path / "memory.db")))
    memory.observe(look(1.0, {"mug": HERE}))
    assert memory._file is not None
    memory._file._base.execute("PRAGMA max_page_count=1")
    one = look(2.0, {"can": THERE}, labels=())
    (can,) = one.objects
    shifts = np.linspace(0.0, 60.0, 200)[:, None] * (0.0, 1.0, 0.0)
    cans = [replace(can, position=can.position + shift) for shift in shifts]
    with pytest.raises(MemoryFault, match="full"):
        memory.observe(replace(one, objects=cans))
    assert len(memory) == 1
    assert memory.query("mug")[0].last_seen == 1.0


def test_a_disk_that_became_read_only_is_said_and_the_memory_is_as_it_was(tmp_path: Path) -> None:
    memory = ObjectMap(ObjectMapConfig(str(tmp_path / "memory.db")))
    memory.observe(look(1.0, {"mug": HERE}))
    assert memory._file is not None
    memory._file._base.execute("PRAGMA query_only=ON")  # permissions do not bind who tests as root
    with pytest.raises(MemoryFault, match="may not be written"):
        memory.observe(look(2.0, {"can": THERE}))
    with pytest.raises(MemoryFault, match="may not be written"):
        memory.forget("mug")
    assert len(memory) == 1 and memory.last == 1.0
    with pytest.raises(MemoryFault, match="cannot be used"):
        ObjectMap(ObjectMapConfig(str(tmp_path / "memory.db" / "below_a_file.db")))


@pytest.mark.slow
def test_a_second_process_is_told_who_has_the_file(tmp_path: Path) -> None:
    path = tmp_path / "memory.db"
    memory = ObjectMap(ObjectMapConfig(str(path)))
    second = subprocess.run(
        [sys.executable, "-c", WRITER, str(path)], capture_output=True, text=True, check=False, timeout=60
    )
    assert second.returncode != 0 and "another process has it open" in second.stderr
    memory.close()


def test_everything_that_is_remembered_can_be_shown() -> None:
    memory = ObjectMap()
    assert isinstance(memory, HasPlaces) and memory.places(5) == []
    memory.observe(look(1.0, {"mug": HERE, "can": THERE}))
    memory.observe(look(2.0, {"can": THERE}))
    shown = memory.places(5)
    assert [(place.label, place.evidence) for place in shown] == [("can", "seen"), ("mug", "gone")]
    assert len(memory.places(1)) == 1


WRITER = """
import sys
from dataclasses import replace
from tests.capabilities.memory.room import look
from golem.capabilities.memory.object_map import ObjectMap, ObjectMapConfig
memory = ObjectMap(ObjectMapConfig(sys.argv[1]))
t = memory.last if len(memory) else 0.0
one = look(t, {"mug": (1.4, 0.3, 1.1)})
while True:
    t += 1.0
    memory.observe(replace(one, frame=replace(one.frame, t=t)))
    print(t, flush=True)
"""


@pytest.mark.slow
def test_what_was_acknowledged_survives_a_kill(tmp_path: Path) -> None:
    path = tmp_path / "memory.db"
    rng = np.random.default_rng(0)
    for _ in range(5):
        writer = subprocess.Popen([sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE, text=True)
        assert writer.stdout is not None
        first = writer.stdout.readline()
        time.sleep(float(rng.uniform(0.0, 0.1)))
        writer.kill()
        said = [first, *writer.stdout.readlines()]
        writer.wait()
        memory = ObjectMap(ObjectMapConfig(str(path)))
        assert memory.query("mug")[0].last_seen >= float([line for line in said if line.endswith("\n")][-1])
        memory.close()
