"""The real hands' driver on a domain, in simulated time: a stack drives servos that speak bytes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import pytest
from tests.hardware.drivers.simulated_ax12 import SimulatedAx12, SimulatedBus

from golem.hardware.drivers.magpie_servos import MagpieServoConfig, MagpieServos
from golem.interfaces import public, ros_convert
from golem.middleware.dds.local import LocalDomain
from golem.middleware.ros.msgs.rosgraph_msgs import Clock
from golem.middleware.ros.node import RosNode
from golem.runtime.live.device_process import DriverPlace, HandProcess
from golem.types import SIDES, TICK, HandCommand, HandState, Side

ROBOT_TIME = 50.0
"""What the robot's clock shows when ours shows 1000 s."""


@dataclass
class Rig:
    """Both hands, their driver, and a stack that hears and commands them."""

    buses: dict[Side, SimulatedBus] = field(
        default_factory=lambda: {
            side: SimulatedBus({1: SimulatedAx12(1, 400.0), 2: SimulatedAx12(2, 900.0)}) for side in SIDES
        }
    )
    now: float = 1000.0
    ticking: bool = True
    told: list[str] = field(default_factory=list)
    heard: dict[Side, list[HandState]] = field(default_factory=lambda: {side: [] for side in SIDES})

    def __post_init__(self) -> None:
        domain = LocalDomain()
        here, there = domain.participant(), domain.participant()
        self.stack = RosNode(there, "stack")
        self.drivers: dict[Side, MagpieServos] = {
            side: MagpieServos(MagpieServoConfig(bus.line.name), bus.connect) for side, bus in self.buses.items()
        }
        node = RosNode(here, "hands")
        self.process = HandProcess(DriverPlace(here, node, lambda: self.now, self.told.append), self.drivers)
        row = public.topic("/clock")
        self.clock = self.stack.publisher(row.name, row.type, row.qos)
        self.commands = {}
        for side in SIDES:
            state, command = (public.topic(public.gripper(side, what)) for what in ("state", "command"))
            self.commands[side] = self.stack.publisher(command.name, command.type, command.qos)
            self.stack.subscription(
                state.name, state.type, lambda m, s=side: self.heard[s].append(ros_convert.to_hand_state(m)), state.qos
            )

    def command(self, side: Side, gap: float, force: float) -> None:
        self.commands[side].publish(ros_convert.hand_command(HandCommand(0.0, gap, force), side))

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / TICK)):
            self.now += TICK
            if self.ticking:
                self.clock.publish(Clock(ros_convert.time(self.now - 1000.0 + ROBOT_TIME)))
            self.process.step()
            for bus in self.buses.values():
                bus.step(self.now, TICK)
            self.stack.poll()


@pytest.fixture
def rig() -> Iterator[Rig]:
    rig = Rig()
    yield rig
    for side in SIDES:
        rig.drivers[side].close()
        rig.buses[side].line.close()


def test_reports_bear_the_robots_time(rig: Rig) -> None:
    rig.run(1.0)
    for side in SIDES:
        assert 90 <= len(rig.heard[side]) <= 101
        assert rig.heard[side][-1].t == pytest.approx(ROBOT_TIME + 1.0, abs=0.012)
    assert rig.told == []


def test_without_the_robots_time_nothing_is_reported(rig: Rig) -> None:
    rig.ticking = False
    rig.run(0.5)
    assert rig.heard == {"left": [], "right": []}


def test_each_hand_obeys_its_own_commands(rig: Rig) -> None:
    rig.command("left", 0.03, 4.0)
    rig.command("right", 0.08, 4.0)
    rig.run(2.0)
    assert rig.heard["left"][-1].gap == pytest.approx(0.03, abs=5e-4)
    assert rig.heard["right"][-1].gap == pytest.approx(0.08, abs=5e-4)


def test_a_hand_that_fails_is_named_and_fails_alone(rig: Rig) -> None:
    rig.run(0.2)
    rig.buses["left"].servos[2].dead = True
    rig.run(0.5)
    port = rig.buses["left"].line.name
    assert rig.told == [f"left hand: Servo 2 on {port} does not answer."]
    assert rig.heard["left"][-1].t < ROBOT_TIME + 0.25
    assert rig.heard["right"][-1].t == pytest.approx(ROBOT_TIME + 0.7, abs=0.012)
    rig.buses["left"].servos[2].dead = False
    rig.run(0.1)
    assert rig.told[1:] == ["left hand: it works again."]
    assert rig.heard["left"][-1].t == pytest.approx(ROBOT_TIME + 0.8, abs=0.012)
