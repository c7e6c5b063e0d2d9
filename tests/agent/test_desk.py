"""One motion at a time, within the rules, by the operator's leave; and every word of it in the log."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any, cast

import pytest
from tests.agent.fake_body import HOSTILE, Rig

from golem.agent.audit import AuditLog
from golem.agent.desk import Answer, Call
from golem.agent.tool_rules import Region, Rules, ToolRule
from golem.errors import OutputError

FREE = Rules(default="free", calls=1000)


@pytest.fixture
def rig(tmp_path: Path, request: pytest.FixtureRequest) -> Rig:
    return Rig(tmp_path, getattr(request, "param", FREE))


def given(*rules: Rules) -> Any:
    return pytest.mark.parametrize("rig", rules, indirect=True)


def ask(rig: Rig, tool: str, session: str = "a", **arguments: Any) -> Call:
    """Hand a call in and let the desk take it, and no time pass beyond a turn."""
    call = Call(session, tool, arguments)
    rig.desk.submit(call)
    rig.desk.turn()
    return call


def ended(rig: Rig, call: Call) -> dict[str, Any]:
    for _ in range(300):
        if call.answered.done():
            break
        rig.desk.turn()
    answer: Answer = call.answered.result(0)
    return answer.data


def reason(data: dict[str, Any]) -> str:
    return data["reason"]["text"]


def test_a_free_tool_runs_and_answers_as_it_said_it_would(rig: Rig) -> None:
    data = rig.desk.call("go", {"x": 1.0})
    assert data["success"] and data["stage"] == "done"
    assert rig.body.began == [("go", {"x": 1.0, "y": 0.0, "steps": 3, "frame": "odom", "label": ""})]
    assert rig.events() == ["begin", "call", "begin skill", "answer"]


def test_words_from_the_world_are_marked_and_show_every_character(rig: Rig) -> None:
    data = rig.desk.call("go", {"x": 1.0})
    seen = HOSTILE.replace("\u202e", " ").replace("\u200b", " ")
    assert data["reason"] == {"from_world": True, "text": seen}
    assert data["value"]["places"][0]["label"] == {"from_world": True, "text": seen}
    looked = rig.desk.call("look", {"camera": "head", "labels": ["mug"]})
    assert looked["found"][0]["label"]["from_world"] is True
    assert HOSTILE not in json.dumps(data, ensure_ascii=False)


@pytest.mark.parametrize(
    ("tool", "arguments"),
    [
        ("nope", {}),
        ("", {}),
        ("go", {}),
        ("go", {"x": "1"}),
        ("go", {"x": float("nan")}),
        ("go", {"x": float("inf")}),
        ("go", {"x": True}),
        ("go", {"x": None}),
        ("go", {"x": 10**400}),
        ("go", {"x": 1.0, "steps": 0}),
        ("go", {"x": 1.0, "steps": 101}),
        ("go", {"x": 1.0, "steps": 2.5}),
        ("go", {"x": 1.0, "frame": "moon"}),
        ("go", {"x": 1.0, "approved": True}),
        ("go", {"x": 1.0, "label": "bad"}),
        ("go", {"x": 1.0, "label": "x" * 10_000_000}),
        ("go", {"x": 1.0, "label": ["x"] * 1_000_000}),
        ("go", {"x": 1.0, "label": "\ud800"}),
        ("go", {"x": [[[[[[[[[[1.0]]]]]]]]]]}),
        ("look", {"camera": "rear"}),
        ("look", {"camera": "head", "labels": [1]}),
        ("look", {"camera": "head", "labels": "mug"}),
        ("look", {"rm": "-rf"}),
        ("read", {"resource": "secrets"}),
        ("read", {"resource": ["state"]}),
        ("read", {}),
        ("__init__", {"self": 1}),
    ],
)
def test_what_makes_no_sense_moves_nothing(rig: Rig, tool: str, arguments: dict[str, Any]) -> None:
    data = rig.desk.call(tool, arguments)
    assert not data["success"] and len(reason(data)) < 700
    assert rig.body.began == [] and rig.body.x == 0.0
    assert "refuse" in rig.events()


@given(Rules(patience=5.0, calls=1000))
def test_the_operator_is_asked_and_may_be_silent(rig: Rig) -> None:
    asked: list[str | None] = []
    rig.desk.on_ask = asked.append
    call = ask(rig, "go", x=1.0)
    assert asked[0] is not None and "go" in asked[0] and rig.body.began == []
    rig.now += 5.1
    data = ended(rig, call)
    assert not data["success"] and "no answer in time" in reason(data) and rig.body.began == [] and asked[-1] is None


@given(Rules(calls=1000))
def test_leave_is_for_one_call_and_cannot_be_used_again(rig: Rig) -> None:
    call = ask(rig, "go", x=1.0)
    rig.desk.decide(call.number, True)
    assert ended(rig, call)["success"]
    rig.desk.decide(call.number, True)  # replayed
    rig.desk.turn()
    assert len(rig.body.began) == 1
    again = ask(rig, "go", x=2.0)
    rig.desk.decide(call.number, True)
    rig.desk.turn()
    assert len(rig.body.began) == 1 and again.number in rig.desk.asked
    rig.desk.decide(again.number, False)
    assert not ended(rig, again)["success"] and len(rig.body.began) == 1
    assert rig.events().count("late decision") == 2


@given(Rules(default="free", tools={"go": ToolRule("free", count=2)}, calls=1000))
def test_a_tool_runs_as_often_as_its_rule_says(rig: Rig) -> None:
    done = [rig.desk.call("go", {"x": 1.0})["success"] for _ in range(4)]
    assert done == [True, True, False, False]


@given(Rules(default="never", calls=1000))
def test_a_tool_that_never_runs_does_not(rig: Rig) -> None:
    assert not rig.desk.call("go", {"x": 1.0})["success"] and rig.body.began == []
    assert rig.desk.call("read", {"resource": "state"})["success"] and rig.desk.call("stop", {})["success"]


@given(Rules(default="free", tools={"go": ToolRule("free", fields={"steps": [1, 5], "label": ["", "a"]})}, calls=1000))
def test_fields_are_as_narrow_as_the_rules_say(rig: Rig) -> None:
    assert rig.desk.call("go", {"x": 0.0, "steps": 5, "label": "a"})["success"]
    assert not rig.desk.call("go", {"x": 0.0, "steps": 6})["success"]
    assert not rig.desk.call("go", {"x": 0.0, "label": "b"})["success"]
    assert len(rig.body.began) == 1


@given(Rules(default="free", region=Region((-0.5, 1.0), (-1.0, 1.0)), calls=1000))
def test_nobody_is_sent_out_of_the_region_nor_walks_out_of_it(rig: Rig) -> None:
    for goal in ({"x": 1.1}, {"x": 0.0, "y": -1.1}, {"x": 1.0, "y": 0.0, "frame": "base_link"}):
        rig.body.x = 0.2
        assert not rig.desk.call("go", goal)["success"]
    assert rig.body.began == []
    rig.body.x = 0.0
    data = rig.desk.call("go", {"x": 0.9, "steps": 50})  # says one thing and does another
    assert data["stage"] == "rules" and "region" in reason(data)
    assert max(rig.body.track) < 1.0 and "excess" in rig.events()


@given(Rules(default="free", speed=0.4, calls=1000), Rules(default="free", force=5.0, calls=1000))
def test_a_motion_that_is_too_fast_or_presses_too_hard_is_cancelled(rig: Rig) -> None:
    call = ask(rig, "go", x=0.0, steps=50)
    for _ in range(8):
        rig.desk.turn()
    rig.body.force = 8.0
    data = ended(rig, call)
    assert data["stage"] == "rules" and not data["success"]


def test_more_calls_than_the_rules_allow_are_refused(tmp_path: Path) -> None:
    rig = Rig(tmp_path, Rules(default="free", calls=20))
    answers = [rig.desk.call("go", {"x": 0.0, "steps": 1}) for _ in range(500)]
    assert sum(a["success"] for a in answers) == 20 == len(rig.body.began)
    assert rig.desk.call("stop", {})["success"]
    rig.now += 1.1
    assert rig.desk.call("go", {"x": 0.0, "steps": 1})["success"]


def test_one_client_at_a_time_moves_the_robot(rig: Rig) -> None:
    first = ask(rig, "go", "a", x=1.0, steps=20)
    assert "lease" in reason(ended(rig, ask(rig, "go", "b", x=1.0)))
    assert "running" in reason(ended(rig, ask(rig, "go", "a", x=1.0)))
    assert ended(rig, first)["success"] and len(rig.body.began) == 1
    assert "lease" in reason(ended(rig, ask(rig, "go", "b", x=1.0)))
    rig.now += 61.0
    assert ended(rig, ask(rig, "go", "b", x=1.0))["success"]


def test_stop_works_for_everybody_and_always(rig: Rig) -> None:
    first = ask(rig, "go", "a", x=1.0, steps=100)
    assert ended(rig, ask(rig, "stop", "b"))["success"]
    assert ended(rig, first)["stage"] == "cancelled" and rig.body.x < 0.5 and rig.body.stopped == 0
    assert ended(rig, ask(rig, "stop", "b", motors=True))["success"] and rig.body.stopped == 1


@given(Rules(calls=1000))
def test_a_stop_settles_what_waits_for_the_operator(rig: Rig) -> None:
    call = ask(rig, "go", x=1.0)
    ask(rig, "stop")
    rig.desk.decide(call.number, True)
    assert not ended(rig, call)["success"] and rig.body.began == []


@pytest.mark.parametrize("turns", [0, 1, 2, 3, 5])
def test_a_call_can_be_taken_back_at_any_stage(rig: Rig, turns: int) -> None:
    call = Call("a", "go", {"x": 1.0, "steps": 100})
    rig.desk.submit(call)
    for _ in range(turns):
        rig.desk.turn()
    rig.desk.cancel(call)
    rig.desk.cancel(call)
    assert not ended(rig, call)["success"] and not rig.body.busy and rig.body.x <= 0.1 * turns + 1e-9


@given(Rules(calls=1000))
def test_a_call_that_waits_can_be_taken_back(rig: Rig) -> None:
    call = ask(rig, "go", x=1.0)
    rig.desk.cancel(call)
    assert not ended(rig, call)["success"] and rig.body.began == []


@given(Rules(calls=1000))
def test_what_cannot_begin_after_the_operators_yes_is_refused(rig: Rig) -> None:
    def begin(skill: str, fields: dict[str, Any]) -> None:
        raise ZeroDivisionError("a skill of somebody's")

    rig.body.begin = begin  # pyright: ignore[reportAttributeAccessIssue]
    call = ask(rig, "go", x=1.0)
    rig.desk.decide(call.number, True)
    data = ended(rig, call)
    assert not data["success"] and "ZeroDivisionError" in reason(data)


def test_nothing_goes_on_for_a_client_that_is_gone(rig: Rig) -> None:
    call = ask(rig, "go", "a", x=1.0, steps=100)
    rig.desk.leave("a")
    assert ended(rig, call)["stage"] == "cancelled" and not rig.body.busy
    assert ended(rig, ask(rig, "go", "b", x=1.0))["success"]
    other = ask(rig, "go", "b", x=1.0, steps=100)
    rig.desk.leave_all()
    assert other.answered.done() and not rig.body.busy


def test_what_cannot_be_logged_does_not_go_on(rig: Rig) -> None:
    """A full disk ended the process with an error, and a robot on a domain went on."""
    call, log = ask(rig, "go", x=1.0, steps=100), rig.log._out
    kept, full = os.dup(log), os.open("/dev/full", os.O_WRONLY)
    os.dup2(full, log)
    assert ended(rig, ask(rig, "read", resource="state"))["success"]
    data = ended(rig, call)
    assert data["stage"] == "rules" and "No space left on device" in reason(data) and len(rig.body.track) < 10
    refused = ended(rig, ask(rig, "go", x=1.0))
    assert refused["stage"] == "refused" and str(rig.file) in reason(refused)
    assert rig.desk.call("stop", {"motors": True})["success"] and rig.body.stopped == 1
    os.dup2(kept, log)
    assert ended(rig, ask(rig, "go", x=1.0))["success"]
    assert rig.events()[-3:] == ["call", "begin skill", "answer"]


def test_of_an_entry_that_does_not_fit_nothing_is_left(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    write = os.write
    monkeypatch.setattr("os.write", lambda file, data: write(file, data[:20]))
    assert "No space left on device" in reason(rig.desk.call("go", {"x": 1.0}))
    monkeypatch.undo()
    assert rig.events() == ["begin"] and rig.desk.call("go", {"x": 1.0})["success"]
    assert rig.events() == ["begin", "call", "begin skill", "answer"]


def test_a_log_that_cannot_be_begun_is_said() -> None:
    with pytest.raises(OutputError, match="Cannot write /dev/full: No space left on device"):
        AuditLog(Path("/dev/full"))


def looking(run: str, **rest: Any) -> Rules:
    rule = ToolRule(cast(Any, run), **rest)
    return Rules(default="free", calls=1000, tools={"look": rule, "read": rule})


@given(
    looking("never"), looking("free", count=0), looking("free", fields={"camera": ["left_hand"], "resource": ["map"]})
)
def test_rules_of_looking_and_reading_hold(rig: Rig) -> None:
    """They were read, and then nobody asked them: pictures went out that the rules keep in."""
    for labels in ((), ("mug",)):
        assert rig.desk.call("look", {"camera": "head", "labels": list(labels)})["stage"] == "refused"
    assert rig.desk.call("read", {"resource": "state"})["stage"] == "refused"
    assert rig.body.began == []


@given(looking("ask", count=1))
def test_the_operator_is_asked_before_a_picture_goes_out(rig: Rig) -> None:
    for tool, arguments in (("look", {}), ("read", {"resource": "state"})):
        call = ask(rig, tool, **arguments)
        assert not call.answered.done()
        rig.desk.decide(call.number, True)
        assert ended(rig, call)["success"] and not rig.desk.call(tool, arguments)["success"]


@given(Rules(default="never", calls=1000))
def test_without_a_rule_of_their_own_looking_and_reading_are_free(rig: Rig) -> None:
    assert rig.desk.call("look", {"labels": ["mug"]})["success"]
    assert rig.desk.call("read", {"resource": "state"})["success"]
