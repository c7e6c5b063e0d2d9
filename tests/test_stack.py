"""A stack file is read whole or refused with one sentence that says where and why."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from golem import registry
from golem.capabilities.legs.locomotion import FootSeparationConfig, LocomotionConfig
from golem.errors import ConfigError
from golem.interfaces.unitree_api import LOCO_APIS
from golem.runtime.onboard_nodes import stack_loco_api
from golem.slots import KEYS
from golem.stack import Choice, Stack, load_stack, parse_stack, shipped

GROUND = "robot: {use: mujoco, support: ground}"


def test_an_empty_file_is_the_default_stack() -> None:
    assert parse_stack("", "x.yaml") == Stack()
    assert parse_stack("# nothing\n", "x.yaml") == Stack()


def test_the_shipped_stacks_name_implementations_that_exist() -> None:
    assert "tether" in shipped()
    for name in shipped():
        stack = load_stack(name)
        for key, row in KEYS.items():
            assert stack.choice(key).use in registry.names(row.slot)


def test_names_options_and_words() -> None:
    text = """
    upper_body: pink_ik
    grasp_method: {use: visual_servo, servo: {tolerance: 0.002}, list: [1, a, null, true]}
    profile: field
    """
    stack = parse_stack(text, "x.yaml")
    assert stack.choice("upper_body") == Choice("pink_ik")
    options = {"servo": {"tolerance": 0.002}, "list": [1, "a", None, True]}
    assert stack.choice("grasp_method") == Choice("visual_servo", options)
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


def test_a_name_without_its_ending_is_answered_with_the_file(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text("profile: ideal")
    with pytest.raises(ConfigError, match=r"No stack file .* Did you mean '.*mine\.yaml'\?"):
        load_stack(tmp_path / "mine")


def test_a_file_that_is_not_text_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "x.yaml"
    path.write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(ConfigError, match="cannot be read as text"):
        load_stack(path)


def test_a_file_is_read(tmp_path: Path) -> None:
    path = tmp_path / "x.yaml"
    path.write_text("profile: ideal\n")
    assert load_stack(path) == Stack(profile="ideal")


CHANGED = [Stack().with_options(key, option=1) for key in KEYS]
CHANGED += [Stack(parts={"locomotion": {"blend": False}}), Stack(profile="field"), Stack(limits="paper")]
CHANGED += [Stack(skills={"pick": Choice("pick", {"force": 8.0})})]


def test_the_digest_changes_with_everything() -> None:
    assert len({stack.digest() for stack in (Stack(), *CHANGED)}) == 1 + len(CHANGED)
    assert len(CHANGED) == len(KEYS) + len(fields(Stack)) - 1


def test_a_default_that_is_named_is_no_other_stack() -> None:
    assert parse_stack("servo: pd_gravity\nonboard: almi", "x") == Stack()


def test_a_robot_on_its_feet_falls_back_on_legs_that_balance() -> None:
    assert Stack().choice("fallback") == Choice("hold")
    assert parse_stack(GROUND, "x").choice("fallback") == Choice("almi")
    chosen = parse_stack("fallback: {use: hold, stance: crouch}", "x")
    assert chosen.choice("fallback") == Choice("hold", {"stance": "crouch"})


@pytest.mark.parametrize(
    "legs",
    [
        "",
        "lower_body: {use: hold, stance: crouch}",
        "lower_body: {use: golem.capabilities.legs.hold:JointHold}",
        "lower_body: {use: handover, walk: {use: almi}, stand: {use: hold}}",
        "lower_body: almi\nfallback: hold",
    ],
)
def test_a_robot_on_its_feet_has_legs_that_carry_it(legs: str) -> None:
    with pytest.raises(ConfigError, match=r"stands on its feet: choose almi, .*standing: true"):
        parse_stack(f"{GROUND}\n{legs}", "x").check()
    parse_stack(legs, "x").check() if "handover" not in legs and "almi" not in legs else None
    for sound in ("lower_body: almi", "lower_body: {use: hold, standing: true}"):
        parse_stack(f"{GROUND}\n{sound}", "x").check()


def test_a_robot_on_its_feet_is_not_taken_to_hang() -> None:
    assert Stack().choice("estimator") == Choice("tether")
    assert parse_stack(GROUND, "x").choice("estimator") == Choice("random_walk_kf")
    with pytest.raises(ConfigError, match="estimator 'tether' .*'hoist', .* stands .*random_walk_kf, invar"):
        parse_stack(f"{GROUND}\nestimator: tether", "x").check()
    parse_stack(f"{GROUND}\nlower_body: almi", "x").check()
    Stack().check()


def test_a_module_may_require_a_robot_on_its_feet(tmp_path: Path) -> None:
    mine = tmp_path / "mine.py"
    mine.write_text("class Legs:\n    requires = ('ground',)\n")
    with pytest.raises(ConfigError, match="lower_body .*mine.py:Legs' .*'ground', and this one hangs"):
        Stack({"lower_body": Choice(f"{mine}:Legs")}).check()


def test_whether_a_robot_stands_is_what_its_class_says(tmp_path: Path) -> None:
    mine = tmp_path / "mine.py"
    mine.write_text(
        "class Silent: ...\n"
        "class Tall:\n"
        "    @classmethod\n"
        "    def on_feet(cls, options): return not options.get('seated', False)\n"
    )
    assert not Stack({"robot": Choice(f"{mine}:Silent", {"support": "ground"})}).on_ground
    assert Stack({"robot": Choice(f"{mine}:Tall")}).on_ground
    assert not Stack({"robot": Choice(f"{mine}:Tall", {"seated": True})}).on_ground


def test_the_base_layer_of_the_legs_has_options() -> None:
    text = "locomotion: {trim: off, foot_separation: {minimum: 0.1}, blend: off, timeout: 0.3}"
    config = parse_stack(text, "x").part("locomotion")
    separation = FootSeparationConfig(minimum=0.1)
    assert config == LocomotionConfig(trim=None, foot_separation=separation, blend=None, timeout=0.3)
    assert Stack().part("locomotion") == LocomotionConfig()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("locomotion: {trimm: off}", ["option of locomotion 'trimm'", "Did you mean 'trim'?"]),
        ("locomotion: {trim: {gian: 1}}", ["locomotion 'trim'", "'gian'", "Did you mean 'gain'?"]),
        ("locomotion: {timeout: 0}", ["timeout", "a positive time", "not 0"]),
        ("locomotion: 3", ["x: 'locomotion' wants", "golem options locomotion"]),
        ("locomoton: {}", ["'locomoton'", "Did you mean 'locomotion'?"]),
    ],
)
def test_wrong_options_of_the_base_layer_are_refused_where_the_file_is_read(text: str, words: list[str]) -> None:
    with pytest.raises(ConfigError) as caught:
        parse_stack(text, "x")
    assert all(word in str(caught.value) for word in words), str(caught.value)


def test_the_digest_does_not_depend_on_the_order_of_options() -> None:
    one = parse_stack("hand: {use: magpie, a: 1, b: 2}", "x")
    two = parse_stack("hand: {b: 2, use: magpie, a: 1}", "y")
    assert one.digest() == two.digest()


def test_another_choice_comes_without_the_options_of_the_old_one() -> None:
    stack = Stack({"hand": Choice("magpie", {"settle": 1.0})}, profile="field")
    changed = stack.with_choice("hand", "mine.py:Hand")
    assert changed.choice("hand") == Choice("mine.py:Hand")
    again = stack.with_choice("hand", "{use: magpie, settle: 2.0}")
    assert again == stack.with_options("hand", settle=2.0)
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
    assert stack_loco_api(parse_stack("lower_body: almi", "x")) == LOCO_APIS["h1"]
    both = "lower_body: {use: handover, walk: {use: vendor, options: {robot: h2}}, stand: {use: almi}}"
    assert stack_loco_api(parse_stack(both, "x")) == LOCO_APIS["h2"]
    for wrong, said in (("h3", "loco service .*h1"), ("[1]", "'robot' is a word")):
        with pytest.raises(ConfigError, match=said):
            stack_loco_api(parse_stack(f"lower_body: {{use: vendor, robot: {wrong}}}", "x"))


def test_a_stack_file_lists_skills_and_their_options() -> None:
    stack = parse_stack("skills: {pick: {force: 8}, gentle: {use: pick, force: 4}, mine: my.py:Mine}", "x.yaml")
    assert stack.skills == {
        "pick": Choice("pick", {"force": 8}),
        "gentle": Choice("pick", {"force": 4}),
        "mine": Choice("my.py:Mine"),
    }
    assert list(stack.all_skills) == [*registry.names("skill"), "gentle", "mine"]
    assert Stack().all_skills["pick"] == Choice("pick")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("skills: pick", "'skills' wants '{NAME: {option: value, ...}, ...}'"),
        ("skills: {pik: {force: 8}}", "stand, take, walk. Did you mean 'pick'"),
        ("skills: {Mine: {use: my.py:Mine}}", "a skill's name is a word of a-z, 0-9 and _"),
        ("skills: {mine: {use: 3}}", "'skills: mine' wants '{use: NAME"),
        ("skills: {pick: }", "'skills: pick' wants"),
        ("skills: {pick: {force: .nan}}", "x.yaml: skills: pick.force: a number that is none"),
    ],
)
def test_wrong_skills_are_answered_with_what_would_work(text: str, words: str) -> None:
    with pytest.raises(ConfigError) as error:
        parse_stack(text, "x.yaml")
    assert words in str(error.value)


def test_skills_are_added_to_those_of_a_stack() -> None:
    stack = Stack(skills={"gentle": Choice("pick")}).with_choice("skills", "{pick: {force: 8}}")
    assert stack.skills == {"gentle": Choice("pick"), "pick": Choice("pick", {"force": 8})}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("grasp_method: {use: visual_servo, gian: 3}", "grasp_method: visual_servo 'gian'"),
        ("grasp_method: {use: reranked, proposer: {use: antipodal, options: {gian: 3}}}", "antipodal 'gian'"),
        ("skills: {pick: {forse: 3}}", "Unknown option of skill: pick 'forse'.*Did you mean 'force'"),
        ("planner: {use: 'golem.capabilities.memory.object_map:ObjectMap'}", "it lacks plan .*slot memory"),
    ],
)
def test_a_wrong_option_or_class_is_refused_before_anything_is_built(text: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        parse_stack(text, "mine").check()


def test_half_a_stack_file_is_refused_for_a_real_robot(tmp_path: Path) -> None:
    text = "upper_body: {use: diff_ik}\nestop: {use: serial, port: /dev/ttyACM0}\nlimits: urdf\n"
    path = tmp_path / "mine.yaml"
    for part in (text, "upper_body: {use: diff_ik}\n...\n"):
        path.write_text(part)
        load_stack(path, whole=True)
    for part in ("", text.splitlines()[0], text[: text.index("limits")]):
        path.write_text(part)
        load_stack(path)
        with pytest.raises(ConfigError, match="half a copy"):
            load_stack(path, whole=True)
    assert load_stack("tether", whole=True)
