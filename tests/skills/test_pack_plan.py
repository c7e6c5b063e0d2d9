"""Plans of stops around a pack: what they cover, how quick they are made, and how far from the best there is."""

from __future__ import annotations

import itertools
import time

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import Bounds, LinearConstraint, milp

from golem.skills.fastener_list import Listed
from golem.skills.job_file import PackFastener
from golem.skills.pack_plan import DOCKING, PackSides, choose, make_plan, way
from golem.types import Array, PlanarPose

START = PlanarPose(-1.2, 0.0, 0.0)
RIM = 0.0


def pack(seed: int) -> list[PackFastener]:
    """Return 84 fasteners like those of a real pack: pitches from 25 to 115 mm, screws and nuts, two levels."""
    rng = np.random.default_rng(seed)
    along, x = np.sort(rng.uniform(-1.04, 1.04, 50)), np.sort(rng.uniform(0.05, 1.2, 34))
    near = [(0.022, y) for y in along[::2]] + [(1.27, y) for y in along[1::2]]
    spots = near + [(u, 1.06 if k % 2 else -1.06) for k, u in enumerate(x)]
    kinds = rng.choice(["screw", "nut"], len(spots), p=[0.65, 0.35])
    rows = zip(spots, kinds, rng.random(len(spots)) < 0.14, strict=True)
    return [
        PackFastener(k, Listed(f"{k}", str(kind), x, y, -0.065 * low)) for k, ((x, y), kind, low) in enumerate(rows)
    ]


def trays(n: int) -> dict[str, Array]:
    """Return places of trays all round."""
    y = np.linspace(-0.9, 0.9, n)
    spots = [(x, v, 0.01) for x in (0.15, 1.14) for v in y] + [(0.65, v, 0.01) for v in (-0.95, 0.95)]
    return dict.fromkeys(("screw", "nut"), np.array(spots))


def test_a_plan_covers_what_can_be_covered_once_each_and_is_made_in_two_seconds() -> None:
    ones = pack(0)
    sides = PackSides(np.array([one.place for one in ones]))
    make_plan(sides, ones[:1], {}, START, [RIM])  # reads the map of reach
    begin = time.process_time()
    plan = make_plan(sides, ones, trays(4), START, [RIM])
    assert time.process_time() - begin < 2.0
    taken = [number for stop in plan for number, _ in stop.picks]
    assert len(set(taken)) == len(taken) > 75
    assert plan == make_plan(sides, ones, trays(4), START, [RIM])
    for stop in plan:
        for number, side in stop.picks:
            local = stop.pose.to(PlanarPose(ones[number].listed.x, ones[number].listed.y, 0.0))
            assert 0.1 < local.x < 0.9 and (local.y if side == "left" else -local.y) > -0.2


def test_a_stance_that_failed_and_what_is_near_the_gantry_are_left_out() -> None:
    ones = pack(1)
    sides = PackSides(np.array([one.place for one in ones]))
    plan = make_plan(sides, ones, {}, START, [RIM])
    number, side = plan[0].picks[0]
    ones[number].barred = [(plan[0].pose, "left"), (plan[0].pose, "right")]
    again = [stop for stop in make_plan(sides, ones, {}, START, [RIM]) if number in dict(stop.picks)]
    assert again and np.hypot(again[0].pose.x - plan[0].pose.x, again[0].pose.y - plan[0].pose.y) > 0.1
    gantry = np.array([0.6, 0.9])
    off = make_plan(sides, ones, {}, START, [RIM], (gantry, 1.0))
    assert all(np.hypot(stop.pose.x - 0.6, stop.pose.y - 0.9) > 1.0 for stop in off)
    taken = [number for stop in off for number, _ in stop.picks]
    assert taken and all(np.hypot(*(ones[k].place[:2] - gantry)) > 1.0 for k in taken)


@pytest.mark.parametrize("rim", [-0.35, -0.15])
def test_what_has_no_other_stance_is_tried_from_the_same_once_more(rim: float) -> None:
    ones = pack(0)
    sides = PackSides(np.array([one.place for one in ones]))
    few = trays(2)
    before = make_plan(sides, ones, few, START, [rim])
    for stop in before:
        for number, side in stop.picks:
            ones[number].barred = [(stop.pose, side)]
    again = {number for stop in make_plan(sides, ones, few, START, [rim]) for number, _ in stop.picks}
    assert {number for stop in before for number, _ in stop.picks} <= again


