"""What trainers write becomes one description: the same policy in five formats, and what is refused."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from tests.capabilities.legs import trainers
from tests.capabilities.legs.onnx_writer import Graph
from tests.capabilities.legs.trainers import EVERYTHING, ISAAC_LEGS, LEG_JOINTS, Wanted

from golem import registry
from golem.capabilities.legs.base import STANDING
from golem.capabilities.legs.passports.read import read_passport
from golem.capabilities.legs.policy import Policy, PolicyConfig
from golem.errors import ConfigError
from golem.stack import parse_stack
from golem.types import NUM_JOINTS, BaseEstimate, Imu, LowState

WRITERS: dict[str, Callable[[Path], Path]] = {
    "mjlab": trainers.mjlab,
    "mjlab, 27 joints": lambda folder: trainers.mjlab(folder, EVERYTHING),
    "deploy": trainers.unitree_deploy,
    "deploy, 27 joints": lambda folder: trainers.unitree_deploy(folder, EVERYTHING),
    "deploy, frames": lambda folder: trainers.unitree_deploy(folder, Wanted(ISAAC_LEGS, 4, frames=True)),
    "isaac": trainers.isaac_lab,
    "gym": trainers.unitree_gym,
    "ours": trainers.golem,
}


def small(path: Path, shown: int = 47, moved: int = 12, **notes: str) -> Path:
    """Write a network that returns zeros."""
    g = Graph()
    g.weight("w", np.zeros((shown, moved)))
    g.add("MatMul", ["obs", "w"], "actions")
    return g.save(path, {"obs": (1, shown)}, {"actions": (1, moved)}, notes)


def commands(legs: Policy) -> np.ndarray:
    """Return the targets of ten ticks of a robot that is disturbed."""
    rng, out = np.random.default_rng(0), []
    for _ in range(10):
        q, dq = 0.1 * rng.normal(size=(2, NUM_JOINTS))
        imu = Imu(np.array([1.0, 0, 0, 0]), 0.1 * rng.normal(size=3), np.array([0, 0, 9.81]))
        state = LowState(0.0, q, dq, np.zeros(NUM_JOINTS), imu)
        out.append(legs.step(state, BaseEstimate(0.0, np.eye(4)), STANDING, 0.02).q)
    return np.array(out)


@pytest.mark.parametrize("name", WRITERS)
def test_one_policy_acts_alike_in_every_format(tmp_path: Path, name: str) -> None:
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
    expected = commands(Policy(PolicyConfig(str(trainers.golem(tmp_path / "a")))))
    legs = registry.create("lower_body", str(WRITERS[name](tmp_path / "b")), {})
    # mjlab's numbers have three digits.
    np.testing.assert_allclose(commands(legs), expected, atol=2e-3 if "mjlab" in name else 1e-6)


def test_a_stack_uses_a_policy_file(tmp_path: Path) -> None:
    path = small(tmp_path / "net.onnx")
    for text in (f"lower_body: {path}", f"lower_body: {{use: {path}}}"):
        choice = parse_stack(text, "s.yaml").choice("lower_body")
        assert (choice.use, choice.options) == ("policy", {"file": str(path)})


def test_what_lacks_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="lacks the metadata joint_names, joint_stiffness"):
        read_passport(small(tmp_path / "bare.onnx"))
    with pytest.raises(ConfigError, match="There is no policy"):
        read_passport(tmp_path / "none.onnx")
    with pytest.raises(ConfigError, match="joint of the H1-2 'left_hip_yaw'"):
        read_passport(mjlab(tmp_path, joint_names=",".join(n.removesuffix("_joint") for n in LEG_JOINTS)))
    with pytest.raises(ConfigError, match="repeats a recorded motion"):
        read_passport(mjlab(tmp_path, observation_names="motion_anchor_pos_b,joint_pos"))
    with pytest.raises(ConfigError, match="term of a trainer 'base_ang_vell'; .*base_ang_vel"):
        read_passport(mjlab(tmp_path, observation_names="base_ang_vell"))
    with pytest.raises(ConfigError, match="'fast' where a number belongs"):
        read_passport(mjlab(tmp_path, action_scale="fast"))


def mjlab(folder: Path, **changes: str) -> Path:
    row = ",".join(["1.000"] * 12)
    keys = ("joint_stiffness", "joint_damping", "default_joint_pos", "action_scale")
    notes = {"joint_names": ",".join(LEG_JOINTS), "observation_names": "base_ang_vel", **dict.fromkeys(keys, row)}
    return small(folder / "net.onnx", 47, 12, **notes | changes)


@pytest.mark.parametrize("writer", [trainers.isaac_lab, trainers.unitree_deploy])
def test_targets_about_another_posture_than_joints_are_seen_by_are_refused(
    tmp_path: Path, writer: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(trainers, "write_network", lambda *_: None)  # what is read stands in the other file

    def edit(data: dict[str, Any]) -> None:
        actions = data["actions"]
        action = actions[0] if isinstance(actions, list) else actions["JointPositionAction"]
        action["offset"] = 0.0  # the joints are told from 0, and seen from default_joint_pos

    with pytest.raises(ConfigError, match="offset is not the default_joint_pos, which the joints are seen relative"):
        read_passport(writer(tmp_path, edit=edit))


def test_isaac_targets_about_another_posture_do_where_joints_are_seen_as_they_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(trainers, "write_network", lambda *_: None)

    def edit(data: dict[str, Any]) -> None:
        data["actions"][0]["offset"] = 0.0
        for term in data["observations"]["policy"]:
            term["full_path"] = term["full_path"].replace("joint_pos_rel", "joint_pos")

    assert not any(read_passport(trainers.isaac_lab(tmp_path, edit=edit)).description.posture)


def test_the_metadata_of_later_versions_are_read(tmp_path: Path) -> None:
    path = mjlab(
        tmp_path,
        observation_names="base_ang_vel,command,height_command",
        observation_terms_scale="0.250,[2.0, 2.0, 0.25],2.000",
        observation_terms_clip="-1.0;1.0,-inf;inf,-inf;inf",
        observation_terms_history_length="5.000,0.000,0.000",
    )
    rate, twist, height = read_passport(path).description.observation
    assert (rate.scale, rate.clip, rate.history) == ((0.25,) * 3, (-1.0, 1.0), 5)
    assert (twist.term, twist.scale, twist.clip, twist.history) == ("twist", (2.0, 2.0, 0.25), None, 1)
    assert (height.term, height.scale) == ("one", 1.96)


def places(data: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield where in `data` something stands."""
    items = data.items() if isinstance(data, dict) else enumerate(data[:2]) if isinstance(data, list) else ()
    for key, value in items:
        yield (*path, key)
        yield from places(value, (*path, key))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["deploy", "isaac", "gym"])
