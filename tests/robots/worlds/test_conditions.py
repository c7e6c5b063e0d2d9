"""Work places that differ: what is drawn, where things stand then, and what a camera makes of the light."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from golem.errors import ConfigError
from golem.robots.model.magpie_model import hand_name
from golem.robots.mujoco.auto_exposure import GAIN, LONGER, READ_NOISE, SHOT_NOISE, AutoExposure
from golem.robots.mujoco.config import MujocoConfig
from golem.robots.mujoco.scene import build_scene
from golem.robots.sensors.profiles import load_profile
from golem.robots.worlds.conditions import (
    NAMES,
    RANGES,
    Conditions,
    arranged,
    check_condition,
    draw_conditions,
    draw_fasteners,
)
from golem.robots.worlds.ioniq5 import Ioniq5Layout
from golem.robots.worlds.layout import PackLayout
from golem.robots.worlds.screws import draw_screws
from golem.types import SIDES


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def test_the_nominal_place_draws_nothing() -> None:
    assert draw_conditions("nominal", {}, rng()) == Conditions()
    assert arranged(PackLayout(), Conditions()) == PackLayout()
    assert draw_fasteners(PackLayout(), Conditions(), 0.15, rng()).loose == (9, 10, 11, 12)


def test_a_varied_place_stays_within_its_ranges_and_differs_by_seed() -> None:
    drawn = [draw_conditions("varied", {}, rng(seed)) for seed in range(200)]
    for name, (low, high) in RANGES.items():
        values = [getattr(c, name) for c in drawn]
        assert low <= min(values) < max(values) <= high
        assert max(values) - min(values) > 0.9 * (high - low)
    assert {c.finish for c in drawn} == {"zinc", "black_oxide", "brass", "rust"}
    assert len(set(drawn)) == 200
    assert draw_conditions("varied", {}, rng(7)) == drawn[7]


def test_a_given_condition_leaves_the_others_as_they_are_drawn() -> None:
    free = draw_conditions("varied", {}, rng(3))
    assert draw_conditions("varied", {"pack_yaw": 0.3, "tray": "red"}, rng(3)) == replace(
        free, pack_yaw=0.3, tray="red"
    )


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("lihgt", 1.0, "light"),
        ("light", "bright", "a number from 0.01 to 20"),
        ("light", True, "a number"),
        ("light", float("nan"), "a number"),
        ("finish", "gold", "black_oxide, brass, rust, zinc"),
        ("pack_x", 3.0, "from -0.2 to 0.5"),
    ],
)
def test_what_is_no_condition_is_refused(name: str, value: object, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        check_condition(name, value)
    with pytest.raises(ConfigError, match=message):
        MujocoConfig(conditions={name: value})  # pyright: ignore[reportArgumentType]


def test_a_world_without_a_pack_has_no_layout() -> None:
    with pytest.raises(ConfigError, match="no pack"):
        MujocoConfig(world="open", layout="varied")


def test_the_tray_turns_and_moves_with_the_pack() -> None:
    nominal = PackLayout()
    moved = arranged(nominal, Conditions(pack_x=0.05, pack_y=-0.03, pack_yaw=0.2, height=0.04))
    at_first = np.linalg.inv(nominal.pose()) @ nominal.tray_pose()
    np.testing.assert_allclose(np.linalg.inv(moved.pose()) @ moved.tray_pose(), at_first, atol=1e-12)
    assert moved.top_z == pytest.approx(nominal.top_z + 0.04)


def test_screws_are_loose_tight_or_gone_and_none_stands_under_the_tray() -> None:
    under = {7, 8}  # of the nominal tray
    kinds: set[tuple[int, ...]] = set()
    for seed in range(50):
        found = draw_fasteners(PackLayout(), Conditions(loose=0.4, missing=0.5), 0.35, rng(seed))
        assert 1 <= len(found.loose) <= 3
        assert not set(found.loose) & set(found.missing)
        assert not set(found.loose) & under
        assert min(found.loose) <= 10, "the hand on the tray's side takes those up to the robot's middle"
        kinds.add(found.loose)
    assert len(kinds) > 6


def test_every_screw_of_a_varied_place_stands_in_its_bore() -> None:
    config = MujocoConfig(layout="varied", conditions={"pack_yaw": 0.15, "loose": 0.75})
    scene = build_scene(config, PackLayout(), load_profile("bench"), 5)
    data = mujoco.MjData(scene.model)
    for _ in range(100):
        mujoco.mj_step(scene.model, data)
    T = scene.layout.pose()
    for draw, name, mouth in zip(scene.draws, scene.names.screws, scene.names.mouths, strict=True):
        head = data.body(name).xpos
        axis = T[:3, :3] @ draw.axis()
        np.testing.assert_allclose(head, mouth + draw.protrusion * axis, atol=1.5e-3)
    assert set(scene.conditions.__class__.__dataclass_fields__) == set(NAMES)


def test_a_camera_exposes_longer_then_amplifies_then_sees_less() -> None:
    grey = np.full((60, 80, 3), 100, np.uint8)
    assert AutoExposure(1.0, rng(), 0.0).expose(grey) is grey
    assert AutoExposure(0.5 / (LONGER * GAIN), rng(), 0.0).expose(grey).std() == 0.0
    noise, mean = [], []
    for light in (3.0, 1.0, 1 / LONGER, 0.25, 0.1, 0.5 / (LONGER * GAIN)):
        image = AutoExposure(light, rng()).expose(grey).astype(float)
        noise.append(image.std())
        mean.append(image.mean())
    sigma = np.sqrt(READ_NOISE**2 + 100.0 * SHOT_NOISE**2)
    np.testing.assert_allclose(noise[:3], sigma, rtol=0.05)
    assert noise[2] < noise[3] < noise[4]
    np.testing.assert_allclose(mean, [100.0] * 5 + [50.0], atol=0.5)


def test_a_tray_on_the_other_side_is_the_mirror_image() -> None:
    moved = arranged(PackLayout(), Conditions(tray_side="left", tray_y=0.02))
    x, y = PackLayout().tray_xy
    np.testing.assert_allclose(moved.tray_xy, (x, -y + 0.02), atol=1e-12)


def test_a_pack_of_another_pitch_is_as_much_longer_and_a_real_one_is_not() -> None:
    pack = arranged(PackLayout(), Conditions(pitch=1.2, tray_wall=0.06))
    steps = [np.diff(layout.fasteners()[1:5, 1]).mean() for layout in (PackLayout(), pack)]
    assert steps[1] == pytest.approx(1.2 * steps[0], rel=0.01)
    assert pack.tray_size == (0.18, 0.24, 0.06)
    assert arranged(Ioniq5Layout(), Conditions(pitch=1.2)).size_y == Ioniq5Layout().size_y


def test_heads_of_a_varied_place_leave_no_gap_between_tight_and_loose() -> None:
    field = load_profile("field")
    scene = build_scene(MujocoConfig(layout="varied"), PackLayout(), field, 2)
    tight = [float(p.size[2]) for p in scene.names.parts if p.label == "screw" and p.body == "pack"]
    draws = draw_screws(rng(), field.screws.lower(), range(500))
    loose = [d.protrusion + d.head_height for d in draws]
    assert 0.005 <= min(tight) < 0.006 < 0.0075 < max(tight) <= 0.0086
    assert 0.008 < min(loose) < 0.0086
    assert np.diff(np.sort(tight + loose)).max() < 0.0007


def test_hands_are_mounted_beside_where_the_robot_believes_them() -> None:
    def mounts(**conditions: float) -> np.ndarray:
        config = MujocoConfig(conditions=dict(conditions))
        model = build_scene(config, PackLayout(), load_profile("ideal"), 3).model
        return np.array([model.body(hand_name(side)).pos for side in SIDES])

    moved = mounts(hand_offset=0.01) - mounts()
    np.testing.assert_allclose(np.linalg.norm(moved, axis=1), 0.01)
    assert not np.allclose(moved[0], moved[1], atol=1e-4)
