"""Kitchens in RoboCasa's format, of our own making: places, sizes, models, and what is refused."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from golem.errors import ConfigError
from golem.robots.mujoco.config import MujocoConfig
from golem.robots.mujoco.scene import build_scene
from golem.robots.sensors.profiles import load_profile
from golem.robots.worlds.layout import PackLayout
from golem.robots.worlds.robocasa import RobocasaConfig, read_robocasa

LAYOUT = """
room:
  walls:
    - {name: wall, type: wall, size: [2.0, 1.5, 0.02], pos: [2.0, 0, 1.5]}
    - {name: wall_back, type: wall, backing: true, size: [2.0, 1.5, 0.1], pos: [2.0, 0, 1.5]}
  floor:
    - {name: floor, type: floor, size: [2.0, 2.0, 0.02], pos: [2.0, -2.0, 0]}
main_group:
  bottom_row:
    - {name: sink, type: sink}
    - {name: wet, type: counter, interior_obj: sink, size: [1.0, 0.6, 0.9], pos: [0.5, -0.3, 0.45]}
    - {name: dry, type: counter, size: [1.2, 0.6, 0.9], align_to: wet, side: right}
    - {name: under, type: stack, levels: [drawer], percentages: [1], size: [1.2, 0.5, 0.8], pos: [1.6, -0.25, 0.45]}
    - {name: cup, type: glass_cup, placement: {fixture: dry, fixture: dry}}
  top_row:
    - {name: cab, type: hinge_cabinet, size: [1.2, 0.4, 0.9], pos: [1.6, -0.2, 1.9]}
    - {name: over, type: open_cabinet, size: [cab, 0.4, null], align_to: cab, side: top, alignment: back,
       stack_height: 1.2, stack_fixtures: [cab]}
right_group:
  group_origin: [0, 0]
  group_pos: [4.0, -1.0]
  group_z_rot: -1.5707963267948966
  bottom_row:
    - {name: fridge, type: fridge, size: [0.8, null, 1.6]}
    - {name: house, type: housing_cabinet, interior_obj: fridge, padding: [[0.1, 0.1], [-0.04, 0.0], [0, 0.1]],
       pos: [0.5, -0.3, 0.85]}
"""
MODEL = """
<mujoco><compiler angle="radian"/>
  <asset><mesh name="m" file="visuals/gone.obj"/><material name="red" rgba="1 0 0 1"/></asset>
  <worldbody><body>
    <site name="ext_p0" pos="-0.2 -0.2 0"/><site name="ext_px" pos="0.2 -0.2 0"/>
    <site name="ext_py" pos="-0.2 0.1 0"/><site name="ext_pz" pos="-0.2 -0.2 0.8"/>
    <body name="object">
      <geom type="mesh" mesh="m" contype="0" conaffinity="0" material="red"/>
      <geom type="box" size="0.2 0.05 0.4" pos="0 0.05 0.4" material="red"/>
      <body name="door"><joint name="hinge" axis="0 0 1"/>
        <geom type="box" size="0.4 0.05 0.2" pos="0 -0.15 0.4" quat="0.70710678 0 0.70710678 0"/></body>
    </body></body></worldbody>
  <actuator><motor joint="hinge"/></actuator></mujoco>
