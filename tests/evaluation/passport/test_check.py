"""Policies as trainers write them: mistakes that are planted are named by their cause, sound ones pass."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from tests.capabilities.legs import trainers
from tests.capabilities.legs.onnx_writer import metadata
from tests.capabilities.legs.trainers import EVERYTHING, ISAAC_LEGS, LEG_JOINTS, Wanted

from golem.capabilities.legs.almi import NETWORKS
from golem.capabilities.legs.description import SHIPPED, shipped
from golem.capabilities.legs.passports.read import read_passport
from golem.capabilities.legs.policy import Policy, PolicyConfig
from golem.errors import ConfigError
from golem.evaluation.passport.policy_command import PolicyCheckConfig, check_passport, numbers, run_policy_check

Data = dict[str, Any]
Write = Callable[[Path], Path]


def edited(write: Callable[..., Path], edit: Callable[[Data], Any], *wanted: Wanted) -> Write:
    return lambda folder: write(folder, *wanted, edit=edit)


def of_golem(i: int, wanted: Wanted | None = None, **changes: Any) -> Write:
    return edited(trainers.golem, lambda d: d["observation"][i].update(changes), wanted or Wanted())


def of_deploy(term: str, wanted: Wanted | None = None, **changes: Any) -> Write:
    return edited(
        trainers.unitree_deploy, lambda d: d["observations"][term].update(changes), wanted or Wanted(ISAAC_LEGS)
    )


def _in_the_motors_order(data: Data) -> None:
    data.pop("joints")
    for term in data["observation"][3:6]:
        term["of"] = list(LEG_JOINTS)


HISTORY = Wanted(ISAAC_LEGS, history=5)
KNEES = [-1.0 if "knee" in name else 1.0 for name in LEG_JOINTS]
RIGHT_FIRST = (*LEG_JOINTS[6:], *LEG_JOINTS[:6])
TERM_SCALES = "0.25,-1.0,[2.0, 2.0, 0.25],1.0,0.05,1.0,1.0"

MISTAKES: dict[str, tuple[str, Write]] = {
    "names in the motors' order": ("order", lambda f: trainers.mjlab(f, joint_names=",".join(LEG_JOINTS))),
    "map in the motors' order": (
        "order",
        edited(trainers.unitree_deploy, lambda d: d.update(joint_ids_map=list(range(12)))),
    ),
    "Isaac's order unsaid": ("order", edited(trainers.golem, _in_the_motors_order, Wanted(ISAAC_LEGS))),
    "knees seen the wrong way": ("sign", of_golem(3, scale=KNEES)),
    "action scale forgotten": ("scale", edited(trainers.unitree_gym, lambda d: d.update(action_scale=1.0))),
    "posture of another sign": (
        "offset",
        edited(trainers.unitree_gym, lambda d: d.update(default_angles=[-q for q in d["default_angles"]])),
    ),
    "gains a fifth": (
        "gains",
        edited(trainers.unitree_deploy, lambda d: d.update(stiffness=[k / 5 for k in d["stiffness"]])),
    ),
    "the physics' step": ("rate", edited(trainers.isaac_lab, lambda d: d["scene"].update(dt=0.005))),
    "gyro upside down": ("gyro frame", of_deploy("base_ang_vel", scale=[0.25, -0.25, -0.25])),
    "gravity up": ("gravity sign", lambda f: trainers.mjlab(f, observation_terms_scale=TERM_SCALES)),
    "quaternion x first": ("quaternion order", of_golem(1, Wanted(quaternion=True), of=["x", "y", "z", "w"])),
    "history by frames": (
        "history layout",
        edited(
            trainers.unitree_deploy, lambda d: d["observations"].pop("use_gym_history"), replace(HISTORY, frames=True)
        ),
    ),
    "history of four": (
        "history length",
        edited(
            trainers.unitree_deploy, lambda d: [t.update(history_length=4) for t in d["observations"].values()], HISTORY
        ),
    ),
    "cosine first": ("clock phase", of_golem(6, of=["left_cos", "left_sin"])),
    "other leg's clock": ("clock phase", of_golem(6, of=["right_sin", "right_cos"])),
    "actions clipped": (
        "clip",
        edited(
            trainers.unitree_deploy,
            lambda d: d["actions"]["JointPositionAction"].update(
                clip=[[q - 0.1, q + 0.1] for q in d["default_joint_pos"]]
            ),
        ),
    ),
    "last action clipped": ("clip", of_deploy("last_action", clip=[-0.1, 0.1])),
    "vy first": ("commands", of_golem(2, of=["vy", "vx", "wz"])),
    "turns for side steps": ("commands", of_golem(2, of=["vx", "wz", "vy"])),
}

SOUND: dict[str, Write] = {
    "mjlab": trainers.mjlab,
    "mjlab, 27 joints": lambda f: trainers.mjlab(f, EVERYTHING),
    "mjlab, base velocity": lambda f: trainers.mjlab(f, Wanted(ISAAC_LEGS, velocity=True)),
    "mjlab, history": lambda f: trainers.mjlab(f, HISTORY),
    "mjlab, motors' order": lambda f: trainers.mjlab(f, Wanted()),
    "deploy": trainers.unitree_deploy,
    "deploy, 27 joints": lambda f: trainers.unitree_deploy(f, EVERYTHING),
    "deploy, history": lambda f: trainers.unitree_deploy(f, HISTORY),
    "deploy, frames": lambda f: trainers.unitree_deploy(f, replace(HISTORY, frames=True)),
    "deploy, clips": of_deploy("joint_vel_rel", clip=[-100.0, 100.0]),
    "Isaac Lab": trainers.isaac_lab,
    "Isaac Lab, quaternion": lambda f: trainers.isaac_lab(f, Wanted(ISAAC_LEGS, quaternion=True)),
    "Isaac Lab, 27 joints": lambda f: trainers.isaac_lab(f, EVERYTHING),
    "rl_gym": trainers.unitree_gym,
    "rl_gym, more damping": edited(trainers.unitree_gym, lambda d: d.update(kds=[1.5 * k for k in d["kds"]])),
    "ours": trainers.golem,
    "ours, newest first": lambda f: trainers.golem(f, Wanted(history=3, frames=True, newest_first=True)),
    "ours, right leg first": lambda f: trainers.golem(f, Wanted(RIGHT_FIRST)),
    "ours, clip": edited(trainers.golem, lambda d: d["action"].update(clip=20.0)),
    "almi_walk": lambda f: Path("almi_walk"),
    "almi_stand": lambda f: Path("almi_stand"),
}


CI = (
    *("Isaac's order unsaid", "knees seen the wrong way", "gains a fifth", "gravity up", "history by frames"),
    *("mjlab", "deploy, history", "Isaac Lab, quaternion", "rl_gym"),
)
"""One of each kind; the others do more of it, for up to half a minute each."""


def marked(names: dict[str, Any]) -> list[Any]:
    return [pytest.param(name, marks=() if name in CI else pytest.mark.long) for name in names]


@pytest.mark.slow
@pytest.mark.parametrize("name", marked(MISTAKES))
def test_a_planted_mistake_is_named_by_its_cause(tmp_path: Path, name: str) -> None:
    cause, write = MISTAKES[name]
    verdict = check_passport(read_passport(write(tmp_path)))
    assert [f.cause for f in verdict.findings] == [cause], [f.said for f in verdict.findings]


@pytest.mark.slow
@pytest.mark.parametrize("name", marked(SOUND))
def test_a_sound_policy_passes(tmp_path: Path, name: str) -> None:
    verdict = check_passport(read_passport(SOUND[name](tmp_path)))
    assert not verdict.findings


@pytest.mark.parametrize("name", shipped())
def test_the_numbers_of_shipped_descriptions_are_sound(name: str) -> None:
    assert not list(numbers(read_passport(name).description))


@pytest.mark.slow
@pytest.mark.long
def test_almi_opens_policy_is_sound(tmp_path: Path) -> None:
    verdict = check_passport(read_passport("almi_open", trainers.almi_open(tmp_path)))
    assert not verdict.findings


def test_the_shipped_walker_for_rough_ground_is_sound() -> None:
    network = SHIPPED / NETWORKS["rough"]
    assert not check_passport(read_passport("almi_walk", network)).findings


def test_a_network_whose_metadata_say_another_order_is_refused(tmp_path: Path) -> None:
    path = trainers.golem(tmp_path)
    network = tmp_path / "policy.onnx"
    network.write_bytes(network.read_bytes() + metadata({"joint_names": ",".join(ISAAC_LEGS)}))
    assert [f.cause for f in check_passport(read_passport(path)).findings] == ["order"]
    with pytest.raises(ConfigError, match=r"another order .* 'joints: \[left_hip_yaw_joint, right_hip_yaw_joint"):
        Policy(PolicyConfig(str(path)))


@pytest.mark.slow
def test_the_command_names_cause_and_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = edited(trainers.unitree_gym, lambda d: d.update(kps=d["kds"], kds=d["kps"]))(tmp_path)
    assert not run_policy_check(PolicyCheckConfig(file=str(path)))
    out = capsys.readouterr().out
    assert "gains" in out and "change h1_2.yaml, line 4 (kps)" in out
    assert run_policy_check(PolicyCheckConfig(file="almi_walk", json=True))
    assert json.loads(capsys.readouterr().out)["findings"] == []
