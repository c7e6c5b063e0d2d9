"""Whole packs, taken out of by a job: what is kept when the process dies, what is retried, what the inventory says."""

from __future__ import annotations

import csv
import itertools
import random
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.skills.conftest import modules
from tests.skills.job_world import NEAR_EDGE, JobWorld, at, edge_places, picked, write_list

from golem.errors import ConfigError
from golem.interfaces import topics
from golem.middleware.bus import Bus
from golem.robots.model.pinocchio_model import Kinematics
from golem.skills.base import SkillResult
from golem.skills.context import Context
from golem.skills.disassemble_goal import DisassembleGoal
from golem.skills.fastener_list import Listed, read_list
from golem.skills.gantry import KEEP_OFF, SILENT, Gantry
from golem.skills.job_file import Fate, JobFault, JobFile
from golem.skills.pack_picture import COLOURS
from golem.skills.pack_view import SeenFasteners, SeenRim, fit_frames, matched
from golem.skills.pick_config import PickReport, Tried
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


def test_of_a_list_only_what_it_says_to_be_loose_is_tried_and_of_an_unknown_pack_the_others_once(
    tmp_path: Path,
) -> None:
    rows = [f"screw,{x},{y},{z},{int(k < 4)}" for k, (x, y, z) in enumerate(PLACES.tolist())]
    (tmp_path / "list.csv").write_text("\n".join(["class,x,y,z,loose", *rows]))
    world = JobWorld(PLACES, tmp_path)
    assert world.run(DisassembleGoal(list="list.csv", loosened="list")).value.fates[:5] == ["in_tray"] * 4 + ["open"]
    tight = JobWorld(PLACES, tmp_path, lambda number, tries: PickReport("tight"))
    tight.out.clear()
    ends = tight.run(DisassembleGoal(list="list.csv", job="other.sqlite", loosened="unknown")).value.fates
    assert set(ends) == {"tight"} and len(tight.asked) == len(PLACES) + 4
    assert all(tight.asked.count(k) == 2 for k in range(4))


def test_what_was_not_seen_in_the_tray_is_lost_or_tried_again_if_it_is_still_there(tmp_path: Path) -> None:
    def says(number: int, tries: int) -> PickReport:
        return PickReport("picked", [], "no", "yes") if number == 4 else picked(number, tries)

    _, ends = job(tmp_path, says)
    assert ends[4] == Fate.LOST and ends.count(Fate.IN_TRAY) == 31


class Bores(JobWorld):
    """Its head camera takes the bore of number 4 for a fastener."""

    async def see_fasteners(self, *args: Any, **more: Any) -> SeenFasteners:
        out, self.out = self.out, self.out - {4}
        seen = await super().see_fasteners(*args, **more)
        self.out = out
        return seen


@pytest.mark.parametrize(
    ("kind", "world", "fate", "times"),
    [("nut", Bores, Fate.LOST, 1), ("screw", Bores, Fate.MISSING, 2), ("screw", JobWorld, Fate.LOST, 1)],
)
def test_what_was_let_go_and_looks_still_in_place_is_tried_again_but_a_stud_looks_like_its_nut(
    tmp_path: Path, kind: str, world: type[JobWorld], fate: Fate, times: int
) -> None:
    rows = [f"{kind if k == 4 else 'screw'},{x},{y},{z},1" for k, (x, y, z) in enumerate(PLACES.tolist())]
    (tmp_path / "list.csv").write_text("\n".join(["class,x,y,z,loose", *rows]))

    def says(number: int, tries: int) -> PickReport:
        return PickReport("picked", [], "no", "no") if number == 4 else picked(number, tries)

    robot = world(PLACES, tmp_path, says)
    ends = robot.run(DisassembleGoal(list="list.csv")).value.fates
    assert ends[4] == fate and robot.asked.count(4) == times


def test_what_is_in_a_tray_stays_there_whatever_a_hand_seems_to_be_at(tmp_path: Path) -> None:
    class Askew(JobWorld):
        """Its palm camera has number 5 where 4 was."""

        def pick(self, goal: Any) -> SkillResult:
            result = super().pick(goal)
            if self.asked[-1] == 5 and 4 in self.out:
                there = NEAR_EDGE @ at(self.places[4])
                result.value.tried = [Tried(goal.side, there.x, there.y, 0.0, result.value.outcome)]
            return result

    write_list(tmp_path / "list.csv", PLACES)

    def says(number: int, tries: int) -> PickReport:
        return PickReport("tight") if number == 5 else picked(number, tries)

    world = Askew(PLACES, tmp_path, says)
    ends = world.run(DisassembleGoal(list="list.csv", job="pack.sqlite")).value.fates
    assert ends[4:6] == [Fate.IN_TRAY, Fate.TIGHT] and world.asked.count(4) == 1


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


