# ruff: noqa: E402 (nothing of the trainer can be imported where torch is absent)
from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="training needs the extra 'train'")
onnx = pytest.importorskip("onnx", reason="export needs the extra 'train'")

from golem.capabilities.legs.description import load_description
from golem.capabilities.legs.network import load_network
from golem.capabilities.legs.observation import ObservationLayout
from golem.errors import ConfigError
from golem.provenance import commit
from golem.robots.model.leg_kinematics import leg_poses
from golem.training.legs.checkpoint import CHECKPOINT, CURVE, read_checkpoint, read_curve
from golem.training.legs.disturbances import GENTLE, STRAIGHT, Difficulty, RandomPushes, UpperBodyMotion
from golem.training.legs.env import LAYOUT, TASKS, LegsEnv, Task
from golem.training.legs.export_policy import TRAINED, command_of, export, load_actor
from golem.training.legs.learning_curve import draw_curves
from golem.training.legs.mirror import Mirror, leg_mirror
from golem.training.legs.ppo import Actor, Ppo, PpoConfig
from golem.training.legs.train_legs import (
    EXPORTED_NOISE,
    EXPORTED_PUSH,
    Adversary,
    Device,
    TrainLegsConfig,
    _Run,
    train,
)
from golem.training.legs.training_model import STANCE

QUARTERS = TASKS["stand"].quarters


def small(
    out: Path, seed: int = 0, updates: int = 2, *, robots: int = 8, device: Device = "cpu", **changes: Any
) -> TrainLegsConfig:
    return TrainLegsConfig(out=out, seed=seed, robots=robots, steps=robots * 24 * updates, device=device, **changes)


def test_a_run_in_two_processes_says_so_and_counts_their_time(tmp_path: Path) -> None:
    saved = read_checkpoint(train(small(tmp_path, learned_from=0.0, shards=2, seconds=1e3)))
    assert "--shards 2 " in command_of(saved) and saved["config"]["device"] == "cpu" and saved["updates"] == 2
    curve = read_curve(tmp_path)
    assert (np.diff(curve["cpu_s"]) > 0.0).all() and (np.diff(curve["wall_s"]) > 0.0).all()


def test_a_run_stops_by_the_clock_with_its_checkpoint_and_goes_on(tmp_path: Path) -> None:
    path = train(small(tmp_path, updates=2, seconds=1e-3))
    assert read_checkpoint(path)["updates"] == 1
    train(small(tmp_path, updates=2))
    assert read_checkpoint(path)["updates"] == 2
    with pytest.raises(ConfigError, match="more than 0 seconds"):
        train(small(tmp_path, seconds=0.0))


def test_the_device_is_what_there_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    assert read_checkpoint(train(small(tmp_path, updates=1, device="auto")))["config"]["device"] == "cpu"
    with pytest.raises(ConfigError, match="--device cuda is not there; auto"):
        train(small(tmp_path, device="cuda"))


