"""Sentences become calls of tools, and a recorded session can be made again."""

from __future__ import annotations

import io
import os
import signal
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from tests.agent.fake_body import FakeBody, Rig

from golem.agent.answers import words
from golem.agent.sentences import SentencePlanner, replay
from golem.agent.tool_rules import Rules
from golem.agent_command import McpConfig, run_mcp
from golem.errors import ConfigError
from golem.evaluation.rungs.errands import SUITE

PLACE = {
    "x": 0.5, "y": 0.2, "z": -0.1, "first_seen": 90_000.0, "last_seen": 86_000.0, "evidence": words("seen"),
}  # fmt: skip


class Robot:
    """Answers as one whose memory has one place of everything, and before which stand three screws."""

    def __init__(self, tight: int = 0, places: Sequence[Mapping[str, Any]] = (PLACE,)) -> None:
        self.calls: list[tuple[str, Mapping[str, Any]]] = []
        self.left, self.places = tight, places

    def __call__(self, tool: str, arguments: Mapping[str, Any]) -> dict[str, Any]:
        self.calls.append((tool, arguments))
        done = {
            "success": True,
            "stage": "done",
            "slot": None,
            "reason": words("Done."),
            "value": {"places": self.places},
        }
        if tool == "read":
            return {"success": True, "state": {"base": {"x": 0.0, "y": 0.0, "yaw": 0.0}}}
        if tool == "look":
            seen = [(0.4, 0.3), (0.4, 0.1), (0.4, -0.2)]
            return {"success": True, "found": [{"score": 0.9, "position": [x, y, 0.0]} for x, y in seen]}
        if tool == "pick" and self.left > 0:
            self.left -= 1
            x, y = arguments["wanted"]
            tried = [{"outcome": words("tight"), "x": x, "y": y}]
            return done | {"success": False, "stage": "extract", "slot": "arms", "value": {"tried": tried}}
        return done


def said(sentence: str, tight: int = 0) -> tuple[Any, list[tuple[str, Mapping[str, Any]]]]:
    robot = Robot(tight)
    return SentencePlanner(robot).do(sentence), robot.calls


def test_a_lost_errand_names_what_lost_it() -> None:
    report, _ = said("take out three screws", tight=1)
    assert (report.done, report.stage, report.slot) == (False, "extract", "arms")
    forgetful = SentencePlanner(Robot(places=())).do("where was the mug")
    assert (forgetful.done, forgetful.slot) == (False, "memory")


@pytest.mark.parametrize("places", [(), (PLACE | {"evidence": words("moved")},)])
def test_what_is_not_where_it_was_is_searched(places: Sequence[Mapping[str, Any]]) -> None:
    robot = Robot(places=places)
    assert not SentencePlanner(robot).do("where is the mug").done or places
    assert robot.calls[-1] == ("search", {"text": "mug"})


def test_a_thing_is_brought_to_where_another_was() -> None:
    report, calls = said("Put the mug where the bowl was yesterday.")
    assert calls == [
        ("recall", {"text": "bowl", "when": "at", "limit": 20, "ago": 86400.0}),
        ("fetch", {"text": "mug", "to": [0.5, 0.2], "frame": "seen"}),
    ]
    assert report.done
    assert said("move the can where the bowl was 2 hours ago")[1][0][1]["ago"] == 7200.0
    assert said("put the can back")[1][0][1] == {"text": "can", "when": "anywhere", "limit": 20}
    assert said("set the can 16 cm right of the mug")[1][1][1]["to"] == pytest.approx([0.5, 0.04])


@pytest.mark.parametrize(
    ("newest", "when", "x"),
    [
        ("seen", "", 0.1),
        ("gone", "", 0.0),
        ("seen", " at first", 0.2),
        ("gone", " at first", 0.2),
        ("seen", " before", 0.1),
    ],
)
def test_where_a_thing_was_is_not_where_it_is(newest: str, when: str, x: float) -> None:
    """Nobody looked again at the places before the newest: the memory still has the thing there, too."""
    places = [
        PLACE | {"x": 0.1 * k, "first_seen": 10.0 * (k + 1), "evidence": words(newest if k == 0 else "seen")}
        for k in range(3)
    ]
    robot = Robot(places=places)
    SentencePlanner(robot).do(f"put the can where the mug was{when}")
    assert robot.calls[1][1]["to"] == pytest.approx([x, 0.2])


def test_screws_of_a_side_are_tried_until_enough_are_out() -> None:
    report, calls = said("take out one loose screw on the left and tell me which were tight", tight=1)
    picks = [a["wanted"] for tool, a in calls if tool == "pick"]
    assert picks == [[0.4, 0.1], [0.4, 0.3]] and report.done
    assert report.facts == {"taken": 1, "tight": [[0.4, 0.1]], "jammed": []} and "tight" in report.text
    report, calls = said("take out all loose screws")
    assert report.facts["taken"] == 3
    assert not said("take out the three loose screws on the right")[0].done


