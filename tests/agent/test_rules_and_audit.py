"""Files: the rules that are read, and the log that is written."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from tests.agent.fake_body import FakeBody

from golem.agent.audit import AuditLog, read_audit
from golem.agent.body import Body
from golem.agent.desk import Desk
from golem.agent.tool_rules import Region, Rules, ToolRule, load_rules
from golem.errors import ConfigError, GolemError


def read(folder: Path, text: str) -> Rules:
    file = folder / "rules.yaml"
    file.write_text(text)
    return load_rules(file)


@pytest.mark.parametrize("unknown", [{"x": math.nan}, {"velocity": np.array([math.nan, 0.0])}, {"force": math.nan}])
def test_a_motion_that_nobody_knows_is_no_allowed_one(unknown: dict[str, Any]) -> None:
    rules = Rules(region=Region((-1.0, 2.0), (-0.5, 0.5)), speed=0.4, force=30.0)
    known = {"x": 0.0, "y": 0.0, "velocity": np.array([0.3, 0.0]), "force": 10.0}
    assert not rules.excess(**known)
    assert "not known" in rules.excess(**(known | unknown))


def test_rules_are_read(tmp_path: Path) -> None:
    text = """
default: never
region: {x: [-1, 2], y: [-0.5, 0.5]}
speed: 0.4
tools:
  walk: {run: ask, count: 3, fields: {timeout: [0, 30], frame: [odom]}}
"""
    rules = read(tmp_path, text)
    assert rules.of("pick").run == "never" and rules.of("recall").run == "free"
    assert rules.of("walk") == ToolRule("ask", 3, {"timeout": [0, 30], "frame": ["odom"]})
    assert rules.region == Region((-1.0, 2.0), (-0.5, 0.5)) and rules.speed == 0.4


@pytest.mark.parametrize(
    "text",
    [
        "default: always",
        "- a",
        "tools: [walk]",
        "tools: {walk: free}",
        "tools: {walk: {run: free, speed: 1}}",
        "tools: {walk: {fields: {x: [1]}}}",
        "tools: {walk: {fields: {x: {a: 1}}}}",
        "tools: {walk: {count: -1}}",
        "region: {x: [1, 0], y: [0, 1]}",
        "region: {x: [0, 1]}",
        "speed: -1",
        "speed: .nan",
        "calls: 0",
        "x: &a [*a]",
        "default: ask\ndefault: free",
    ],
)
def test_rules_without_sense_are_refused_in_one_sentence(tmp_path: Path, text: str) -> None:
    with pytest.raises(ConfigError) as caught:
        read(tmp_path, text)
    assert "\n" not in str(caught.value)


def test_a_rule_for_a_tool_that_is_none_is_refused(tmp_path: Path) -> None:
    """What it means to forbid would run freely; a skill that this stack lacks may be in a file for several stacks."""
    log = AuditLog(tmp_path / "audit.jsonl")
    body = cast(Body, FakeBody())
    Desk(body, Rules(tools={"go": ToolRule("never"), "open": ToolRule("never"), "stop": ToolRule()}), log)
    with pytest.raises(ConfigError, match="'disasemble'.*Did you mean 'disassemble'"):
        Desk(body, Rules(default="free", tools={"disasemble": ToolRule("never")}), log)
    log.close()


def test_no_rules_at_all_ask_for_everything_that_moves() -> None:
    assert load_rules(None).of("walk").run == "ask"
    with pytest.raises(ConfigError):
        load_rules(Path("/nowhere/rules.yaml"))


def test_the_log_goes_on_and_what_is_none_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "a" / "audit.jsonl"
    for run in range(2):
        log = AuditLog(file, bag=f"bag_{run}")
        log.write("call", 1.5, arguments={"text": "\ud800", "long": "x" * 10_000})
        log.close()
    entries = list(read_audit(file))
    assert [e["event"] for e in entries] == ["begin", "call"] * 2 and entries[2]["bag"] == "bag_1"
    assert entries[1]["arguments"]["characters"] > 10_000 and "x" * 100 not in file.read_text()
    lines = file.read_text().splitlines()
    assert json.loads(lines[0])["bag"] == "bag_0"
    for wrong in ("{}", "[]", "x", "[1]"):
        file.write_text(f"{lines[0]}\n{wrong}\n")
        with pytest.raises(GolemError, match="after"):
            read_audit(file)


def test_half_a_line_that_a_lost_power_left_spoils_no_log(tmp_path: Path) -> None:
    file = tmp_path / "audit.jsonl"
    whole = '{"event": "begin", "utc": 1.0, "t": 0.0}\n'
    for before in ("", whole):
        file.write_text(before + '{"event": "call", "too')
        AuditLog(file, bag="bag").close()
        entries = read_audit(file)
        assert entries[-1]["event"] == "begin" and entries[-1]["torn"] == '{"event": "call", "too'
        assert len(entries) == 1 + bool(before)
