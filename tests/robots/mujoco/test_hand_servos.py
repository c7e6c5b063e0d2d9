"""The finger servos: they reach a gap at their speed, and press with no more than their ceiling."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from golem.robots.model import magpie_model
from golem.robots.model.mjcf import robot_spec
from golem.robots.mujoco.hand_servos import HandServos
from golem.types import HandCommand, HandState, Side

STEP = 0.0005
TICK = 0.002
WIDTH = 0.010


class Bench:
    """One hand of a robot whose joints are locked, in free fall, with or without a block between the fingers."""

    def __init__(self, side: Side = "right", block: float | None = None, gap: float = 0.06, loose: bool = True) -> None:
        """Put a block of `WIDTH` at `block` [m] off the hand's centre; `loose` along the closing axis, or fixed."""
        spec = robot_spec(hands=True)
        spec.option.gravity = [0.0, 0.0, 0.0]
        for joint in list(spec.joints):
            if not any(word in joint.name for word in ("crank", "finger")):
                for actuator in [a for a in spec.actuators if a.target == joint.name]:
                    spec.delete(actuator)
                spec.delete(joint)
        if block is not None:
            hand = spec.body(f"{side}_hand")
            body = hand.add_body(name="block", pos=[-0.004, block, 0.185])
            if loose:
                body.add_joint(name="block", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 1, 0], damping=0.5)
            body.add_geom(name="block", type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.006, WIDTH / 2, 0.006], mass=0.03)
        self.model = spec.compile()
        self.model.opt.timestep = STEP
        self.model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        self.data = mujoco.MjData(self.model)
        self.servos = HandServos(self.model, side)
        self.servos.reset(self.data, gap)
        mujoco.mj_forward(self.model, self.data)
        self.t = 0.0

    def run(self, gap: float, force: float, seconds: float) -> HandState:
        """Command `gap` and `force` for a while; return the last report."""
        for _ in range(round(seconds / TICK)):
            self.servos.command(HandCommand(self.t, gap, force), TICK)
            for _ in range(round(TICK / STEP)):
                self.servos.drive(self.data)
                mujoco.mj_step(self.model, self.data)
            self.t += TICK
        return self.servos.read(self.data, self.t)

    def pressing(self) -> list[float]:
        """Return the normal forces between the block and the two fingers, largest first [N]."""
        block = self.model.geom("block").id
        forces: dict[int, float] = {}
        for i in range(self.data.ncon):
            contact = self.data.contact[i]
            if block in contact.geom:
                other = int(contact.geom[0] if contact.geom[1] == block else contact.geom[1])
                out = np.zeros(6)
                mujoco.mj_contactForce(self.model, self.data, i, out)
                body = int(self.model.geom_bodyid[other])
                forces[body] = forces.get(body, 0.0) + float(out[0])
        return sorted(forces.values(), reverse=True)


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("gap", [0.0005, 0.02, 0.05, 0.1])
def test_the_fingers_reach_a_commanded_gap(side: Side, gap: float) -> None:
    report = Bench(side).run(gap, 4.0, 1.5)
    assert report.gap == pytest.approx(gap, abs=0.0005)
    assert report.fingers == pytest.approx([gap / 2, gap / 2], abs=0.0005)
    assert report.force.max() < 0.3


def test_they_start_where_they_are_put() -> None:
    bench = Bench(gap=0.03)
    report = bench.servos.read(bench.data, 0.25)
    assert report.t == 0.25
    assert report.gap == pytest.approx(0.03, abs=1e-9)


def test_they_move_no_faster_than_the_servo_turns() -> None:
    bench = Bench(gap=0.10)
    gaps = [bench.run(0.0, 4.0, TICK).gap for _ in range(550)]
    # A pad moves by at most the arm's length per radian; both close.
    fastest = 2 * magpie_model.ARM * magpie_model.MAX_SPEED * TICK
    assert np.abs(np.diff(gaps)).max() < 1.1 * fastest
    closing = next(i for i, gap in enumerate(gaps) if gap < 0.005) * TICK
    assert closing == pytest.approx(
        (magpie_model.CLOSED - float(magpie_model.crank_from_gap(0.1))) / magpie_model.MAX_SPEED, rel=0.15
    )


@pytest.mark.parametrize("force", [2.0, 8.0, 16.0])
def test_they_press_with_the_force_they_are_told(force: float) -> None:
    bench = Bench(block=0.0)
    report = bench.run(0.0, force, 1.5)
    assert report.gap == pytest.approx(WIDTH, abs=0.001)
    assert report.force == pytest.approx([force, force], rel=0.02)
    pressing = bench.pressing()
    assert len(pressing) == 2
    assert pressing == pytest.approx([force, force], rel=0.12)


def test_the_force_never_exceeds_its_ceiling() -> None:
    bench = Bench(block=0.0)
    loads = [bench.run(0.0, 5.0, TICK).force.max() for _ in range(700)]
    assert max(loads) <= 5.0 * (1 + 1e-9)


@pytest.mark.parametrize(("told", "given"), [(1e3, magpie_model.MAX_FORCE), (0.0, magpie_model.MIN_FORCE)])
def test_the_ceiling_is_one_the_servo_has(told: float, given: float) -> None:
    bench = Bench(block=0.0)
    assert bench.run(0.0, told, 2.0).force == pytest.approx([given, given], rel=0.05)


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("off", [-0.005, 0.005])
def test_an_object_fixed_off_centre_is_held_by_both_fingers_alike(side: Side, off: float) -> None:
    bench = Bench(side, block=off, loose=False)
    report = bench.run(0.0, 10.0, 1.5)
    assert report.gap == pytest.approx(WIDTH, abs=0.001)
    assert report.fingers == pytest.approx([WIDTH / 2 + off, WIDTH / 2 - off], abs=0.001)
    assert report.force == pytest.approx([10.0, 10.0], rel=0.02)
    first, second = bench.pressing()
    # The servos press alike; friction on the block takes its share of what arrives where the lever is short.
    assert first == pytest.approx(second, rel=0.15)


def test_an_object_that_can_move_is_centred() -> None:
    report = Bench(block=0.012).run(0.0, 10.0, 1.5)
    assert report.fingers == pytest.approx([WIDTH / 2, WIDTH / 2], abs=0.0005)


def test_they_let_go() -> None:
    bench = Bench(block=0.0)
    bench.run(0.0, 10.0, 1.5)
    report = bench.run(0.05, 4.0, 1.0)
    assert report.gap == pytest.approx(0.05, abs=0.001)
    assert bench.pressing() == []


def test_an_empty_hand_closes() -> None:
    assert Bench().run(0.0, 8.0, 2.0).gap < 0.0005


def test_only_closing_torque_reads_as_force() -> None:
    bench = Bench(gap=0.02)
    loads = [bench.run(0.1, 16.0, TICK).force for _ in range(50)]
    assert np.min(loads) == 0.0
    assert np.max(loads) < 0.5