def test_a_list_of_one_edge_is_worked_on_from_that_edge() -> None:
    ones = [
        PackFastener(k, Listed(f"{k}", "screw", 0.022, y, 0.0))
        for k, y in enumerate(np.linspace(-0.5, 0.5, 9).tolist())
    ]
    plan = make_plan(PackSides(np.array([one.place for one in ones])), ones, {}, START, [RIM])
    assert sum(len(stop.picks) for stop in plan) == 9 and all(stop.pose.x < -0.3 for stop in plan)


def test_the_way_round_turns_once_and_leaves_out_the_largest_gap() -> None:
    length, order = way(np.array([1.0, 9.0, 2.0]), 0.0, 10.0)
    assert length == pytest.approx(4.0) and order.tolist() == [1, 0, 2]
    length, order = way(np.array([1.0, 4.0, 7.0, 9.9]), 0.0, 10.0)
    assert length == pytest.approx(7.2) and order.tolist() == [3, 0, 1, 2]


def exact(served: NDArray[np.bool_], ring: Array, start: float, length: float) -> float:
    """Return a bound, at most 2 % too low, of the least way and dockings [m].

    It is that of a mixed-integer program, one for either arm of the way being gone twice.
    """
    served = served[:, served.any(axis=0)]
    for k in range(len(served)):  # of stances at one place on the ring, one that serves no more is of no use
        if any(ring[j] == ring[k] and j != k and (served[j] >= served[k]).all() for j in range(len(served))):
            served[k] = False
    ring, served = ring[served.any(axis=1)], served[served.any(axis=1)]
    ahead, count = (ring - start) % length, len(ring)
    found: list[float] = []
    for twice in ((2.0, 1.0), (1.0, 2.0)):
        # Variables: stops reached forth, stops reached back, both arms.
        cost = np.concatenate([np.full(2 * count, DOCKING), twice])
        cover = np.hstack([served.T, served.T, np.zeros((served.shape[1], 2))])
        forth = np.hstack([-np.diag(ahead), np.zeros((count, count)), np.tile((1.0, 0.0), (count, 1))])
        back = np.hstack([np.zeros((count, count)), -np.diag(length - ahead), np.tile((0.0, 1.0), (count, 1))])
        solved = milp(
            cost,
            constraints=[LinearConstraint(cover, lb=1.0), LinearConstraint(np.vstack([forth, back]), lb=0.0)],
            integrality=np.concatenate([np.ones(2 * count), np.zeros(2)]),
            bounds=Bounds(0.0, np.append(np.ones(2 * count), (length, length))),  # pyright: ignore[reportArgumentType]
            options={"mip_rel_gap": 0.02},
        )
        assert solved.success, solved.message
        found.append(float(solved.mip_dual_bound))
    return min(found)


@pytest.mark.slow
@pytest.mark.parametrize("packs", [3, pytest.param(20, marks=pytest.mark.long)])
def test_plans_are_within_15_percent_of_the_best(packs: int) -> None:
    over: list[float] = []
    for seed in range(packs):
        ones = pack(seed)
        sides = PackSides(np.array([one.place for one in ones]))
        start = sides.ring(START)
        seen: list[tuple[NDArray[np.bool_], Array]] = []

        def kept(served: NDArray[np.bool_], best: Array, ring: Array, at: float, length: float) -> list[int]:
            seen.append((served, ring))  # noqa: B023
            return choose(served, best, ring, at, length)

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("golem.skills.pack_plan.choose", kept)
            plan = make_plan(sides, ones, trays(4), START, [RIM])
        [(served, ring)] = seen
        least = exact(served, ring, start, sides.length)
        over.append((DOCKING * len(plan) + sum(stop.way for stop in plan)) / least - 1.0)
    assert max(over) <= 0.15, np.round(over, 3)
    assert min(over) >= -1e-6, "the exact solver is not"
    print(np.round(over, 3))


def test_at_a_stop_what_is_said_to_be_loose_comes_first_and_one_height_after_the_other() -> None:
    levels, loose = [0.0, -0.13] * 5, [True] * 8 + [False] * 2
    ones = [PackFastener(k, Listed(f"{k}", "screw", 0.03, 0.035 * k - 0.35, z, loose[k])) for k, z in enumerate(levels)]
    sides = PackSides(np.array([one.place for one in pack(0)]))
    stops = make_plan(sides, ones, {}, START, [-0.17, -0.11, -0.05, 0.01])
    for stop in stops:
        taken = [ones[number] for number, _ in stop.picks]
        doubtful = [one.listed.loose is False for one in taken]
        assert doubtful == sorted(doubtful)
        of_loose = [one.listed.z for one in taken if one.listed.loose]
        assert sum(a != b for a, b in itertools.pairwise(of_loose)) <= 1
    assert sum(len(stop.picks) for stop in stops) == len(ones)
