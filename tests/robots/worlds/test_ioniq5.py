"""The real pack: everything is where its data say, loosened fasteners rest and come out, tight ones stay."""

from __future__ import annotations

import csv
from collections import Counter
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from tests.robots.worlds.conftest import Compiled
from tests.robots.worlds.test_pack import height

from golem.robots.mujoco.config import MujocoConfig
from golem.robots.mujoco.engine import MujocoRobot
from golem.robots.mujoco.scene import nominal_layout
from golem.robots.worlds.conditions import Conditions, Fasteners, arranged, draw_conditions, draw_fasteners
from golem.robots.worlds.ioniq5 import RIM, Ioniq5Layout, ioniq5_data
from golem.robots.worlds.layout import PackLayout
from golem.robots.worlds.pack import add_pack
from golem.robots.worlds.pack_part import without
from golem.robots.worlds.screws import ScrewRanges, draw_screws
from golem.runtime import lockstep
from golem.stack import load_stack

STEP = 0.002


def build(seed: int = 0, loose: float = 0.3, missing: float = 0.2, rim: float = RIM) -> Compiled:
    layout, rng = Ioniq5Layout().raised(rim - RIM), np.random.default_rng(seed)
    places = draw_fasteners(layout, Conditions(loose=loose, missing=missing), 0.35, rng)
    layout = replace(layout, empty_holes=places.missing)
    draws = draw_screws(rng, ScrewRanges(), places.loose, layout.kind)
    spec = mujoco.MjSpec()
    spec.option.timestep = STEP
    names = add_pack(spec, layout, draws)
    model = spec.compile()
    return Compiled(model, mujoco.MjData(model), names, draws, layout)


def test_the_data_are_the_list_s_fasteners_on_two_levels_and_a_bracket() -> None:
    data = ioniq5_data()
    assert Counter(data.kinds) == {"screw": 53, "nut": 30, "bolt": 1}
    assert data.fasteners.shape == (84, 3) and data.holes.shape == (9, 3)
    levels, counts = np.unique(data.fasteners[:, 2], return_counts=True)
    assert dict(zip(levels.tolist(), counts.tolist(), strict=True)) == {-0.117: 1, -0.065: 11, 0.0: 72}
    apart = np.linalg.norm(data.fasteners[:, None] - data.fasteners[None], axis=2) + np.eye(84)
    assert 0.024 < apart.min() < 0.04  # the dented end


def test_our_places_are_those_of_the_published_list(shared: Path) -> None:
    rows = list(csv.DictReader((shared / "pack" / "ioniq5_fasteners.csv").read_text().splitlines()))
    listed = np.array([[float(r["x"]), float(r["y"])] for r in rows if r["class"] != "hole"])
    turn = 0.0282
    turned = listed @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    ours = ioniq5_data().fasteners
    there = np.column_stack([0.0573 - ours[:, 1], ours[:, 0] - 0.6158 - 0.014])
    off = np.linalg.norm(there[:, None] - turned[None], axis=2).min(axis=1)
    assert np.sort(off)[-15] < 0.002 and off.max() < 0.06


def test_bodies_stand_at_their_places() -> None:
    w = build(loose=0.5)
    mujoco.mj_forward(w.model, w.data)
    T, spots = w.layout.pose(), w.layout.fasteners()
    assert np.allclose(T[2, 3] + spots[:72, 2], RIM)
    for draw, mouth in zip(w.draws, w.names.mouths, strict=True):
        place = (T @ (*spots[draw.slot], 1.0))[:3]
        assert np.linalg.norm(mouth - place) < 1e-9
        seat = w.data.body(f"{'stud' if draw.kind == 'nut' else 'bore'}_{draw.slot:02d}").xpos
        stands = w.data.body(draw.name).xpos - draw.protrusion * (T[:3, :3] @ draw.axis())
        assert np.linalg.norm(seat - place) < 1e-3 and np.linalg.norm(stands - place) < 1e-3
    tight = {part.geoms[0] for part in w.names.parts if part.body == "pack" and part.geoms}
    for slot in set(range(84)) - {d.slot for d in w.draws} - set(w.layout.empty_holes):
        name = f"nut_{slot:02d}_washer" if w.layout.kind(slot) == "nut" else f"fastener_{slot:02d}_flange"
        assert name in tight
        place = (T @ (*spots[slot], 1.0))[:3]
        assert np.linalg.norm(w.data.geom(name).xpos[:2] - place[:2]) < 1e-3


