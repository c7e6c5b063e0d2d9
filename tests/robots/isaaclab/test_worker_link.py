"""A worker that cannot run says why in one sentence; one that dies is missed."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from golem.errors import ConfigError, MissingEnvironment
from golem.robots.isaaclab.isaac_robot import VARIABLE, IsaacLabConfig, IsaacLabRobot, Layers, isaac_python, take_worker
from golem.robots.isaaclab.isaac_worker import WorkerScene, reply_type, request_type
from golem.runtime.lockstep import start_posture

SCENE: WorkerScene = {
    "backend": "physx",
    "dt": 0.002,
    "robot": "",
    "world": "",
    "joints": ["hinge"],
    "bodies": ["base", "arm"],
    "torso": "arm",
}


def test_without_an_environment_it_says_how_to_get_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    with pytest.raises(MissingEnvironment, match=f"make venv-isaac.*{VARIABLE}"):
        IsaacLabRobot("ideal", 0, start_posture())


def test_a_python_that_is_not_there_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path / "python"))
    with pytest.raises(MissingEnvironment, match="There is no Python '.*python'"):
        isaac_python(None)


def test_the_option_goes_before_the_variable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, "/nowhere")
    assert isaac_python(Path(sys.executable)) == Path(sys.executable)


@pytest.mark.parametrize(
    ("python", "why"),
    [(sys.executable, r"ModuleNotFoundError: No module named '\w+'"), ("/bin/false", "it said nothing")],
)
def test_a_python_without_isaac_lab_is_refused(python: str, why: str) -> None:
    with pytest.raises(ConfigError, match=f"does not run under {python}: {why}"):
        take_worker(Path(python), SCENE, Layers("#usda 1.0\n", "#usda 1.0\n"))


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ({"backend": "bullet"}, "'bullet'; valid: newton, physx"),
        ({"world": "pack"}, "In Isaac Lab only the robot moves"),
        ({"self_collision": True}, "twin in Isaac Lab does not have the option self_collision"),
    ],
)
def test_what_it_cannot_do_is_refused(options: dict[str, object], why: str) -> None:
    with pytest.raises(ConfigError, match=why):
        IsaacLabConfig(**options)  # type: ignore[arg-type]


def test_messages_are_plain_numbers_without_gaps() -> None:
    request, reply = request_type(3, 2), reply_type(3, 2)
    assert request.itemsize == 8 * (1 + 7 + 3 + 3 + 2 * 6)
    assert reply.itemsize == 8 * (7 + 6 + 6 + 3 + 2 * 3)
    sent = np.zeros((), request)
    sent["wrench"][1, 5] = 4.0
    assert np.frombuffer(sent.tobytes(), request)[0]["wrench"][1, 5] == 4.0