def test_a_tray_that_looks_full_once_is_gone_on_with(tmp_path: Path) -> None:
    write_list(tmp_path / "list.csv", PLACES)
    world = JobWorld(
        PLACES, tmp_path, lambda n, tries: PickReport("tray_full") if len(world.asked) in (3, 9) else picked(n, tries)
    )
    assert world.run(GOAL).value.fates == ["in_tray"] * 32


def test_a_robot_that_gets_nowhere_gives_up_and_the_job_is_kept(tmp_path: Path) -> None:
    write_list(tmp_path / "list.csv", PLACES)
    result = JobWorld(PLACES, tmp_path, fails="approach").run(GOAL)
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


@pytest.mark.parametrize(
    "head",
    ["", "\n", "class;x;y;z", "class\tx\ty\tz", "CLASS,X,Y,Z", "class,x,y,name", "class,x,x,y,z", "class,x,y,z,losse",
     "screw,0.2,0.1,0", "# my pack"],
)  # fmt: skip
def test_a_first_line_that_names_other_columns_is_repeated_with_the_right_ones(head: str, tmp_path: Path) -> None:
    (tmp_path / "list.csv").write_text(f"{head}\n{head.replace('class', 'screw')}\n")
    with pytest.raises(ConfigError, match=r"first line of the list .*list.csv' is '.*'; it names class, x, y, z and"):
        read_list(tmp_path / "list.csv", {"tray"})


def test_a_list_as_spreadsheets_write_it_is_read(tmp_path: Path) -> None:
    path = tmp_path / "list.csv"
    path.write_text("\ufeffclass, x, y, z, name, frame\r\nscrew, 0.1, 0.2, 0, My  screw, pack\r\n,,,,,\r\n", "utf-8")
    assert read_list(path, {"tray"}) == [Listed("My screw", "screw", 0.1, 0.2, 0.0)]
    path.write_text("class,x,y,z\nscrew,0,1,0,2,0\n")
    with pytest.raises(ConfigError, match="line 2: it has more cells than the first line has columns; decimals have"):
        read_list(path, {"tray"})


@pytest.mark.parametrize(
    "change", ["events SET fate = 'dancing'", "events SET number = 99", "events SET x = 'far'", "listed SET x = 'abc'"]
)
def test_a_job_that_says_what_no_job_says_is_damaged_and_stays(change: str, tmp_path: Path) -> None:
    book = JobFile(tmp_path / "pack.sqlite", [Listed("A", "screw", 0.1, 0.2, 0.0)])
    book.tell(book.fasteners[0], Fate.TRYING, 1.0, stance=PlanarPose(0.0, 0.0, 0.0))
    book.close()
    base = sqlite3.connect(tmp_path / "pack.sqlite")
    base.execute(f"UPDATE {change}")
    base.commit()
    base.close()
    for _ in range(2):  # it is closed again
        with pytest.raises(JobFault, match="The job .*pack.sqlite is damaged, .*; name another file"):
            JobFile(tmp_path / "pack.sqlite")


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


def test_a_job_that_goes_on_knows_what_the_gantry_was_done_with(tmp_path: Path) -> None:
    write_list(tmp_path / "list.csv", PLACES)
    book = JobFile(tmp_path / "pack.sqlite", read_list(tmp_path / "list.csv", ()))
    book.loosen("Screw_3")
    book.keep_loosened()
    book.close()
    world = JobWorld(PLACES, tmp_path)
    result = world.run(DisassembleGoal(list="list.csv", job="pack.sqlite", loosened="gantry"), 30_000)
    ends = result.value.fates
    assert [k for k, end in enumerate(ends) if end == "in_tray"] == [1] and set(ends) == {"in_tray", "open"}


def test_words_of_a_gantry_that_say_nothing_are_left_out(tmp_path: Path) -> None:
    bus = Bus()
    context = Context(bus, Kinematics(), 0.01, modules())
    book = JobFile(tmp_path / "pack.sqlite", [Listed("A", "screw", 0.1, 0.2, 0.0)])
    listens = Gantry(context, book)
    for k, text in enumerate(
        ("", "Remove: ", "Remove: A with confidence = 0.5", "x" * 100_000, "Remove: A with confidence = nan")
    ):
        bus.publish(topics.REMOVALS, text, float(k))
        context.refresh(float(k))
        bus.deliver(float(k))
        listens()
    assert (listens.at, book.loosened) == ("A", set())


def test_a_gantry_is_understood_where_a_listed_name_has_blanks(tmp_path: Path) -> None:
    (tmp_path / "list.csv").write_text("class,x,y,z,name\nscrew,0.1,0.2,0,Cover  screw 7\nscrew,0.1,0.4,0,B\n")
    book = JobFile(tmp_path / "pack.sqlite", read_list(tmp_path / "list.csv", ()))
    bus = Bus()
    context = Context(bus, Kinematics(), 0.01, modules())
    listens, at = Gantry(context, book), list[str]()
    for k, name in enumerate(("Cover screw 7", "B", "Cover  screw 7")):
        bus.publish(topics.REMOVALS, f"Remove: {name} with confidence = 0.9", float(k))
        context.refresh(float(k))
        bus.deliver(float(k))
        listens()
        at.append(listens.at)
    assert at == ["Cover screw 7", "B", "Cover screw 7"] and book.loosened == {"Cover screw 7", "B"}


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


