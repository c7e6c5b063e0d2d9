from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from golem.dashboard.page import PickRecord, render_page
from golem.demo import Demo, DemoConfig, run_demo
from golem.errors import ConfigError, GolemError, OutputError
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
    [({"screws": 0}, "from 1 on"), ({"screws": 99}, "1 to 4"), ({"profile": "dream"}, "ideal")],
)
def test_wrong_options_are_answered_in_one_sentence(
    options: dict[str, object], words: str, tmp_path: Path
) -> None:
    with pytest.raises(ConfigError, match=words):
        run_demo(DemoConfig(headless=True, out=tmp_path, **options))  # pyright: ignore[reportArgumentType]
    assert list(tmp_path.iterdir()) == []


def test_a_world_without_screws_is_named(tmp_path: Path) -> None:
    mine = tmp_path / "mine.yaml"
    mine.write_text("robot: {use: mujoco, support: ground, world: open}\nestimator: random_walk_kf\n")
    with pytest.raises(ConfigError, match="no screws; give one with 'world: pack'"):
        run_demo(DemoConfig(stack=str(mine), headless=True, out=tmp_path / "demo"))


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
    demo = Demo(DemoConfig(headless=True, out=tmp_path), *upright)
    executor = upright[0].executor
    executor.run(executor.t + 0.1, lambda: demo.tick() is not None)
    demo.push(demo.tick)
    assert demo.stands()
    result = demo.write([])
    assert not result.success  # no screw was pulled
    figures = json.loads((tmp_path / "demo.json").read_text())
    assert figures["success"] is figures["fallen"] is False
    assert figures["balance"]["push_margin_final"] > 0.05
    report = result.report.read_text()
    assert "A push at the end" in report and "It stood on its own feet" in report


def test_a_robot_that_fell_has_failed_and_the_report_says_so(
    upright: tuple[LockstepRunner, MujocoRobot], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    demo = Demo(DemoConfig(screws=1, headless=True, out=tmp_path), *upright)
    demo.tick()
    monkeypatch.setattr(demo, "in_tray", lambda: ["screw_09"])
    demo.recorder.fallen = True
    assert demo.lost() and demo.over()
    result = demo.write([])
    assert result.screws == ["screw_09"] and not result.success
    assert "The robot fell." in result.report.read_text()


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
        PickRecord(
            True, "screw_09", "done", "Fine.", 0.0, 8.5, [("detect", 0.2), ("servo", 2.0), ("done", 0.0)]
        ),
        PickRecord(False, None, "extract", "It <slipped>.", 8.5, 5.0, [("detect", 0.1), ("extract", 1.0)]),
    ]
    page = render_page("1 of 2", picks, None, ["demo.gif", "demo.mp4"], {"seed": "0"})
    assert "screw_09 in the tray" in page and "lost in extract" in page
    assert "<slipped>" not in page and "&lt;slipped&gt;" in page
    assert 'src="demo.mp4"' in page and 'src="demo.gif"' in page
    assert "http" not in page  # needs no network