@pytest.mark.parametrize(("seed", "rim"), [(0, 0.857), (1, 0.75), (2, 1.06), (3, 0.9)])
def test_nothing_is_in_anything_else_and_everything_rests(seed: int, rim: float) -> None:
    w = build(seed, rim=rim)
    mujoco.mj_forward(w.model, w.data)
    assert all(c.dist > -2e-5 for c in w.data.contact)
    start, deepest = w.data.qpos.copy(), 0.0
    for _ in range(round(2.0 / STEP)):
        mujoco.mj_step(w.model, w.data)
        deepest = min(deepest, min((c.dist for c in w.data.contact), default=0.0))
    moved = (w.data.qpos - start).reshape(-1, 7)
    assert deepest > -1e-4
    assert np.linalg.norm(moved[:, :3], axis=1).max() < 50e-6
    assert 2 * np.linalg.norm(moved[:, 4:], axis=1).max() < np.deg2rad(0.15)
    assert (w.data.tree_asleep >= 0).all()


@pytest.mark.parametrize(("pull", "comes"), [(0.8, True), (0.03, False)])
def test_a_loosened_nut_lifts_off_its_stud(pull: float, comes: bool) -> None:
    w = build(seed=4)
    nuts = [(draw, w.model.body(draw.name).id) for draw in w.draws if draw.kind == "nut"]
    assert len(nuts) > 4
    start = w.data.qpos.copy()
    for _ in range(150):
        for draw, body in nuts:  # up until its stud lets it go
            rise = w.data.xpos[body] @ (0.0, 0.0, 1.0) - w.layout.top_z - w.layout.fasteners()[draw.slot][2]
            w.data.xfrc_applied[body, 2] = pull if rise < draw.shank_length + 0.01 else 0.0
        mujoco.mj_step(w.model, w.data)
    for draw, _ in nuts:
        at = w.model.joint(draw.name).qposadr[0] + 2
        risen = w.data.qpos[at] - start[at]
        assert risen > draw.engaged if comes else abs(risen) < 5e-5


def test_a_nut_that_is_pushed_aside_stays_on_its_stud() -> None:
    w = build(seed=4)
    nuts = [(draw, w.model.body(draw.name).id) for draw in w.draws if draw.kind == "nut"]
    for _ in range(300):
        for _, body in nuts:
            w.data.xfrc_applied[body, 0] = 1.0
        mujoco.mj_step(w.model, w.data)
    for draw, body in nuts:
        place = w.names.mouths[[d.slot for d in w.draws].index(draw.slot)]
        assert np.linalg.norm(w.data.xpos[body][:2] - place[:2]) < 0.002


def test_what_is_tight_or_gone_has_no_body_that_could_come_out() -> None:
    w = build()
    free = {w.model.body(w.model.jnt_bodyid[j]).name for j in range(w.model.njnt)}
    assert free == {draw.name for draw in w.draws} and len(free) == round(0.3 * 84)


def test_the_cover_has_no_gap_but_its_bores() -> None:
    w = build(loose=0.6)
    for name in w.names.screws:  # out of the way
        w.data.qpos[w.model.joint(name).qposadr[0] + 2] = -3.0
    mujoco.mj_forward(w.model, w.data)
    rng, T, spots = np.random.default_rng(0), w.layout.pose(), w.layout.fasteners()
    (wx0, wx1), (wy0, wy1) = w.layout.window_x, w.layout.window_y
    for x0, x1, y0, y1, top in ioniq5_data().cover:
        for x, y in zip(rng.uniform(x0, x1, 150), rng.uniform(y0, y1, 150), strict=True):
            near = np.linalg.norm(spots[:, :2] - (x, y), axis=1).min() < 0.015
            if near or (wx0 - 0.005 < x < wx1 + 0.005 and wy0 - 0.005 < y < wy1 + 0.005):
                continue
            at = T @ (x, y, top, 1.0)
            assert -0.001 < height(w.model, w.data, at[0], at[1]) - at[2] < 0.07  # trays stand there


