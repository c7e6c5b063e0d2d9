"""`golem run` takes its own options and those of the skill's goal from one command line."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from golem.errors import ConfigError
from golem.interfaces.payloads import Feedback
from golem.run import Narrator, RunConfig, read_run, run_stack

BLIND = """
class Blind:
    latency = 0.0
    def locate(self, frame, labels):
        return []
"""


@pytest.mark.parametrize(
    ("words", "config", "goal"),
    [
        ([], RunConfig(), []),
        (["stand", "--seed", "3", "--no-view"], RunConfig("stand", seed=3), []),
        (["x.yaml", "--skill", "walk", "1", "-0.5"], RunConfig("x.yaml", skill="walk"), ["1", "-0.5"]),
        (
            ["x.yaml", "--skill=walk", "--x", "1", "--seed", "3", "--view", "--yaw=2", "--profile=ideal"],
            RunConfig("x.yaml", skill="walk", seed=3, view=True, profile="ideal"),
            ["--x", "1", "--yaw=2"],
        ),
        (["--skill", "walk", "-h"], RunConfig(skill="walk"), ["-h"]),
    ],
)
def test_what_follows_the_skill_is_its_goal_but_for_options(
    words: list[str], config: RunConfig, goal: list[str]
) -> None:
    assert read_run(words) == (config, goal)


def test_a_skill_is_run_in_lock_step(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "blind.py").write_text(BLIND)
    (tmp_path / "x.yaml").write_text(f"localizer: '{tmp_path / 'blind.py'}:Blind'\nprofile: ideal")
    result = run_stack(*read_run([str(tmp_path / "x.yaml"), "--skill", "stand", "0.1"]))
    assert result.success and "Standing for 0.1 s." in capsys.readouterr().out
    result = run_stack(*read_run([str(tmp_path / "x.yaml"), "--skill", "walk", "1"]))
    assert result.stage == "refused" and "do not walk" in capsys.readouterr().out


class Bus:
    """Holds the feedback that a test says."""

    def __init__(self) -> None:
        self.said: Feedback | None = None

    def read(self) -> Feedback | None:
        return self.said


def test_the_narrator_prints_each_new_sentence_once_whatever_its_figures(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    bus = Bus()
    monkeypatch.setattr("golem.run.News", lambda *_: bus)
    narrator = Narrator(SimpleNamespace(bus=None))  # type: ignore[arg-type]
    for t, text in enumerate(("Looking.", "Few are seen. Looking around.", "Sure to 2.0 mm.", "Sure to 1.5 mm.")):
        bus.said = Feedback(float(t), "pick", "detect", text, {})
        narrator()
    said = capsys.readouterr().out.splitlines()
    assert [line.split("detect")[1].strip() for line in said] == [
        "Looking.",
        "Few are seen. Looking around.",
        "Sure to 2.0 mm.",
    ]


def test_legs_that_do_not_balance_are_said_to_fall(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "held.yaml"
    path.write_text("robot: {use: mujoco, support: ground}\nlower_body: {use: hold}\n")
    with pytest.raises(ConfigError, match="not both"):
        run_stack(RunConfig(str(path), skill="pick", operate=True))
    assert "lower_body: hold does not balance, and the robot is on its feet" in capsys.readouterr().out
    with pytest.raises(ConfigError, match="not both"):
        run_stack(RunConfig("stand", skill="pick", operate=True))
    assert capsys.readouterr().out == ""