def test_a_run_is_reproduced_by_its_seed_and_goes_on_from_its_checkpoint(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, seed in (("a", 0), ("b", 0), ("c", 1)):
        train(small(tmp_path / name, seed, updates=10, learned_from=0.0))
    a, b, c = (load_actor(tmp_path / name / CHECKPOINT).net[0].weight for name in "abc")
    assert torch.equal(a, b) and not torch.equal(a, c)
    with (tmp_path / "a" / CURVE).open() as file:
        rows = list(csv.DictReader(file))
    assert [int(float(row["steps"])) for row in rows] == [192 * k for k in range(1, 11)]
    train(small(tmp_path / "a", updates=11, learned_from=0.0))
    assert torch.load(tmp_path / "a" / CHECKPOINT, weights_only=True)["updates"] == 11
    assert command_of(read_checkpoint(tmp_path / "a" / CHECKPOINT)).endswith(f"(commit {commit()})")
    with monkeypatch.context() as changed:
        changed.setattr("golem.training.legs.train_legs.commit", lambda: "later")
        train(small(tmp_path / "a", updates=12, learned_from=0.0))
    assert command_of(read_checkpoint(tmp_path / "a" / CHECKPOINT)).endswith(f"(commit {commit()}, then later)")
    with pytest.raises(ConfigError, match="another configuration"):
        train(small(tmp_path / "a", seed=5, updates=12))
    with monkeypatch.context() as changed, pytest.raises(ConfigError, match="other rewards"):
        changed.setitem(TASKS, "walk", replace(TASKS["walk"], fall=7.0))
        train(small(tmp_path / "a", updates=12, learned_from=0.0))
    curves = tmp_path / "curves"
    draw_curves([tmp_path / name for name in "abc"], curves / "curve.png")
    with pytest.raises(ConfigError, match=r"ends in \.png, not"):
        draw_curves([tmp_path / "a"], curves / "curve.jpg")
    with pytest.raises(ConfigError, match="8 runs at most, not 9"):
        draw_curves([tmp_path / "a"] * 9, tmp_path / "curve.png")
    with pytest.raises(ConfigError, match="would replace the run's own curve.csv"):
        draw_curves([tmp_path / "a"], tmp_path / "a" / "curve.png")
    with pytest.raises(ConfigError, match="different names"):
        draw_curves([tmp_path / "a"] * 2, tmp_path / "curve.png")
    assert (curves / "curve.png").stat().st_size > 1000
    with (curves / "curve.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert {row["run"] for row in rows} == set("abc")
    assert float(rows[0]["steps"]) == read_curve(tmp_path / "a")["steps"][0]


def test_rows_of_the_curve_that_are_learned_again_are_left_out(tmp_path: Path) -> None:
    train(small(tmp_path, updates=20))
    with (tmp_path / CURVE).open("a") as file:  # it was killed between a curve and a checkpoint
        file.write((tmp_path / CURVE).read_text().splitlines()[-1].replace("3840", "5760", 1) + "\n3842,0.")
    train(small(tmp_path, updates=30))
    assert read_curve(tmp_path)["steps"].tolist() == pytest.approx([192 * k for k in range(1, 31)], rel=1e-4)
    (tmp_path / CHECKPOINT).unlink()  # it was killed before the first one
    train(small(tmp_path, updates=10))
    assert read_curve(tmp_path)["steps"].tolist() == pytest.approx([192 * k for k in range(1, 11)], rel=1e-4)


def test_a_network_of_other_layers_is_exported_read_and_trained_on_by_its_like_alone(tmp_path: Path) -> None:
    checkpoint = train(small(tmp_path / "run", updates=1, ppo=PpoConfig(hidden=(16, 8))))
    network, _ = export(checkpoint, tmp_path)
    seen = torch.randn(2, load_actor(checkpoint).net[0].in_features)
    with torch.no_grad():
        torch.testing.assert_close(load_actor(network)(seen), load_actor(checkpoint)(seen))
    for start in (checkpoint, network):
        with pytest.raises(ConfigError, match=r"has other layers than this run; give it those with --ppo\.hidden"):
            train(small(tmp_path / start.suffix, updates=2700, start=start))
    train(small(tmp_path / "on", updates=2, start=checkpoint, ppo=PpoConfig(hidden=(16, 8))))


def test_a_run_that_begins_with_anothers_networks_draws_its_own_noise(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = train(small(tmp_path / "first"))
    weights = [
        load_actor(train(small(tmp_path / f"{seed}", seed, updates=3, start=first))).net[0].weight for seed in (1, 2)
    ]
    assert not torch.equal(*weights)
    network, _ = export(first, tmp_path)
    with pytest.raises(ConfigError, match="--steps is more than 500000"):
        train(small(tmp_path / "short", start=network))
    config = small(tmp_path / "anew", updates=2700, start=network)
    run = _Run(config)
    run.begin_with(network)
    for mine, exported in zip(run.legs.actor.net.parameters(), load_actor(network).net.parameters(), strict=True):
        assert torch.equal(mine, exported)
    assert run.steps == 0 and float(run.legs.actor.log_std.exp().detach().mean()) == pytest.approx(EXPORTED_NOISE)
    assert run.env.difficulty.strictness == run.env.difficulty.amplitude == 1.0
    assert run.env.difficulty.push == EXPORTED_PUSH
    before = [w.detach().clone() for w in run.legs.critic.parameters()]
    run.update()  # it has no critic yet: at first the critic learns alone
    for mine, exported in zip(run.legs.actor.parameters(), load_actor(network).parameters(), strict=True):
        assert torch.equal(mine, exported) or mine is run.legs.actor.log_std
    assert not any(torch.equal(w, v) for w, v in zip(run.legs.critic.parameters(), before, strict=True))
    monkeypatch.setattr("golem.training.legs.train_legs.VALUES_FIRST", 0)
    run.update()
    assert not torch.equal(run.legs.actor.net[0].weight, load_actor(network).net[0].weight)
    with pytest.raises(ConfigError, match=r"has 384 steps already; --steps, which counts them, is 384\."):
        train(small(tmp_path / "none", start=first))


def test_files_that_are_no_checkpoint_network_or_curve_are_named(tmp_path: Path) -> None:
    (tmp_path / "notes.pt").write_text("hello")
    torch.save({"model": 1}, tmp_path / "other.pt")
    for name, words in (("nope.pt", "No such file"), ("notes.pt", "is no checkpoint"), ("other.pt", "older GOLEM")):
        with pytest.raises(ConfigError, match=words):
            export(tmp_path / name, tmp_path)
        with pytest.raises(ConfigError, match=words):
            train(small(tmp_path / "run", start=tmp_path / name))
    (tmp_path / "notes.onnx").write_text("hello")
    for name, words in (("nope.onnx", "No such file"), ("notes.onnx", "is no network")):
        with pytest.raises(ConfigError, match=words):
            load_actor(tmp_path / name)
    with pytest.raises(ConfigError, match="name folders of runs"):
        draw_curves([tmp_path / "nope"], tmp_path / "curve.png")
    (tmp_path / CURVE).write_text("steps\n")
    with pytest.raises(ConfigError, match="is no learning curve"):
        draw_curves([tmp_path], tmp_path / "drawn.png")


@pytest.mark.parametrize("task", TASKS)
def test_the_exported_network_is_the_trained_one_and_its_description_fits(task: Task, tmp_path: Path) -> None:
    train(small(tmp_path / "run", task=task))
    checkpoint = tmp_path / "run" / CHECKPOINT
    export(checkpoint, tmp_path)
    description, path = load_description(tmp_path / f"almi_{task}.yaml")
    layout = description.layout()
    network, actor, again = load_network(path, layout.size), load_actor(checkpoint), load_actor(path)
    command = command_of(read_checkpoint(checkpoint))
    assert command.startswith(f"golem train legs run --task {task} --seed 0 ") and commit() in command
    (said,) = onnx.load(str(path)).metadata_props
    assert (said.key, said.value) == (TRAINED, command)
    for observation in np.random.default_rng(0).normal(size=(3, layout.size)).astype(np.float32):
        with torch.no_grad():
            expected = actor(torch.from_numpy(observation)).numpy()
            np.testing.assert_array_equal(again(torch.from_numpy(observation)).numpy(), expected)
        np.testing.assert_allclose(network(observation), expected, atol=1e-6)
    np.testing.assert_allclose(description.q0()[:12], STANCE)


def test_mirrors_are_involutions_and_the_policy_is_equivariant() -> None:
    layout = ObservationLayout(LAYOUT, np.concatenate([STANCE, np.zeros(15)]))
    seen, legs = Mirror(layout.components), leg_mirror()
    rng = np.random.default_rng(0)
    observation, action = rng.normal(size=layout.size), rng.normal(size=12)
    np.testing.assert_array_equal(seen(seen(observation)), observation)
    np.testing.assert_array_equal(legs(legs(action)), action)
    actor = Actor(seen, legs, (16, 16))
    with torch.no_grad():
        torch.nn.init.normal_(actor.net[-1].weight)
        plain = actor(torch.from_numpy(observation).float()).numpy()
        turned = actor(torch.from_numpy(seen(observation)).float()).numpy()
    np.testing.assert_allclose(turned, legs(plain), atol=1e-6)


def test_a_mirrored_leg_posture_puts_the_feet_where_the_mirror_shows_them() -> None:
    q = np.random.default_rng(0).uniform(-0.4, 0.4, 12)
    p, _ = leg_poses(q)
    mirrored, _ = leg_poses(leg_mirror()(q))
    np.testing.assert_allclose(mirrored[::-1] * [1.0, -1.0, 1.0], p, atol=1e-12)


def test_ppo_learns_which_way_to_act() -> None:
    mirror = Mirror([("joint_position", "left_knee_joint"), ("joint_position", "right_knee_joint")])
    ppo = Ppo(Actor(mirror, mirror, (8,)), 1, 64, PpoConfig(steps=8, hidden=(8,)), 0)
    rng = np.random.default_rng(0)
    errors = []
    for _ in range(40):
        for _ in range(8):
            seen = rng.normal(size=(64, 2))
            action = ppo.act(seen, np.zeros((64, 1)))
            error = np.square(action - seen).sum(axis=1)
            ppo.learn_of(np.exp(-error), np.ones(64, dtype=bool), np.zeros(64, dtype=bool))
        ppo.update(seen, np.zeros((64, 1)))
        errors.append(error.mean())
    assert np.mean(errors[-5:]) < 0.5 * np.mean(errors[:5])


@pytest.mark.parametrize("adversary", ["motions", "none"])
def test_disturbances_grow_with_the_steps(adversary: Adversary, tmp_path: Path) -> None:
    ramps: dict[str, Any] = {"push_ramp": (0.0, 384.0), "motion_ramp": (384.0, 768.0)}
    ramps["strict_ramp"] = (384.0, 576.0)
    train(small(tmp_path, updates=10, adversary=adversary, **ramps))
    with (tmp_path / CURVE).open() as file:
        rows = list(csv.DictReader(file))
    push, motion, payload = ([float(row[name]) for row in rows] for name in ("push", "amplitude", "payload"))
    assert payload == motion
    assert [float(row["strictness"]) for row in rows] == [0.0, 0.0, 1.0] + [1.0] * 7
    assert push[0] == pytest.approx(0.525) and push[1:] == [1.0] * 9
    assert motion == ([0.05, 0.05, 0.525] + [1.0] * 7 if adversary == "motions" else [0.0] * 10)


def test_the_noise_is_bounded_late_in_a_run(tmp_path: Path) -> None:
    train(small(tmp_path, updates=10, noise_ramp=(1728.0, 1344.0), noise=(0.7, 0.1)))
    with (tmp_path / CURVE).open() as file:
        std = [float(row["std"]) for row in csv.DictReader(file)]
    # The first update is free, and a bound holds from the next update on.
    assert std[0] == pytest.approx(0.8, rel=0.05)
    assert std[1:] == pytest.approx([0.7, 0.4] + [0.1] * 7, rel=0.05)

    # Who begins with these networks explores again.
    ramp: dict[str, Any] = {"noise_ramp": (1.0, 0.0), "noise": (0.7, 0.1)}
    train(small(tmp_path / "again", updates=12, start=tmp_path / CHECKPOINT, **ramp))
    with (tmp_path / "again" / CURVE).open() as file:
        assert [float(row["std"]) for row in csv.DictReader(file)] == pytest.approx([0.7] * 2, rel=0.05)


def test_bounds_of_the_difficulty_hold_for_the_adversary() -> None:
    rng = np.random.default_rng(0)
    motion = UpperBodyMotion(4, rng)
    motion.reset(np.arange(4), 0.0, np.array([False, False, True, False]))
    start = motion.target.copy()
    slow = Difficulty(amplitude=0.1, speed=0.2)
    for _ in range(500):
        motion.steer(np.array([1, 2]), np.full((2, 15), 9.0), slow, 0.02)
    moved = np.abs(motion.target - start).max(axis=1)
    assert moved[0] == moved[3] == 0.0 and 0.05 < moved[1:3].max() < 0.7


def test_a_calm_episode_has_no_push_and_slow_arms() -> None:
    rng, everyone = np.random.default_rng(0), np.arange(40)
    calm = everyone % 2 == 0
    pushes, motion = RandomPushes(40, 50.0, QUARTERS, rng), UpperBodyMotion(40, rng)
    pushes.reset(everyone, 1.0, calm)
    motion.reset(everyone, 1.0, calm)
    hard = Difficulty(amplitude=1.0, speed=1.0, push=1.0)
    facing, pushed, fastest = np.tile(np.eye(2), (40, 1, 1)), np.zeros(40, dtype=bool), np.zeros(40)
    for _ in range(500):
        before = motion.target.copy()
        motion.step(hard, 0.02)
        motion.steer(everyone[:20], np.full((20, 15), 9.0), hard, 0.02)
        pushes.step(1.0, facing, 0.02)
        pushed |= pushes.force.any(axis=1)
        fastest = np.maximum(fastest, np.abs(motion.target - before).max(axis=1) / 0.02)
    assert not pushed[calm].any() and pushed[~calm].all()
    assert fastest[calm].max() < 2.01 * GENTLE < fastest[~calm].min()


def test_pushes_go_straight_more_often_than_not_whichever_way_the_robot_looks() -> None:
    pushes = RandomPushes(2000, 50.0, QUARTERS, np.random.default_rng(0))
    facing = np.tile([[0.0, -1.0], [1.0, 0.0]], (2000, 1, 1))  # along the world's y
    pushes.reset(np.arange(2000), 1.0, np.zeros(2000, dtype=bool))
    ahead = np.zeros(2000)
    for _ in range(1600):
        pushes.step(1.0, facing, 0.005)
        force = np.linalg.norm(pushes.force, axis=1)
        ahead = np.where(force > 1.0, pushes.force[:, 1] / np.maximum(force, 1.0), ahead)
    # Besides the straight ones, 0.3 / pi of the others are within 0.3 rad of each of the four directions.
    front, left, back, right = STRAIGHT * np.array(QUARTERS) + (1.0 - STRAIGHT) * 0.3 / np.pi
    assert abs((np.abs(ahead) < np.sin(0.3)).mean() - left - right) < 0.05
    assert abs((ahead < -np.cos(0.3)).mean() - back) < 0.05
    assert abs((ahead > np.cos(0.3)).mean() - front) < 0.05


def test_a_robot_that_was_pushed_is_known_as_such_until_its_episode_is_over() -> None:
    pushes, facing = RandomPushes(2, 50.0, QUARTERS, np.random.default_rng(0)), np.tile(np.eye(2), (2, 1, 1))
    pushes.reset(np.arange(2), 1.0, np.array([False, True]))
    assert np.isinf(pushes.since).all()
    pushes.once(np.array([[100.0, 0.0], [0.0, 0.0]]), 0.2, start=0.1)
    for _ in range(50):
        pushes.step(1.0, facing, 0.02)
    assert pushes.since[0] == pytest.approx(0.9, abs=0.03) and np.isinf(pushes.since[1])
    pushes.reset(np.arange(2), 1.0, np.ones(2, dtype=bool))
    assert np.isinf(pushes.since).all()


def test_pushes_have_the_impulse_they_were_drawn_with_at_most() -> None:
    pushes = RandomPushes(200, 50.0, QUARTERS, np.random.default_rng(0))
    facing = np.tile([[0.0, -1.0], [1.0, 0.0]], (200, 1, 1))
    pushes.reset(np.arange(200), 1.0, np.zeros(200, dtype=bool))
    impulse, largest = np.zeros((200, 2)), np.zeros(200)
    for _ in range(2000):
        pushes.step(1.0, facing, 0.005)
        quiet = ~pushes.force.any(axis=1)
        impulse[quiet] = 0.0
        impulse += pushes.force[:, :2] * 0.005
        largest = np.maximum(largest, np.linalg.norm(impulse, axis=1))
    assert 40.0 < largest.max() < 52.0


@pytest.mark.parametrize(("task", "told"), [("stand", False), ("walk", True)])
def test_who_learns_to_stand_is_never_told_to_walk(task: Task, told: bool) -> None:
    env = LegsEnv(20, TASKS[task], 0, 1)
    walked = False
    for _ in range(400):
        step = env.step(np.zeros((20, 12)), np.zeros(0, dtype=np.intp), np.zeros((0, 15)))
        walked |= bool(env.walking.any())
        assert ((step.reward < 0.0) == step.ended).all()  # a fall costs more than any reward
        env.restart(np.flatnonzero(step.ended | step.truncated))
    assert walked == told
