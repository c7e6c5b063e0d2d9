"""The parameters for Nav2 configure every server that its bringup starts, and their velocities end in /cmd_vel."""

from __future__ import annotations

from typing import Any

import pytest
import yaml
from tests.sources import SOURCE

PARAMS: dict[str, Any] = yaml.safe_load(
    (SOURCE.parents[1] / "docs/how-to/nav2_params.yaml").read_text(encoding="utf-8")
)
TWIST = ("controller_server", "behavior_server", "velocity_smoother", "collision_monitor", "docking_server")
"""Servers that write or read velocities (nav2_bringup navigation_launch.py of Jazzy and Kilted)."""
ASKED = {
    "collision_monitor": ("polygons", "observation_sources"),
    "docking_server": ("dock_plugins",),
    "controller_server": ("progress_checker_plugins", "goal_checker_plugins", "controller_plugins"),
    "planner_server": ("planner_plugins",),
    "behavior_server": ("behavior_plugins",),
}
"""Lists of names without which a server cannot be configured, or that we have our own for."""


def of(server: str) -> dict[str, Any]:
    return PARAMS[server]["ros__parameters"]


@pytest.mark.parametrize("server", ASKED)
def test_every_server_has_what_it_asks_for(server: str) -> None:
    for key in ASKED[server]:
        names = of(server)[key]
        assert names and all(isinstance(of(server)[name], dict) for name in names)


@pytest.mark.parametrize("server", TWIST)
def test_velocities_have_no_stamp(server: str) -> None:
    assert of(server)["enable_stamped_cmd_vel"] is False  # Kilted stamps them, our topic /cmd_vel is a Twist


def test_the_chain_of_velocities_ends_in_ours() -> None:
    monitor = of("collision_monitor")
    assert (monitor["cmd_vel_in_topic"], monitor["cmd_vel_out_topic"]) == ("cmd_vel_smoothed", "cmd_vel")
    assert monitor["cloud"]["topic"] == "/livox/pointcloud" and monitor["cloud"]["type"] == "pointcloud"
    layer = PARAMS["local_costmap"]["local_costmap"]["ros__parameters"]["voxel_layer"]["cloud"]
    assert monitor["cloud"]["min_range"] == layer["obstacle_min_range"]