def test_a_screw_that_was_not_in_view_is_tried_again_after_another_look() -> None:
    class Blinking(Robot):
        """Its camera shows no screw at the first pick."""

        def __call__(self, tool: str, arguments: Mapping[str, Any]) -> dict[str, Any]:
            answer = super().__call__(tool, arguments)
            first = [tool for tool, _ in self.calls].count("pick") == 1
            unseen = {
                "success": False,
                "stage": "detect",
                "slot": None,
                "reason": words("No screw."),
                "value": {"tried": []},
            }
            return unseen if tool == "pick" and first else answer

    robot = Blinking()
    report = SentencePlanner(robot).do("take out all loose screws")
    picks = [a["wanted"] for tool, a in robot.calls if tool == "pick"]
    assert picks == [[0.4, 0.1], [0.4, -0.2], [0.4, 0.3], [0.4, 0.1]] and report.facts["taken"] == 3 and report.done


def test_questions_are_answered() -> None:
    assert said("where is the mug?")[0].facts == {"place": [0.5, 0.2, -0.1]}
    assert said("how many mugs are on the counter")[0].facts == {"count": 3}
    assert said("find the mug")[0].facts == {"place": [0.5, 0.2, -0.1]}
    assert said("bring me the mug")[1] == [("fetch", {"text": "mug"})]


def test_what_is_not_understood_is_said_with_examples() -> None:
    for sentence in ("", "dance", "put the mug where the bowl was yesterday; and stop", "x" * 10_000):
        with pytest.raises(ConfigError, match="say it as in"):
            said(sentence)


def test_every_errand_of_the_suite_is_understood() -> None:
    assert len(SUITE) == 30
    for errand in SUITE.values():
        sentence = errand["words"].format(a="mug", b="bowl", cm=16, way="left", n=2, side="left")
        assert said(sentence)[1], sentence
        assert errand["judge"]


def test_a_session_is_made_again(tmp_path: Path) -> None:
    (tmp_path / "then").mkdir()
    (tmp_path / "now").mkdir()
    then = Rig(tmp_path / "then", Rules(default="free", calls=100))
    for tool, arguments in (("go", {"x": 1.0}), ("go", {"x": "no"}), ("read", {"resource": "state"}), ("nope", {})):
        then.desk.call(tool, arguments)
    now = Rig(tmp_path / "now", Rules(default="free", calls=100))
    rows = list(replay(then.file, now.desk.call))
    assert [(a, b) for _, a, b in rows] == [(True, True), (False, False), (True, True), (False, False)]
    assert now.body.began == then.body.began
    never = Rig(tmp_path, Rules(default="never", calls=100))
    assert [b for _, _, b in replay(then.file, never.desk.call)] == [False, False, True, False]


def test_each_call_is_compared_with_the_answer_of_its_own_start(tmp_path: Path) -> None:
    for rules in (Rules(default="free"), Rules(default="never")):
        Rig(tmp_path, rules).desk.call("go", {"x": 1.0})
    now = Rig(tmp_path / "now", Rules(default="free"))
    assert [(a, b) for _, a, b in replay(tmp_path / "audit.jsonl", now.desk.call)] == [(True, True), (False, True)]


@pytest.mark.parametrize("change", [("session", "sitting"), ('"answer": {', '"answer": 3, "more": {')])
def test_a_log_that_was_changed_is_refused_before_anything_is_called(tmp_path: Path, change: tuple[str, str]) -> None:
    then, now = (Rig(tmp_path / name, Rules(default="free")) for name in ("then", "now"))
    then.desk.call("go", {"x": 1.0})
    then.file.write_text(then.file.read_text().replace(*change))
    with pytest.raises(ConfigError, match="was changed"):
        list(replay(then.file, now.desk.call))
    assert not now.body.began


@pytest.fixture(params=[signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def number(request: pytest.FixtureRequest) -> Iterator[signal.Signals]:
    """A signal that ends a process, also where the tests run behind `nohup` or `&`, which ignore some."""
    before = signal.signal(
        request.param, signal.default_int_handler if request.param == signal.SIGINT else signal.SIG_DFL
    )
    yield request.param
    signal.signal(request.param, before)


def test_a_robot_on_a_domain_does_not_go_on_when_the_command_is_ended(
    number: signal.Signals, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    then, before = Rig(tmp_path, Rules(default="free")), signal.getsignal(number)
    then.desk.call("go", {"x": 1.0})
    body = FakeBody()

    @contextmanager
    def member(*_: object) -> Iterator[tuple[None, None]]:
        yield None, None

    def step() -> None:
        FakeBody.step(body)
        if len(body.track) == 3:
            body.track.append(0.0)
            os.kill(os.getpid(), number)

    body.step = step
    monkeypatch.setattr("sys.stdin", io.StringIO())
    monkeypatch.setattr("golem.agent_command.member", member)
    monkeypatch.setattr("golem.agent_command.DomainBody", lambda *_: body)
    rules = tmp_path / "rules.yaml"
    rules.write_text("default: free")
    with pytest.raises(KeyboardInterrupt):
        run_mcp(McpConfig(replay=then.file, rules=rules, audit=tmp_path / "now.jsonl"))
    ended = body.result()
    assert ended is not None and ended.stage == "cancelled"
    assert signal.getsignal(number) == before


def test_no_screws_are_taken_where_none_are_wanted() -> None:
    report, calls = said("take out 0 screws")
    assert report.done and report.facts["taken"] == 0 and [tool for tool, _ in calls if tool == "pick"] == []
