"""Whole packs, taken out of by a job: what is kept when the process dies, what is retried, what the inventory says."""

from __future__ import annotations

import csv
import random
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from tests.skills.conftest import modules
from tests.skills.job_world import JobWorld, edge_places, picked, write_list

from golem.errors import ConfigError
from golem.interfaces import topics
from golem.middleware.bus import Bus
from golem.robots.model.pinocchio_model import Kinematics
from golem.skills.context import Context
from golem.skills.disassemble_goal import DisassembleGoal
from golem.skills.fastener_list import read_list
from golem.skills.job_file import Fate, JobFault, JobFile
from golem.skills.pack_job import KEEP_OFF, SILENT, Gantry, fit_frames, matched
from golem.skills.pack_picture import COLOURS
from golem.skills.pick_config import PickReport
from golem.types import PlanarPose

PLACES = edge_places(30)
GOAL = DisassembleGoal(list="list.csv", job="pack.sqlite")


def job(folder: Path, says: object = picked, **goal: object) -> tuple[JobWorld, list[str]]:
    """Run a job on 32 screws; return the world and what became of them."""
    write_list(folder / "list.csv", PLACES)
    world = JobWorld(PLACES, folder, says)  # pyright: ignore[reportArgumentType]
    result = world.run(DisassembleGoal(list="list.csv", job="pack.sqlite", **goal))  # pyright: ignore
    return world, result.value.fates


def resumed(folder: Path) -> None:
    """Go on with a job that was killed, and check that nothing is asked twice or forgotten."""
    world = JobWorld(PLACES, folder)
    before = set(world.out)
    result = world.run(GOAL)
    assert not before & set(world.asked), "what was in the tray was asked again"
    assert set(range(len(PLACES))) == world.out, "a fastener was forgotten"
    asked = [int(line[4:]) for line in world.log.read_text().split("\n") if line.startswith("ask ")]
    assert len(result.value.fates) == len(PLACES) and set(result.value.fates) <= {Fate.IN_TRAY, Fate.LOST}
    # Only what a hand was at when the process died may be of unknown fate, at most one a death.
    assert result.value.fates.count(Fate.LOST) <= 1 and set(asked) == set(range(len(PLACES)))


def begin(folder: Path, *words: str) -> subprocess.Popen[str]:
    write_list(folder / "list.csv", PLACES)
    command = [sys.executable, "-m", "tests.skills.job_world", str(folder), *words]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