"""


@pytest.fixture
def layout(tmp_path: Path) -> Path:
    """A checkout with one layout, one style, a fridge with its model, and a sink without."""
    files = {
        "scenes/kitchen_layouts/mine.yaml": LAYOUT,
        "scenes/kitchen_styles/train/plain.yaml": "fridge: Big\n",
        "fixtures/fixture_registry/fridge.yaml": "default: {size: [1, 1, 1], xml: nowhere}\nBig: {xml: fixtures/big}\n",
        "fixtures/fixture_registry/sink.yaml": "default: {size: [0.5, 0.4, 0.2], xml: fixtures/sink}\n",
        "fixtures/big/model.xml": MODEL,
    }
    for name, text in files.items():
        (tmp_path / "assets" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "assets" / name).write_text(text)
    return tmp_path / "assets/scenes/kitchen_layouts/mine.yaml"


def test_fixtures_are_where_and_as_large_as_the_layout_says(layout: Path) -> None:
    found = read_robocasa(RobocasaConfig(layout, "plain"))
    places = {name: (np.round(f.pos, 6).tolist(), np.round(f.size, 6).tolist()) for name, f in found.items()}
    assert places["dry_main_group"] == ([1.6, -0.3, 0.45], [1.2, 0.6, 0.9])
    assert places["wall_room"][0] == [2.0, 0.02, 1.5]
    assert places["over_main_group"] == ([1.6, -0.2, 2.5], [1.2, 0.4, 0.3])
    assert places["sink_main_group"][0] == [0.5, -0.275, 0.8]
    assert "cup_main_group" not in places
    # 0.8 of 0.4 wide, so twice as deep as the model's 0.3; the house's walls are 0.1 beside and above it.
    assert places["fridge_right_group"][1] == [0.8, 0.6, 1.6]
    assert places["house_right_group"][1] == [1.0, 0.56, 1.7]
    fridge = found["fridge_right_group"]
    assert fridge.yaw == pytest.approx(-np.pi / 2)
    # Its middle is 0.02 before the house's and 0.05 below, which faces -x after the turn.
    middle = fridge.pos + (fridge.offset[1], -fridge.offset[0], fridge.offset[2])
    np.testing.assert_allclose(middle, [4.0 - 0.32, -1.5, 0.80], atol=1e-9)
    body, door = fridge.boxes
    np.testing.assert_allclose(body[1], [0.4, 0.1, 0.8])
    np.testing.assert_allclose(door[1], [0.4, 0.1, 0.8], atol=1e-6)


def test_a_pad_that_is_left_open_takes_the_rest(layout: Path) -> None:
    text = LAYOUT.replace("padding: [[0.1, 0.1], [-0.04, 0.0], [0, 0.1]]", "size: [1, 1, 2], padding: [[0.2, null]]")
    layout.write_text(text.replace("[[0.2, null]]", "[[0.2, null], null, [null, 0.3]]"))
    found = read_robocasa(RobocasaConfig(layout, "plain"))
    fridge, house = (found[f"{name}_right_group"] for name in ("fridge", "house"))
    # 0.2 and 0 beside it, 0.1 and 0.3 below and above; along the house's y it is in the middle.
    middle = fridge.pos + (fridge.offset[1], -fridge.offset[0], fridge.offset[2])
    np.testing.assert_allclose(middle - house.pos, [0.0, -0.1, -0.1], atol=1e-9)


def test_a_robot_begins_before_the_free_counter_with_things_on_it(layout: Path) -> None:
    config = MujocoConfig(world="robocasa", robocasa=RobocasaConfig(layout, "plain"), support="ground")
    scene = build_scene(config, PackLayout(), load_profile("ideal"), 1)
    model, data = scene.model, mujoco.MjData(scene.model)
    mujoco.mj_forward(model, data)
    hit = np.zeros(1, np.int32)
    groups = np.array([0, 0, 1, 0, 0, 0], np.uint8)
    start = np.array([0.0, 0.0, 0.89])
    pelvis = model.body("pelvis").id
    assert mujoco.mj_ray(model, data, start, np.array([1.0, 0.0, 0.0]), groups, 1, pelvis, hit) == pytest.approx(0.35)
    assert [part.label for part in scene.names.parts] and len(scene.names.parts) >= 3
    for part in scene.names.parts:
        assert 0.4 < part.position[0] < 0.6 and part.position[2] > 0.9


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("type: hinge_cabinet", "type: hinge_cabinett"), "hinge_cabinet"),
        (("align_to: wet", "align_to: wett"), "none of RoboCasa's: KeyError 'wett_main_group'"),
        (
            ("type: fridge, size: [0.8, null, 1.6]", "type: fridge, config_name: default, size: [1, null, 1]"),
            "download",
        ),
        (("[1.2, 0.6, 0.9]", "[1.2, 0.6, null]"), "dry has no size"),
        (("main_group:\n  bottom_row:", "main_group: 3\nother:\n  bottom_row:"), "none of RoboCasa's"),
    ],
)
def test_what_is_no_layout_is_refused_in_one_sentence(layout: Path, change: tuple[str, str], said: str) -> None:
    layout.write_text(LAYOUT.replace(*change))
    with pytest.raises(ConfigError, match=said):
        read_robocasa(RobocasaConfig(layout, "plain"))


def test_a_file_in_no_checkout_a_style_and_a_world_without_a_file_are_refused(layout: Path, tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text(LAYOUT)
    with pytest.raises(ConfigError, match="in no checkout"):
        read_robocasa(RobocasaConfig(tmp_path / "mine.yaml"))
    with pytest.raises(ConfigError, match="plain"):
        read_robocasa(RobocasaConfig(layout, "plane"))
    with pytest.raises(ConfigError, match="layout file"):
        MujocoConfig(world="robocasa")
    (layout.parents[2] / "fixtures/big/model.xml").write_text("<mujoco><worldbody/></mujoco>")
    with pytest.raises(ConfigError, match=r"model .* is none of RoboCasa's"):
        read_robocasa(RobocasaConfig(layout, "plain"))
