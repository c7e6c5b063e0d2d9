"""How large the software may be: what runs on a robot, and all of it. Each change takes away what it makes needless."""

from __future__ import annotations

from pathlib import Path

from tests.sources import SOURCE

ALL = 101_928
"""Lines of the package [own: 100,000 is the goal; lower this with every line that goes]."""
ON_A_ROBOT = 62_685
"""Lines of what a robot runs [own: 62,000 is the goal]."""
NOT_ON_A_ROBOT = ("evaluation", "training", "dashboard", "demo.py", "demo_pack.py", "demo_walk.py", "run.py")
ENGINES = ("mujoco", "physx", "isaaclab", "replay", "worlds")
"""Folders of `robots` that stand in for one."""


def lines(paths: list[Path]) -> int:
    return sum(len(path.read_text(encoding="utf-8").splitlines()) for path in paths)


def on_a_robot(path: Path) -> bool:
    parts = list(path.relative_to(SOURCE).parts)
    simulated = parts[0] == "robots" and len(parts) > 1 and parts[1] in ENGINES
    return parts[0] not in NOT_ON_A_ROBOT and not simulated


def test_the_package_keeps_its_size() -> None:
    files = sorted(SOURCE.rglob("*.py"))
    robot = [path for path in files if on_a_robot(path)]
    assert len(robot) > 300
    assert lines(files) <= ALL
    assert lines(robot) <= ON_A_ROBOT