def test_nuts_and_screws_go_into_the_listed_trays_for_them_and_a_full_one_is_left(tmp_path: Path) -> None:
    places = edge_places(8)
    kinds = ["nut" if k % 2 else "screw" for k in range(len(places))]
    rows = [f"{kind},{x:.4f},{y:.4f},{z:.4f},," for kind, (x, y, z) in zip(kinds, places.tolist(), strict=True)]
    trays = {"a": (0.145, -0.4, "bolt"), "b": (0.145, 0.1, "nut"), "c": (0.145, 0.4, "nut"), "d": (1.0, -0.6, "screw")}
    rows += [f"tray,{x},{y},0.01,{name},{takes}" for name, (x, y, takes) in trays.items()]
    (tmp_path / "list.csv").write_text("\n".join(["class,x,y,z,name,takes", *rows]))

    def says(number: int, tries: int) -> PickReport:
        full = np.hypot(*(NEAR_EDGE.matrix()[:2, 3] + trays["b"][:2] - world.goals[-1].container_at)) < 0.05
        return PickReport("tray_full") if full and kinds[number] == "nut" else picked(number, tries)

    world = JobWorld(places, tmp_path, says)
    world.run(GOAL)
    book = JobFile(tmp_path / "pack.sqlite")
    book.close()
    assert {one.tray for one in book.fasteners if one.label == "screw"} == {"a", "d", ""}
    assert {one.tray for one in book.fasteners if one.label == "nut"} == {"c", ""}
    assert [one.fate for one in book.fasteners].count(Fate.IN_TRAY) > 4


def test_what_a_palm_camera_is_off_by_is_told_to_the_next_pick_of_that_hand(tmp_path: Path) -> None:
    write_list(tmp_path / "list.csv", PLACES)
    world = JobWorld(PLACES, tmp_path)
    world.palm_off = (0.03, -0.02)
    result = world.run(GOAL)
    assert result.value.fates == ["in_tray"] * 32 and world.asked == list(dict.fromkeys(world.asked))
    for side in ("left", "right"):
        picks = (goal for goal in world.goals if hasattr(goal, "off"))
        told = [off for goal, off in zip(picks, world.told, strict=True) if goal.side == side]
        assert told[0] == () and told[1:] == [pytest.approx(world.palm_off, abs=1e-3)] * (len(told) - 1)


def test_a_hand_that_finds_nothing_learns_anew_what_its_camera_is_off_by(tmp_path: Path) -> None:
    write_list(tmp_path / "list.csv", PLACES)

    def says(number: int, tries: int) -> PickReport:
        return PickReport("nothing_there" if number == 9 else "picked", [], "yes", "yes")

    world = JobWorld(PLACES, tmp_path, says)
    world.palm_off = (0.03, -0.02)
    world.run(GOAL)
    picks = [goal for goal in world.goals if hasattr(goal, "off")]
    for side in ("left", "right"):
        mine = [k for k, goal in enumerate(picks) if goal.side == side]
        for before, after in itertools.pairwise(mine):
            assert (world.told[after] == ()) == (world.asked[before] == 9)


def test_a_neighbour_is_not_taken_for_what_was_let_go(tmp_path: Path) -> None:
    places = np.concatenate([PLACES, PLACES[:1] + (0.0, 0.028, 0.0)])
    write_list(tmp_path / "list.csv", places)
    world = JobWorld(places, tmp_path, lambda number, tries: PickReport("picked", [], "no" if number == 0 else "yes"))
    assert world.run(GOAL).value.fates[0] == "lost" and world.asked.count(0) == 1


def test_a_head_camera_that_looks_aside_shows_a_rim_that_slopes() -> None:
    rng = np.random.default_rng(0)
    places = rng.uniform((0.0, -0.4), (0.6, 0.4), (12, 2))
    heights = -0.1 + places @ (0.05, -0.08) + 0.002 * rng.normal(size=12)
    rim = SeenRim().seen(places, heights)
    assert rim.at(np.array([0.3, 0.5, 0.0])) == pytest.approx(-0.1 + 0.3 * 0.05 - 0.5 * 0.08, abs=0.008)
    row = SeenRim().seen(np.column_stack([np.full(12, 0.02), places[:, 1]]), np.full(12, -0.1))
    assert row.at(np.array([0.6, 0.0])) == pytest.approx(-0.1, abs=1e-6)
    mistaken = heights - 0.065 * (np.arange(12) % 5 == 0)
    assert SeenRim().seen(places, mistaken).at(places[3]) == pytest.approx(heights[3], abs=0.012)
    few = rim.seen(places[:2], heights[:2] - 0.02)
    assert few.at(np.array([0.3, 0.5, 0.0])) == pytest.approx(rim.at(np.array([0.3, 0.5])) - 0.02, abs=0.006)
