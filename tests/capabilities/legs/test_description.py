from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from golem.capabilities.legs.description import load_description, shipped
from golem.capabilities.legs.hold import STANCES
from golem.errors import ConfigError
from golem.robots.model.table import load_limits

TEXT = """
network: net.onnx
posture: [0, -0.4, 0, 0.8, -0.4, 0]
kp: 100
kd: [1, 2, 3, 4, 5, 6]
observation:
  - {term: base_rate, scale: 0.25}
  - {term: joint_position, of: [legs]}
"""


def write(folder: Path, text: str) -> Path:
    path = folder / "policy.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_description_is_read_with_its_defaults(tmp_path: Path) -> None:
    description, network = load_description(write(tmp_path, TEXT))
    assert network == tmp_path / "net.onnx"
    assert (description.rate, description.action.scale, description.gait.start) == (50.0, 0.25, "recovery")
    np.testing.assert_allclose(description.q0()[:12], np.tile(STANCES["crouch"], 2))
    np.testing.assert_array_equal(description.q0()[12:], 0.0)
    assert description.layout().size == 15
    _, elsewhere = load_description(write(tmp_path, TEXT), tmp_path / "b" / "other.pt")
    assert elsewhere == tmp_path / "b" / "other.pt"


@pytest.mark.parametrize("name", shipped())
def test_shipped_descriptions_stand_inside_the_limits(name: str) -> None:
    description, _ = load_description(name)
    limits = load_limits()
    q = description.q0()
    assert (q >= limits.lower).all() and (q <= limits.upper).all()
    assert description.layout().size > 12
    assert (description.gains()[0] > 0).all()


def test_the_peers_have_the_layout_their_networks_ask_for() -> None:
    assert load_description("almi_open")[0].layout().size == 65
    assert load_description("unitree_rl_gym")[0].layout().size == 47


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("network: net.onnx", "", ["'network' has no default"]),
        ("kp: 100", "kp: 100\nkq: 1", ["'kq'", "Did you mean 'k"]),
        ("term: base_rate", "trem: base_rate", ["'trem'", "Did you mean 'term'?"]),
        ("scale: 0.25", "scale: fast", ["scale of base_rate", "'fast'"]),
        ("of: [legs]", "of: legs", ["'of'", "list"]),
        ("[0, -0.4, 0, 0.8, -0.4, 0]", "[0, -0.4]", ["posture", "6, 12 or 27", "not of 2"]),
        ("[0, -0.4, 0, 0.8, -0.4, 0]", "[0, -0.4, 0, 0.8, -0.4, .inf]", ["posture", "finite"]),
        ("kp: 100", "kp: .nan", ["kp", ".nan"]),
        ("kp: 100", "kp: -1", ["kp", "negative"]),
        ("kp: 100", "kp: [1, 2]", ["kp", "6 or 12", "not a list of 2"]),
        ("kp: 100", "kp: 100\nrate: 0", ["rate", "at least 1", "not 0"]),
        ("kp: 100", "kp: 100\nlatency: -0.1", ["latency", "not negative"]),
        ("kp: 100", "kp: 100\ngait: {stance: 0.4}", ["gait.stance", "between 0.5 and 1"]),
        ("kp: 100", "kp: 100\ngait: {start: sometimes}", ["'sometimes'", "recovery"]),
        ("kp: 100", "kp: 100\nenvelope: {vx: [0.1, 0.5]}", ["envelope.vx", "around zero"]),
        ("kp: 100", "kp: 100\nenvelope: {height: [0.8, 0.9, 1.0]}", ["takes a height today", "envelope.height"]),
        ("kp: 100", "kp: 100\naction: {clip: 0}", ["action.clip", "positive"]),
        ("kp: 100", "kp: 100\naction: {scale: []}", ["action.scale", "not a list of 0"]),
        ("kp: 100", "kp: 100\nkp: 100", ["'kp' occurs twice", "line"]),
    ],
)
def test_a_wrong_description_is_answered_in_one_sentence(tmp_path: Path, old: str, new: str, words: list[str]) -> None:
    assert old in TEXT
    with pytest.raises(ConfigError) as caught:
        load_description(write(tmp_path, TEXT.replace(old, new)))
    assert all(word in str(caught.value) for word in words), str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_observation_that_is_no_list_is_refused(tmp_path: Path) -> None:
    text = TEXT[: TEXT.index("observation:")] + "observation: {term: base_rate}"
    with pytest.raises(ConfigError, match="'observation' is a list"):
        load_description(write(tmp_path, text))


@pytest.mark.parametrize("text", ["", "just words", "- a"])
def test_a_file_that_is_no_mapping_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(ConfigError, match="mapping such as 'network: policy.onnx'"):
        load_description(write(tmp_path, text))


def test_a_file_that_is_not_there_is_answered_with_the_shipped_ones(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"none\.yaml.*No such file.*almi_open"):
        load_description(tmp_path / "none.yaml")
    path = tmp_path / "x.yaml"
    path.write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(ConfigError, match="cannot be read"):
        load_description(path)