def test_a_file_that_is_wrong_anywhere_is_refused_in_a_sentence_or_read(tmp_path: Path, name: str) -> None:
    path = WRITERS[name](tmp_path)
    text = path.read_text(encoding="utf-8").replace("!!python/object/apply:builtins.slice [null, null, null]", "null")
    refused = 0
    for place in places(yaml.safe_load(text)):
        for odd in (None, 0, -1.5, "word", [], {"a": None}):
            data = yaml.safe_load(text)
            inner = data
            for key in place[:-1]:
                inner = inner[key]
            inner[place[-1]] = odd
            path.write_text(yaml.safe_dump(data, sort_keys=False), encoding="utf-8")
            try:
                read_passport(path)
            except ConfigError as error:
                refused += 1
                assert str(path) in str(error)
    assert refused > 50


def test_the_line_to_change_is_named(tmp_path: Path) -> None:
    data: dict[str, Any] = {"network": "net.onnx", "observation": [{"term": "gravity"}], "posture": [0] * 6}
    path = tmp_path / "p.yaml"
    path.write_text(yaml.safe_dump(data | {"kp": 100, "kd": 2}, sort_keys=False), encoding="utf-8")
    passport = read_passport(path)
    assert passport.where("kd") == "p.yaml, line 12 (kd)"
    assert passport.where("0") == "p.yaml, line 3 (gravity)"
