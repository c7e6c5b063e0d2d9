"""What `golem skill` makes of its words, and of what the stack on the domain tells it."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from tests.runtime.live.conftest import Live

from golem.errors import ConfigError
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.ros.future import RosError
from golem.middleware.ros.msgs.golem_interfaces import RunSkill_Goal
from golem.middleware.ros.node import RosNode
from golem.runtime.live import skill_client
from golem.runtime.live.skill_client import BAD_INPUT, CANCELED, DONE, SkillClientConfig, compose, read_words
from golem.stack import Choice
from golem.types import TICK

WAVE = '''
from dataclasses import dataclass
from golem.skills.base import SkillResult

@dataclass
class Goal:
    """How.

    Attributes:
        times: how often.
    """

    times: int = 3

class Wave:
    """Wave with a hand."""

    Goal = Goal

    def timeout(self, goal):
        return 9.0

    async def run(self, context, goal):
        return SkillResult(True, "done", None, f"Waved {goal.times} times.")
'''


@pytest.fixture
def waving(live: Live, tmp_path: Path) -> Live:
    """A robot whose stack has the skill `wave`."""
    live.leave("up")
    (tmp_path / "wave.py").write_text(WAVE)
    live.stack = replace(live.stack, skills={"wave": Choice(f"{tmp_path / 'wave.py'}:Wave")})
    live.start_up()
    return live


def say(live: Live, *words: str) -> RunSkill_Goal:
    """Return the goal that the words of a command line say."""
    config, rest = read_words(list(words))
    return compose(live.member("skill")[1], config, rest, "start it")


def test_options_of_the_domain_may_stand_anywhere() -> None:
    config, rest = read_words(["pick", "bolt", "--side", "left", "--domain", "9"])
    assert config == SkillClientConfig(dds=DdsConfig(domain=9)) and rest == ["pick", "bolt", "--side", "left"]


def test_the_stack_on_the_domain_says_what_a_goal_consists_of(waving: Live) -> None:
    goal = say(waving, "pick", "bolt", "--side", "left")
    assert (goal.skill, json.loads(goal.goal)) == (
        "pick",
        {"label": "bolt", "container": "tray", "side": "left"}
        | {"avoid": [], "wanted": [], "level": [], "container_at": [], "off": [], "landmarks": []},
    )
    goal = say(waving, "wave", "5")
    assert (goal.skill, json.loads(goal.goal)) == ("wave", {"times": 5})


def test_a_class_of_a_file_is_found_by_the_name_that_the_stack_has_for_it(waving: Live, tmp_path: Path) -> None:
    goal = say(waving, f"{tmp_path / 'wave.py'}:Wave", "--times", "2")
    assert (goal.skill, json.loads(goal.goal)) == ("wave", {"times": 2})
    (tmp_path / "other.py").write_text(WAVE)
    with pytest.raises(ConfigError, match="Unknown skill '.*; valid: .*stand, take, walk, wave"):
        say(waving, f"{tmp_path / 'other.py'}:Wave")


def test_a_stack_file_may_say_it_instead(waving: Live, tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text(f"skills: {{wave: {{use: '{tmp_path / 'wave.py'}:Wave'}}}}")
    goal = say(waving, "wave", "--stack", str(tmp_path / "mine.yaml"))
    assert json.loads(goal.goal) == {"times": 3}


def test_a_wrong_skill_gets_the_near_one(waving: Live) -> None:
    with pytest.raises(ConfigError, match="Did you mean 'wave'"):
        say(waving, "wvae")
    with pytest.raises(ConfigError, match="Say which skill"):
        skill_client.run_skill([])


def test_a_domain_without_a_stack_is_named(live: Live, monkeypatch: pytest.MonkeyPatch) -> None:
    live.leave("up")
    monkeypatch.setattr(skill_client, "SEARCH", 0.02)
    with pytest.raises(RosError, match="No stack tells its skills; start it"):
        say(live, "pick")


def test_help_lists_the_shipped_skills_where_there_is_no_stack(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def nobody(*_: object) -> None:
        raise RosError("No stack tells its skills.")

    monkeypatch.setattr(skill_client, "member", nobody)
    assert skill_client.run_skill(["--help"]) == DONE
    assert "walk       Walk to a pose on the floor and stand there" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        skill_client.run_skill(["walk", "--help"])
    assert "pose of base_link on the floor [m], [rad]." in capsys.readouterr().out.replace("\n", " ")


class Impatient(RosNode):
    """A node that lets the robot's time pass while it waits."""

    live: Live
    beside: Callable[[], None] = staticmethod(lambda: None)

    def spin_once(self, timeout: float) -> int:
        self.live.run(TICK)
        self.beside()
        return self.poll()


@pytest.fixture
def node(waving: Live) -> Impatient:
    """Somebody beside a robot that may move."""
    waving.activate()
    waving.run(0.02)
    node = Impatient(waving.domain.participant(), "skill")
    node.live = waving
    return node


@pytest.mark.parametrize(
    ("goal", "code", "said"),
    [
        (RunSkill_Goal("wave", '{"times": 2}'), DONE, "succeeded: Waved 2 times."),
        (RunSkill_Goal("walk", '{"x": 2}'), BAD_INPUT, "refused: The legs, 'hold', do not walk"),
    ],
)
def test_a_goal_is_pursued_to_its_end(
    node: Impatient, goal: RunSkill_Goal, code: int, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert skill_client.pursue(node, goal, "", threading.Event()) == code
    assert said in capsys.readouterr().out


@pytest.mark.parametrize(
    ("interrupts", "said"), [(1, "canceled: The skill was cancelled."), (2, "Leaving without an answer")]
)
def test_the_first_interrupt_cancels_and_the_second_leaves(
    node: Impatient, interrupts: int, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    stop, goal = threading.Event(), RunSkill_Goal("stand", '{"seconds": 9}')
    start, left = node.live.clock + 0.2, [None] * interrupts

    def interrupt() -> None:
        if left and node.live.clock > start:
            left.pop()
            stop.set()

    node.beside = interrupt
    assert skill_client.pursue(node, goal, "", stop) == CANCELED
    output = capsys.readouterr().out
    assert "Canceling; Ctrl-C again leaves at once." in output and said in output
