"""The compiled kernel against plain arithmetic: yes or no, distances, gradients, shapes, clouds, held objects."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import pytest

from golem.capabilities.arms.postures import posture
from golem.capabilities.collision.collision_model import CollisionModel
from golem.capabilities.collision.obstacles import Obstacle, World, cloud_grid
from golem.capabilities.collision.sphere_robot import Packing, SphereRobot, holding, load_spheres
from golem.errors import ConfigError
from golem.evaluation.spheres.pack_robot import sample_postures
from golem.evaluation.spheres.packing_report import spheres_collide
from golem.robots.model.pinocchio_model import Kinematics
from golem.robots.model.table import JOINT_NAMES
from golem.types import NUM_JOINTS, UPPER, Array


@pytest.fixture(scope="module")
def robot() -> SphereRobot:
    return load_spheres()


@pytest.fixture(scope="module")
def whole(robot: SphereRobot) -> CollisionModel:
    return CollisionModel(robot)


@pytest.fixture(scope="module")
def upper(robot: SphereRobot) -> CollisionModel:
    return CollisionModel(robot, JOINT_NAMES[UPPER])


def numeric(distance: Callable[[Array], float], q: Array) -> Array:
    e = 1e-6 * np.eye(len(q))
    return np.array([(distance(q + d) - distance(q - d)) / 2e-6 for d in e])


def test_spheres_move_as_the_links_do(robot: SphereRobot, whole: CollisionModel) -> None:
    q = np.random.default_rng(0).uniform(-0.5, 0.5, NUM_JOINTS)
    kinematics = Kinematics()
    kinematics.update(q)
    placed = whole.placed(q)
    for name in ("left_hand", "right_elbow_link", "left_knee_link", "torso_link"):
        link = [x.name for x in robot.links].index(name)
        T = kinematics.pose(name)
        wanted = robot.packings[link].centres @ T[:3, :3].T + T[:3, 3]
        own = placed[whole.sphere_link == link, :3]
        gaps = np.linalg.norm(wanted[:, None] - own, axis=2).min(axis=1)
        assert len(own) == len(wanted) and gaps.max() < 1e-6


def test_the_kernel_agrees_with_plain_arithmetic(robot: SphereRobot, whole: CollisionModel) -> None:
    postures = sample_postures(robot.links, 200, seed=3)
    plain = np.array([spheres_collide(robot, q) for q in postures])
    assert 20 < plain.sum() < 190
    assert [whole.collides(q) for q in postures] == plain.tolist()
    assert whole.collides_each(postures).tolist() == plain.tolist()


def test_distances_are_those_of_spheres_and_their_gradients_those_of_differences(upper: CollisionModel) -> None:
    checked = 0
    for q in np.random.default_rng(1).uniform(-0.4, 0.4, (10, 15)):
        near = upper.nearest(q, most=5, cutoff=0.15)
        assert (np.diff(near.distance) >= 0.0).all() and (near.distance < 0.15).all()
        assert upper.collides(q) == bool(near.distance[0] <= 0.0)
        for distance, gradient, (a, b) in zip(near.distance, near.gradient, near.spheres, strict=True):

            def gap(x: Array, a: int = a, b: int = b) -> float:
                p = upper.placed(x)
                return float(np.linalg.norm(p[a, :3] - p[b, :3]) - p[a, 3] - p[b, 3])

            pair = {int(upper.sphere_link[a]), int(upper.sphere_link[b])}
            (depth,) = [d for p, d in zip(upper.robot.pairs, upper.robot.allowed, strict=True) if set(p) == pair]
            assert distance == pytest.approx(gap(q) + depth, abs=1e-12)
            assert gradient == pytest.approx(numeric(gap, q), abs=1e-7)
            checked += 1
    assert checked > 20


def test_shapes_have_the_distances_of_their_definitions() -> None:
    T = np.eye(4)
    T[:3, 3] = (0.5, 0.0, 0.0)
    ball = np.array([[0.0, 0.0, 0.3, 0.05]])
    for obstacle, wanted in (
        (Obstacle("box", T, (0.1, 0.2, 0.1)), np.hypot(0.4, 0.2)),
        (Obstacle("cylinder", T, (0.1, 0.1)), np.hypot(0.4, 0.2)),
        (Obstacle("sphere", T, (0.1,)), np.hypot(0.5, 0.3) - 0.1),
        (Obstacle("half_space", T), 0.3),
    ):
        distance, direction = World([obstacle]).distance(ball, cutoff=1.0)
        assert distance[0] == pytest.approx(wanted - 0.05)
        assert np.linalg.norm(direction[0]) == pytest.approx(1.0)
    inside = np.array([[0.45, 0.0, 0.0, 0.0]])
    assert World([Obstacle("box", T, (0.1, 0.2, 0.1))]).distance(inside)[0][0] == pytest.approx(-0.05)
    assert World([Obstacle("cylinder", T, (0.1, 0.2))]).distance(inside)[0][0] == pytest.approx(-0.05)
    assert World().distance(inside)[0][0] == 0.2


def test_the_world_is_seen_with_its_gradient(upper: CollisionModel) -> None:
    q = np.zeros(15)
    hand = upper.placed(q)[upper.sphere_body == 8][0]
    T = np.eye(4)
    T[:3, 3] = hand[:3] + (0.0, 0.0, -0.2)
    world = World([Obstacle("box", T, (0.1, 0.1, 0.05)), Obstacle("half_space", np.diag([1.0, 1.0, 1.0, 1.0]))])
    near = upper.nearest_world(q, world, most=6, cutoff=0.3)
    assert len(near.distance) > 2
    for distance, gradient, (i,) in zip(near.distance, near.gradient, near.spheres, strict=True):

        def gap(x: Array, i: int = i) -> float:
            return float(world.distance(upper.placed(x)[i : i + 1], cutoff=1.0)[0][0])

        assert distance == pytest.approx(gap(q), abs=1e-12)
        assert gradient == pytest.approx(numeric(gap, q), abs=1e-6)
    assert upper.collides(q, world=world) == bool(near.distance[0] <= 0.0 or upper.collides(q))


def test_a_cloud_holds_every_point_and_nothing_far_from_one() -> None:
    rng = np.random.default_rng(2)
    points = rng.uniform((0.2, -0.5, -0.2), (0.8, 0.5, 0.4), (3000, 3))
    world = World(cloud=cloud_grid(points))
    balls = np.column_stack([rng.uniform((-0.9, -1.4, -1.2), (1.6, 1.4, 1.6), (2000, 3)), np.full(2000, 0.04)])
    distance, _ = world.distance(balls, cutoff=0.3)
    truth = np.linalg.norm(balls[:, None, :3] - points, axis=2).min(axis=1) - 0.04
    near = truth < 0.3
    assert (distance[near] <= truth[near] + 1e-9).all()
    assert (distance >= np.minimum(truth, 0.3) - 0.035).all()
    assert World(cloud=cloud_grid(points[:0])).distance(balls)[0].min() == 0.2


def test_a_cloud_is_cut_to_what_is_finite_and_in_reach() -> None:
    points = np.array([[0.5, 0.0, 0.0], [np.nan, 0.0, 0.0], [0.5, np.inf, 0.0], [9.0, 0.0, 0.0]])
    grid = cloud_grid(points)
    assert (len(grid.balls), grid.dropped) == (1, 3)
    with pytest.raises(ConfigError, match=r"an \(n, 3\) array of points"):
        cloud_grid(np.zeros((4, 2)))


def test_ten_million_points_take_no_time_to_speak_of() -> None:
    points = np.random.default_rng(0).uniform(-1.0, 1.0, (10_000_000, 3)).astype(np.float32)
    cloud_grid(points[:10])
    start = time.thread_time()
    grid = cloud_grid(points)
    assert time.thread_time() - start < 5.0
    assert grid.balls[:, 3].max() < 0.035


def test_what_a_hand_holds_collides(robot: SphereRobot, upper: CollisionModel) -> None:
    q = posture("ready")
    placed = upper.placed(q)
    hands = ([x.name for x in robot.links].index("right_hand"), [x.name for x in robot.links].index("left_hand"))
    own, other = (placed[upper.sphere_link == link] for link in hands)
    kinematics = Kinematics()
    whole_q = np.zeros(NUM_JOINTS)
    whole_q[UPPER] = q
    kinematics.update(whole_q)
    T_base_hand = kinematics.pose("right_hand")
    rod = Packing((other[:1, :3] - T_base_hand[:3, 3]) @ T_base_hand[:3, :3], np.array([0.02]))
    longer = CollisionModel(holding(robot, "right_hand", rod), JOINT_NAMES[UPPER])
    assert len(own) and not upper.collides(q) and longer.collides(q)
    with pytest.raises(ConfigError, match="Unknown link 'right_hant'.*Did you mean 'right_hand'"):
        holding(robot, "right_hant", rod)


def test_bad_obstacles_and_joints_are_refused(robot: SphereRobot) -> None:
    with pytest.raises(ConfigError, match="A box has 3 positive sizes"):
        Obstacle("box", np.eye(4), (0.1, 0.1))
    with pytest.raises(ConfigError, match="finite 4x4"):
        Obstacle("sphere", np.full((4, 4), np.nan), (0.1,))
    with pytest.raises(ConfigError, match="Unknown joint 'torso'"):
        CollisionModel(robot, ["torso"])
