from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from golem.demo import SHOWN, Demo, DemoConfig, run_demo, work_place
from golem.errors import ConfigError, GolemError, OutputError
from golem.evaluation.report.demo_page import PickRecord, balance_figures, balance_section, demo_page
from golem.provenance import commit
from golem.robots.mujoco.balance import BalanceTrace
from golem.robots.mujoco.engine import MujocoRobot
from golem.run import no_display
from golem.runtime.lockstep import LockstepRunner, build
from golem.stack import load_stack


@pytest.mark.parametrize("variable", ["DISPLAY", "WAYLAND_DISPLAY"])
def test_a_display_is_noticed(variable: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    assert no_display() and DemoConfig().headless
    monkeypatch.setenv(variable, ":0")
    assert not no_display() and not DemoConfig().headless


@pytest.mark.parametrize(
    ("options", "words"),
    [({"screws": 0}, "from 1 on"), ({"screws": 99, "layout": "nominal"}, "1 to 4"), ({"profile": "dream"}, "ideal")],
)
def test_wrong_options_are_answered_in_one_sentence(options: dict[str, object], words: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=words):
        run_demo(DemoConfig(headless=True, out=tmp_path, **options))  # pyright: ignore[reportArgumentType]
    assert list(tmp_path.iterdir()) == []


def test_a_world_without_screws_is_named(tmp_path: Path) -> None:
    mine = tmp_path / "mine.yaml"
    mine.write_text("robot: {use: mujoco, support: ground, world: open}\nlower_body: almi\n")
    with pytest.raises(ConfigError, match="no screws; give one with 'world: pack'"):
        run_demo(DemoConfig(stack=str(mine), headless=True, out=tmp_path / "demo"))


def test_the_work_place_is_the_seeds_own() -> None:
    stack = work_place(DemoConfig(stack="tether", layout="varied"))
    built = [build(stack, seed)[1] for seed in (1, 2)]
    places = []
    for robot in built:
        assert isinstance(robot, MujocoRobot)
        places.append((robot.scene.layout.near_edge, robot.scene.layout.tray_xy))
        assert len(robot.scene.names.screws) >= 2 and robot.scene.conditions.light == SHOWN["light"]
        robot.close()
    assert places[0] != places[1]
    assert work_place(DemoConfig(stack="tether")) == load_stack("tether", profile="bench")


@pytest.fixture(scope="module")
def upright() -> Iterator[tuple[LockstepRunner, MujocoRobot]]:
    """A robot that has just been let go."""
    running, robot = build(load_stack("stand"), 0)
    running.executor.run(3.0)
    yield running, robot
    robot.close()


def test_the_push_at_the_end_is_survived_and_reported(
    upright: tuple[LockstepRunner, MujocoRobot], tmp_path: Path
) -> None:
    demo = Demo(DemoConfig(seed=0, headless=True, out=tmp_path), *upright)
    executor = upright[0].executor
    executor.run(executor.t + 0.1, lambda: demo.tick() is not None)
    demo.push(demo.tick)
    assert demo.stands()
    assert not demo.write([])  # no screw was pulled
    figures = json.loads((tmp_path / "demo.json").read_text())
    assert figures["success"] is figures["fallen"] is False
    assert figures["balance"]["push_margin_final"] > 0.05
    report = (tmp_path / "report.html").read_text()
    assert "A push at the end" in report and "It stood on its own feet" in report
    assert commit() in report and "mujoco" in report
    assert f"golem demo --stack stand --headless --profile bench --seed 0 --out {tmp_path}" in report


def test_a_robot_that_fell_has_failed_and_the_report_says_so(
    upright: tuple[LockstepRunner, MujocoRobot], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    demo = Demo(DemoConfig(screws=1, headless=True, out=tmp_path), *upright)
    demo.tick()
    monkeypatch.setattr(demo, "in_tray", lambda: ["screw_09"])
    demo.recorder.fallen = True
    assert demo.lost() and demo.over()
    assert not demo.write([])
    assert json.loads((tmp_path / "demo.json").read_text())["screws_in_tray"] == ["screw_09"]
    assert "The robot fell." in (tmp_path / "report.html").read_text()


def test_without_the_extra_the_demonstration_ends_well_and_says_how_to_get_the_report(
    upright: tuple[LockstepRunner, MujocoRobot],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    demo = Demo(DemoConfig(headless=True, out=tmp_path), *upright)
    demo.tick()
    monkeypatch.setitem(sys.modules, "jinja2", None)
    demo.write([])
    assert [path.name for path in tmp_path.iterdir()] == ["demo.json"]
    assert "golem-humanoid[report]" in capsys.readouterr().out


def test_a_folder_that_cannot_be_written_is_noticed_before_anything_runs(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="choose another"):
        run_demo(DemoConfig(headless=True, out=tmp_path / "file" / "demo"))
    if os.geteuid() != 0:
        (tmp_path / "locked").mkdir(mode=0o500)
        with pytest.raises(GolemError, match="Permission denied"):
            run_demo(DemoConfig(headless=True, out=tmp_path / "locked"))


def test_the_page_names_every_pick_and_escapes_what_it_quotes() -> None:
    picks = [
        PickRecord(True, "screw_09", "done", "Fine.", 0.0, 8.5, [("detect", 0.2), ("servo", 2.0), ("done", 0.0)]),
        PickRecord(False, None, "extract", "It <slipped>.", 8.5, 5.0, [("detect", 0.1), ("extract", 1.0)]),
    ]
    poster = np.zeros((9, 16, 3), np.uint8)
    page = demo_page("1 of 2", picks, None, ["demo.webp", "demo.mp4"], poster, {"command": "golem demo"}, [])
    assert "screw_09 in the tray" in page and "lost in extract" in page
    assert "<slipped>" not in page and "&lt;slipped&gt;" in page
    assert 'src="demo.mp4"' in page and 'href="demo.webp"' in page
    assert 'poster="data:image/jpeg;base64,' in page, "the film shows something before it is played"
    assert "http" not in page  # needs no network


def test_work_and_push_are_told_apart() -> None:
    margin = np.full(500, 0.1)
    margin[200:220] = -0.15
    three = np.zeros((500, 3))
    t = np.linspace(0.0, 4.99, 500, dtype=np.float64)
    whole = BalanceTrace(t, margin, three, three, np.zeros(500), three, np.ones((500, 2), bool), three)
    assert balance_figures(whole, None)["margin_min"] == -0.15
    figures = balance_figures(whole, 1.95)
    assert (figures["margin_min"], figures["push_margin_min"], figures["push_margin_final"]) == (0.1, -0.15, 0.1)
    work, push = balance_section(whole, 1.95, figures)
    assert "100 mm or more" in work[1] and "Minimum margin -150 mm" in push[1]
    assert work[2].startswith("<svg") and push[2].startswith("<svg")
    assert len(balance_section(whole, None, balance_figures(whole, None))) == 1
