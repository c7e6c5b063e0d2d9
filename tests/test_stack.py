"""A stack file is read whole or refused with one sentence that says where and why."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from golem import registry
from golem.errors import ConfigError
from golem.interfaces.unitree_api import LOCO_APIS
from golem.stack import Choice, Stack, load_stack, parse_stack, shipped


def test_an_empty_file_is_the_default_stack() -> None:
    assert parse_stack("", "x.yaml") == Stack()
    assert parse_stack("# nothing\n", "x.yaml") == Stack()


def test_the_shipped_stacks_name_implementations_that_exist() -> None:
    assert "tether" in shipped()
    for name in shipped():
        stack = load_stack(name)
        for slot in registry.slots():
            assert stack.choice(slot).use in registry.names(slot)


def test_every_slot_of_the_registry_is_a_key() -> None:
    assert set(registry.slots()) < {f.name for f in fields(Stack)}


def test_names_options_and_words() -> None:
    text = """
    upper_body: pink_ik
    grasp_method: {use: visual_servo, servo: {tolerance: 0.002}, list: [1, a, null, true]}
    profile: field
    """
    stack = parse_stack(text, "x.yaml")
    assert stack.upper_body == Choice("pink_ik")
    options = {"servo": {"tolerance": 0.002}, "list": [1, "a", None, True]}
    assert stack.grasp_method == Choice("visual_servo", options)
    assert (stack.profile, stack.limits) == ("field", "urdf")


def test_the_profile_may_be_replaced() -> None:
    assert load_stack("tether", profile="ideal") == replace(load_stack("tether"), profile="ideal")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("upper_body: {use: diff_ik\nhand: x", ["x.yaml, line 2", "not valid YAML"]),
        ("a:\n\t- b", ["x.yaml, line 2", "not valid YAML"]),
        ("profile: field\nprofile: ideal", ["x.yaml, line 2", "'profile' occurs twice"]),
        ("hand:\n  use: magpie\n  use: magpie", ["x.yaml, line 3", "'use' occurs twice"]),
        ("hand: &a {use: magpie}\nservo: *a", ["x.yaml, line 2", "aliases"]),
        ("hand: &a {use: magpie, x: *a}", ["x.yaml, line 1", "aliases"]),
        ("- a\n- b", ["x.yaml", "mapping"]),
        ("0", ["x.yaml", "mapping"]),
        ("[]", ["x.yaml", "mapping"]),
        ("just words", ["x.yaml", "mapping"]),
        ("uper_body: diff_ik", ["key in x.yaml", "'uper_body'", "Did you mean 'upper_body'?"]),
        ("1: diff_ik", ["key in x.yaml", "'1'", "upper_body"]),
        ("profile: 3", ["x.yaml", "'profile' is one word", "profile: bench"]),
        ("profile: {use: field}", ["x.yaml", "'profile' is one word"]),
        ("hand: 3", ["x.yaml", "'hand' wants", "magpie"]),
        ("hand:", ["x.yaml", "'hand' wants", "magpie"]),
        ("hand: {settle: 0.1}", ["x.yaml", "'hand' wants", "magpie"]),
        ("hand: {use: 3}", ["x.yaml", "'hand' wants", "magpie"]),
        ("hand: {use: magpie, since: 2020-01-01}", ["x.yaml: hand.since", "not a date"]),
        ("hand: {use: magpie, a: {b: [2020-01-01]}}", ["x.yaml: hand.a.b", "not a date"]),
        ("hand: {use: magpie, a: {1: 2}}", ["x.yaml: hand.a", "name is a word, not 1"]),
        ("hand: {use: magpie, 1: 2}", ["x.yaml: hand", "name is a word, not 1"]),
        ("hand: {use: magpie, a: !!binary aGk=}", ["x.yaml: hand.a", "not a bytes"]),
        ("hand: !!python/object:os.system {}", ["x.yaml, line 1", "not valid YAML"]),
    ],
)
def test_a_wrong_file_is_answered_in_one_sentence(text: str, words: list[str]) -> None:
    with pytest.raises(ConfigError) as caught:
        parse_stack(text, "x.yaml")
    assert all(word in str(caught.value) for word in words), str(caught.value)


@given(st.text(max_size=60))
def test_any_text_is_a_stack_or_a_config_error(text: str) -> None:
    try:
        stack = parse_stack(text, "x.yaml")
    except ConfigError:
        return
    assert len(stack.digest()) == 12


@pytest.mark.parametrize(
    "text",
    ["{[a, b]: 1}", "? {a: 1}\n: 2", "profile: 2024-99-99", "profile: !!int foo", "[" * 2000],
    ids=["list as key", "mapping as key", "no such date", "no integer", "nested without end"],
)
def test_what_the_yaml_library_stumbles_over_is_refused(text: str) -> None:
    with pytest.raises(ConfigError, match=r"^x\.yaml.*not valid YAML \("):
        parse_stack(text, "x.yaml")


def test_a_number_that_is_none_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"x: hand\.settle: .*\.nan"):
        parse_stack("hand: {use: magpie, settle: .nan}", "x")


def test_a_file_that_is_not_there_is_answered_with_the_shipped_ones(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"No stack file '.*none\.yaml'.*tether"):
        load_stack(tmp_path / "none.yaml")


def test_a_file_that_is_not_text_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "x.yaml"
    path.write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(ConfigError, match="cannot be read as text"):
        load_stack(path)


def test_a_file_is_read(tmp_path: Path) -> None:
    path = tmp_path / "x.yaml"
    path.write_text("profile: ideal\n")
    assert load_stack(path) == Stack(profile="ideal")


CHANGED: dict[str, Any] = {
    slot: Choice(Stack().choice(slot).use, {"option": 1}) for slot in registry.slots()
} | {"fallback": Choice("hold"), "onboard": Choice("hold"), "profile": "field", "limits": "paper"}


@pytest.mark.parametrize("key", [f.name for f in fields(Stack)])
def test_the_digest_changes_with_everything(key: str) -> None:
    assert replace(Stack(), **{key: CHANGED[key]}).digest() != Stack().digest()


def test_a_robot_on_its_feet_falls_back_on_legs_that_balance() -> None:
    assert Stack().legs_in_reserve == Choice("hold")
    assert parse_stack("robot: {use: mujoco, support: ground}", "x").legs_in_reserve == Choice("almi")
    chosen = parse_stack("fallback: {use: hold, stance: crouch}", "x")
    assert chosen.legs_in_reserve == Choice("hold", {"stance": "crouch"})


def test_a_robot_on_its_feet_is_not_taken_to_hang() -> None:
    assert Stack().choice("estimator") == Choice("tether")
    ground = "robot: {use: mujoco, support: ground}"
    assert parse_stack(ground, "x").choice("estimator") == Choice("random_walk_kf")
    with pytest.raises(ConfigError, match="'tether' takes the base to stay.*random_walk_kf, invariant_ekf"):
        parse_stack(f"{ground}\nestimator: tether", "x")


def test_the_digest_does_not_depend_on_the_order_of_options() -> None:
    one = parse_stack("hand: {use: magpie, a: 1, b: 2}", "x")
    two = parse_stack("hand: {b: 2, use: magpie, a: 1}", "y")
    assert one.digest() == two.digest()


def test_another_choice_comes_without_the_options_of_the_old_one() -> None:
    stack = Stack(hand=Choice("magpie", {"settle": 1.0}), profile="field")
    changed = stack.with_choice("hand", "mine.py:Hand")
    assert changed.hand == Choice("mine.py:Hand")
    assert stack.with_choice("hand", "{use: magpie, settle: 2.0}").hand == Choice("magpie", {"settle": 2.0})
    with pytest.raises(ConfigError, match="use: NAME"):
        stack.with_choice("hand", "{settle: 2.0}")
    assert changed.profile == "field"


def test_the_twin_runs_legs_on_board_where_something_speaks_to_them() -> None:
    assert parse_stack("onboard: hold", "x").legs_on_board is None
    assert parse_stack("lower_body: vendor", "x").legs_on_board == Choice("almi")
    assert parse_stack("fallback: vendor", "x").legs_on_board == Choice("almi")
    both = "lower_body: {use: handover, walk: {use: vendor}, stand: {use: almi}}"
    assert parse_stack(both, "x").legs_on_board == Choice("almi")
    whole_name = "lower_body: golem.capabilities.legs.vendor:Vendor"
    assert parse_stack(whole_name, "x").legs_on_board == Choice("almi")
    assert parse_stack("lower_body: not_here.py:Mine", "x").legs_on_board is None
    chosen = parse_stack("lower_body: vendor\nonboard: {use: policy, file: x.yaml}", "x")
    assert chosen.legs_on_board == Choice("policy", {"file": "x.yaml"})


def test_the_twin_answers_the_calls_that_the_stack_makes() -> None:
    assert parse_stack("lower_body: almi", "x").loco_api == LOCO_APIS["h1"]
    both = "lower_body: {use: handover, walk: {use: vendor, options: {robot: h2}}, stand: {use: almi}}"
    assert parse_stack(both, "x").loco_api == LOCO_APIS["h2"]
    for wrong in ("h3", "[1]"):
        with pytest.raises(ConfigError, match="loco service .*h1"):
            _ = parse_stack(f"lower_body: {{use: vendor, robot: {wrong}}}", "x").loco_api
