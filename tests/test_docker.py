"""What the containers run is what the commands take, and what they copy is there. No Docker engine is asked."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
import tyro
import yaml

from golem.runtime.live.process import TwinConfig, UpConfig
from golem.runtime.live.safety_main import SafetyConfig

ROOT = Path(__file__).parents[1]
COMMANDS = {"twin": TwinConfig, "safety": SafetyConfig, "up": UpConfig}
DEFAULT = re.compile(r"\$\{\w+:-([^}]*)\}")


def filled(words: list[str]) -> list[str]:
    """Return a command with the defaults of the variables in it."""
    return [DEFAULT.sub(r"\1", word) for word in words]


def starts() -> dict[str, list[str]]:
    """Return every command that a container begins with, by who says so."""
    compose = yaml.safe_load((ROOT / "docker/compose.yaml").read_text())["services"]
    found = {f"compose {name}": part["command"] for name, part in compose.items() if "command" in part}
    lines = (ROOT / "docker/Dockerfile").read_text().splitlines()
    images = (line.removeprefix("CMD ") for line in lines if line.startswith("CMD "))
    return found | {f"image {k}": json.loads(text) for k, text in enumerate(images)}


@pytest.mark.parametrize("who", starts())
def test_what_a_container_runs_is_a_command_of_golem(who: str) -> None:
    name, *words = filled(starts()[who])
    config = tyro.cli(COMMANDS[name], args=words)
    assert config.dds.domain == 1 and config.dds.interface == "eth0"


@pytest.mark.parametrize("file", ["Dockerfile", "ros.Dockerfile"])
def test_what_an_image_copies_is_in_the_repository(file: str) -> None:
    copied = re.findall(r"^COPY (?!--from)(.*) \S+$", (ROOT / "docker" / file).read_text(), re.MULTILINE)
    paths = [path for line in copied for path in line.split()]
    assert len(paths) >= 3
    assert [path for path in paths if not (ROOT / path).exists()] == []