@pytest.mark.slow
@pytest.mark.parametrize("trial", range(15))
def test_a_job_killed_at_any_moment_goes_on(trial: int, tmp_path: Path) -> None:
    process = begin(tmp_path)
    log = tmp_path / "world.txt"
    wait = random.Random(trial).randrange(1, 60)
    while process.poll() is None and (not log.exists() or log.read_text().count("\n") < wait):
        time.sleep(0.0005)
    process.send_signal(signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    resumed(tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("write", [1, 2, 17, 32, 63])
def test_a_job_killed_inside_a_write_goes_on(write: int, tmp_path: Path) -> None:
    assert begin(tmp_path, str(write)).wait() == -signal.SIGKILL
    resumed(tmp_path)


def test_a_job_takes_all_and_says_where_from_and_when(tmp_path: Path) -> None:
    world, ends = job(tmp_path)
    assert ends == [Fate.IN_TRAY] * 32 and sorted(world.asked) == list(range(32))
    with (tmp_path / "pack_inventory.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["tray"] for row in rows] == ["tray"] * 32 and all(row["date_utc"] and row["stance"] for row in rows)
    assert "32 in tray" in (tmp_path / "pack_inventory.html").read_text()
    again = JobWorld(PLACES, tmp_path)
    assert again.run(DisassembleGoal(job="pack.sqlite")).success and not again.asked


def test_what_fails_is_tried_again_from_elsewhere_and_then_set_aside(tmp_path: Path) -> None:
    outcomes = {3: "tight", 5: "jammed", 7: "nothing_there", 9: "blocked", 11: "out_of_reach"}

    def says(number: int, tries: int) -> PickReport:
        return PickReport(outcomes.get(number, "picked" if number != 13 or tries > 1 else "failed"), [], "yes", "yes")

    world, ends = job(tmp_path, says)
    assert [ends[k] for k in outcomes] == ["tight", "jammed", "missing", "blocked", "out_of_reach"]
    assert ends.count(Fate.IN_TRAY) == 27 and [world.asked.count(k) for k in (3, 5, 13)] == [2, 2, 2]
    stances = [(g.wanted, g.side) for g in world.goals if hasattr(g, "wanted") and hasattr(g, "side")]
    assert len(stances) == len(world.asked)
    assert "tight" in (tmp_path / "pack_inventory.html").read_text()


def test_of_a_list_only_what_it_says_to_be_loose_is_tried_and_of_an_unknown_pack_tight_ones_once(
    tmp_path: Path,
) -> None:
    rows = [f"screw,{x},{y},{z},{int(k < 4)}" for k, (x, y, z) in enumerate(PLACES.tolist())]
    (tmp_path / "list.csv").write_text("\n".join(["class,x,y,z,loose", *rows]))
    world = JobWorld(PLACES, tmp_path)
    assert world.run(DisassembleGoal(list="list.csv", loosened="list")).value.fates[:5] == ["in_tray"] * 4 + ["open"]
    tight = JobWorld(PLACES, tmp_path, lambda number, tries: PickReport("tight"))
    tight.out.clear()
    ends = tight.run(DisassembleGoal(list="list.csv", job="other.sqlite", loosened="unknown")).value.fates
    assert set(ends) == {"tight"} and len(tight.asked) == len(PLACES)


def test_what_was_not_seen_in_the_tray_is_lost_or_tried_again_if_it_is_still_there(tmp_path: Path) -> None:
    def says(number: int, tries: int) -> PickReport:
        return PickReport("picked", [], "no", "yes") if number == 4 else picked(number, tries)

    _, ends = job(tmp_path, says)
    assert ends[4] == Fate.LOST and ends.count(Fate.IN_TRAY) == 31


def test_a_full_tray_is_changed_for_the_next_and_where_none_is_left_the_rest_waits(tmp_path: Path) -> None:
    def says(number: int, tries: int) -> PickReport:
        full = len(world.asked) > 5 and world.goals[-1].container == "tray"
        return PickReport("tray_full") if full or world.goals[-1].container == "full" else picked(number, tries)

    write_list(tmp_path / "list.csv", PLACES)
    world = JobWorld(PLACES, tmp_path, says)
    result = world.run(DisassembleGoal(list="list.csv", job="pack.sqlite", screws=("tray", "full")))
    assert not result.success and "empty them and start again" in result.reason
    assert result.value.fates.count("in_tray") == 5 and result.value.fates.count("open") == 27
    world.says = picked
    assert world.run(DisassembleGoal(job="pack.sqlite")).value.fates == ["in_tray"] * 32


def test_a_robot_that_gets_nowhere_gives_up_and_the_job_is_kept(tmp_path: Path) -> None:
    write_list(tmp_path / "list.csv", PLACES)
    result = JobWorld(PLACES, tmp_path, fails="Dock").run(GOAL)
    assert (result.success, result.stage, result.slot) == (False, "detect", "skill")
    assert set(result.value.fates) == {"open"} and (tmp_path / "pack_inventory.html").exists()


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ([], "names no fastener"),
        (["screw,0.1,0.1,0", "nut,0.108,0.1,0"], "line 3: Nut_3 is at the place of Screw_2"),
        (["screw,nan,0.1,0"], "line 2: x is 'nan', not a number from -0.1 to 3"),
        (["screw,inf,0.1,0"], "x is 'inf'"),
        (["screw,0.1,0.1,0.857"], "z is '0.857', not a number from -0.3 to 0.3; places are metres in the pack frame"),
        (["screw,22,466,0"], "x is '22'"),
        (["rivet,0.1,0.1,0"], "the class 'rivet' is unknown; valid: screw, bolt, nut, hole, tray"),
        ([f"screw,{k * 1e-4},0,0" for k in range(10_000)], "has 10000 rows; a pack has at most 500"),
        (["screw,0.1"], "y is '', not a number"),
        (["hole,0.1,0.1,0"], "names no fastener"),
        (["\0\xff"], "unknown"),
    ],
)
def test_a_bad_list_is_refused_in_a_sentence(rows: list[str], said: str, tmp_path: Path) -> None:
    (tmp_path / "list.csv").write_text("\n".join(["class,x,y,z", *rows]))
    with pytest.raises(ConfigError) as refused:
        read_list(tmp_path / "list.csv", {"tray"})
    assert said in str(refused.value) and "\n" not in str(refused.value)
    assert not list(tmp_path.glob("*.sqlite"))


def test_a_list_in_another_frame_or_absent_or_no_text_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("class,x,y,z,frame\nscrew,0,0,0,floor_link\n")
    (tmp_path / "b.csv").write_bytes(b"\xff\xfe\x00")
    for name, said in (("a", "the frame is 'floor_link'"), ("b", "cannot be read"), ("c", "cannot be read")):
        with pytest.raises(ConfigError, match=said):
            read_list(tmp_path / f"{name}.csv", {"tray"})


def test_a_file_that_is_in_use_of_another_version_or_of_another_list_is_said(tmp_path: Path) -> None:
    write_list(tmp_path / "list.csv", PLACES)
    listed = read_list(tmp_path / "list.csv", {"tray"})
    path = tmp_path / "pack.sqlite"
    with pytest.raises(JobFault, match="There is no job"):
        JobFile(path)
    book = JobFile(path, listed)
    with pytest.raises(JobFault, match="another process has it open"):
        JobFile(path, listed)
    book.close()
    with pytest.raises(JobFault, match="of another list"):
        JobFile(path, listed[1:])
    for change in ("PRAGMA user_version=7", "PRAGMA user_version=0"):
        base = sqlite3.connect(path)
        base.execute(change)
        base.close()
        with pytest.raises(JobFault, match="no job of this version"):
            JobFile(path)
    path.write_bytes(b"no database at all" * 99)
    with pytest.raises(JobFault, match="cannot be used"):
        JobFile(path)


def test_a_file_that_may_not_be_written_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, connect = tmp_path / "pack.sqlite", sqlite3.connect
    base = connect(path)
    base.execute("CREATE TABLE events (id INTEGER)")
    base.close()
    monkeypatch.setattr(sqlite3, "connect", lambda at, **more: connect(f"file:{at}?mode=ro", uri=True, **more))
    with pytest.raises(JobFault, match="may not be written"):
        JobFile(path)


def test_an_inventory_that_is_a_link_is_not_written_to_and_the_job_ends_all_the_same(tmp_path: Path) -> None:
    (tmp_path / "mine").write_text("mine")
    (tmp_path / "pack_inventory.html").symlink_to(tmp_path / "mine")
    _, ends = job(tmp_path)
    assert ends == [Fate.IN_TRAY] * 32 and (tmp_path / "mine").read_text() == "mine"


def test_goals_without_sense_are_refused() -> None:
    for wrong in ({"list": "../pack.csv"}, {"list": "pack.txt"}, {"job": "/tmp/a.sqlite"}, {"screws": ()}):
        with pytest.raises(ConfigError):
            DisassembleGoal(**wrong)  # pyright: ignore


def gantry(world: JobWorld, names: list[str], every: float) -> None:
    """Let a gantry say one name after the other, which it then is at."""
    says, n = world.context.refresh, 0

    def refresh(t: float) -> None:
        nonlocal n
        if n < len(names) and t >= (n + 1) * every:
            said = f"Remove: {names[n]} with confidence = 0.9"
            world.bus.publish(topics.REMOVALS, said, t)
            n += 1
        says(t)

    world.context.refresh = refresh  # pyright: ignore[reportAttributeAccessIssue]


def test_beside_a_gantry_only_what_it_is_done_with_is_taken_and_nothing_near_it(tmp_path: Path) -> None:
    write_list(tmp_path / "list.csv", PLACES)
    names = [f"Screw_{k}" for k in (2, 3, 31, 31, 999, 32)]  # names are those of the lines of the list
    world = JobWorld(PLACES, tmp_path)
    gantry(world, names, 5.0)
    result = world.run(DisassembleGoal(list="list.csv", job="pack.sqlite", loosened="gantry"), 30_000)
    ends = result.value.fates
    assert result.success and ends[0] == ends[1] == "in_tray", result.reason
    # It stays at Screw_32, the far right corner: what is near it waits.
    at = PLACES[30]
    assert ends[2:29] == ["open"] * 27 and ends[29:] == ["in_tray", "open", "open"]
    assert all(np.hypot(*(PLACES[k] - at)[:2]) > KEEP_OFF for k in world.asked)
    assert world.t > 30.0 + SILENT


def test_words_of_a_gantry_that_say_nothing_are_left_out() -> None:
    bus = Bus()
    context = Context(bus, Kinematics(), 0.01, modules())
    listens = Gantry(context, {"A"})
    for k, text in enumerate(
        ("", "Remove: ", "Remove: A with confidence = 0.5", "x" * 100_000, "Remove: A with confidence = nan")
    ):
        bus.publish(topics.REMOVALS, text, float(k))
        context.refresh(float(k))
        bus.deliver(float(k))
        listens()
    assert (listens.at, listens.loosened) == ("A", set())


def test_frames_are_related_by_three_places_that_are_known_in_both() -> None:
    rng, truth = np.random.default_rng(0), PlanarPose(1.0, -2.0, 2.5)
    a = rng.uniform(-1.0, 1.0, (3, 2))
    T = truth.matrix()
    found, off = fit_frames(a, a @ T[:2, :2].T + T[:2, 3])
    assert (found.x, found.y, found.yaw) == pytest.approx((1.0, -2.0, 2.5)) and off < 1e-9
    _, off = fit_frames(a, a @ T[:2, :2].T + T[:2, 3] + rng.normal(0.0, 0.005, (3, 2)))
    assert 0.0005 < off < 0.02
    known, seen = matched(np.array([[0.0, 0.0], [0.1, 0.0]]), np.array([[0.11, 0.0], [0.9, 0.0]]), 0.045)
    assert known.tolist() == [[0.1, 0.0]] and seen.tolist() == [[0.11, 0.0]]


def test_people_see_how_far_it_is(tmp_path: Path) -> None:
    world, fates = job(tmp_path)
    shown = world.context.bus.latest(topics.PACK_PLAN)
    assert shown is not None and set(fates) == {Fate.IN_TRAY}
    green = (shown.rgb == COLOURS[Fate.IN_TRAY]).all(axis=2)
    assert green.sum() > 20 * len(PLACES)