def test_pieces_are_the_rectangle_without_its_cuts() -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        low, size = rng.uniform(-0.2, 1.0, (6, 2)), rng.uniform(0.02, 0.4, (6, 2))
        cuts = [(a, a + c, b, b + d) for (a, b), (c, d) in zip(low, size, strict=True)]
        pieces = without((0.0, 1.0, 0.0, 1.0), cuts)
        for x, y in rng.uniform(0.0, 1.0, (200, 2)):
            hit = sum(a <= x < b and c <= y < d for (a, b), (c, d) in pieces)
            assert hit == (not any(a <= x < b and c <= y < d for a, b, c, d in cuts))


def test_the_draw_is_that_of_the_seed_all_round_the_pack() -> None:
    sides: Counter[str] = Counter()
    for seed in range(10):
        one, other = build_draw(seed), build_draw(seed)
        assert one == other
        conditions, places, layout = one
        assert 0.75 <= RIM + conditions.height <= 1.06
        for slot in places.loose:
            x, y, _ = layout.fasteners()[slot]
            sides["near" if x < 0.06 else "far" if x > 1.18 else "left" if y > 0 else "right"] += 1
        assert not set(places.loose) & set(places.missing)
    assert min(sides.values()) > 20 and len(sides) == 4


def build_draw(seed: int) -> tuple[Conditions, Fasteners, PackLayout]:
    rng = np.random.default_rng(seed)
    conditions = draw_conditions("varied", {}, rng, "ioniq5")
    layout = arranged(Ioniq5Layout(), conditions)
    return conditions, draw_fasteners(layout, conditions, 0.35, rng), layout


@pytest.mark.parametrize("side", ["left", "right"])
def test_trays_stand_apart_on_the_cover_beside_the_fasteners(side: str) -> None:
    layout = arranged(Ioniq5Layout(), Conditions(tray_side=side, pack_yaw=0.1))  # pyright: ignore[reportArgumentType]
    trays = layout.trays()
    assert Counter(t.kind for t in trays) == {"screw": 7, "nut": 6}
    np.testing.assert_allclose(trays[0].pose(), layout.tray_pose(), atol=1e-12)
    T = np.linalg.inv(layout.pose())
    half = 0.5 * np.array(layout.tray_size[:2])
    corners = np.array([[sx * half[0], sy * half[1], 0.0, 1.0] for sx in (-1, 1) for sy in (-1, 1)])
    boxes = []
    for tray in trays:
        at = (corners @ (T @ tray.pose()).T)[:, :2]
        low, high = at.min(axis=0), at.max(axis=0)
        inside = ((layout.fasteners()[:, :2] > low - 0.02) & (layout.fasteners()[:, :2] < high + 0.02)).all(axis=1)
        assert not inside.any()
        assert all(((low > h) | (high < lo)).any() for lo, h in boxes)
        boxes.append((low, high))


def test_the_rim_is_as_high_over_the_floor_in_the_hoist_as_standing() -> None:
    stands = nominal_layout(MujocoConfig(world="ioniq5", support="ground"), 0.96)
    hangs = nominal_layout(MujocoConfig(world="ioniq5"), 0.96)
    assert stands.top_z == RIM
    assert hangs.top_z - RIM == pytest.approx(MujocoConfig().hoist.height - 0.96)
    assert type(nominal_layout(MujocoConfig(), 0.96)) is PackLayout


def test_a_nut_that_is_let_go_flat_above_its_tray_stays_in_it() -> None:
    _, robot = lockstep.build(load_stack("tether", profile="ideal").with_options("robot", world="ioniq5"), 0)
    assert isinstance(robot, MujocoRobot)
    model, data, layout = robot.scene.model, robot.data, robot.scene.layout
    tray = next(tray for tray in layout.trays() if tray.kind == "nut")
    nuts = [draw for draw in robot.scene.draws if layout.kind(draw.slot) == "nut"]
    for k, draw in enumerate(nuts[:12]):
        joint = model.body(draw.name).jntadr[0]
        at = model.jnt_qposadr[joint]
        data.qpos[at : at + 7] = (tray.x, tray.y + 0.015 * (k - 6), tray.z + 0.1 + 0.0005 * k, 1.0, 0.0, 0.0, 0.0)
    for _ in range(300):
        mujoco.mj_step(model, data)
    heights = [float(data.body(draw.name).xpos[2]) for draw in nuts[:12]]
    robot.close()
    assert min(heights) > tray.z
