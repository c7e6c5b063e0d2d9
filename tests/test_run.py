"""`golem run` takes its own options and those of the skill's goal from one command line."""

from __future__ import annotations

from pathlib import Path

import pytest

from golem.run import RunConfig, read_run, run_stack

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
