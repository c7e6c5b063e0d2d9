"""The robot's two nodes: what it reports, and how its time passes under a command."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from golem.interfaces import topics
from golem.middleware.bus import Bus
from golem.native import CompiledStage
from golem.robots.base import HasStages, Robot
from golem.runtime.chain import HasLink, Link
from golem.runtime.contract_check import ContractCheck
from golem.types import COMMAND_AGE, NUM_JOINTS, SIDES, TICK, Array, HandCommand, LowCommand, LowState, Side


class SenseNode(HasLink):
    """Publishes what motors, IMU and hands report."""

    period = TICK

    def __init__(self, bus: Bus, robot: Robot, contract: ContractCheck, offset: Array | None = None) -> None:
        """Read `robot`, whose joints report `offset` (27,) more than they are [rad]; None believes them."""
        self._bus, self._robot, self._contract, self._offset = bus, robot, contract, offset
        self._keep = robot.keep_moment if isinstance(robot, HasStages) else None

    def link(self) -> Link | None:
        stages = _stages(self._robot, self._offset)
        if stages is None:
            return None
        return Link(self, stages[0], (), (topics.LOW_STATE, *map(topics.hand_state, SIDES)))

    def step(self, t: float) -> None:
        call = self._contract.call
        q, dq, tau = call(self._robot.joints)
        q = q if self._offset is None else q - self._offset
        self._bus.publish(topics.LOW_STATE, LowState(t, q, dq, tau, call(self._robot.imu)), t)
        for side in SIDES:
            self._bus.publish(topics.hand_state(side), call(self._robot.hand, side, t), t)
        if self._keep is not None:
            self._keep(t)


class ActNode(HasLink):
    """Lets time pass under the newest command that left the safety gate."""

    period = TICK

    def __init__(self, bus: Bus, robot: Robot, contract: ContractCheck, offset: Array | None = None) -> None:
        """Drive `robot`; `offset` as for `SenseNode`."""
        self._bus, self._robot, self._contract, self._offset = bus, robot, contract, offset
        self._taken: dict[Side, HandCommand] = {}

    def link(self) -> Link | None:
        robot = self._robot
        stages = _stages(robot, self._offset)
        if stages is None or not isinstance(robot, HasStages):
            return None

        def prepare(t: float) -> bool:
            for side in SIDES:
                hand = self._bus.latest(topics.hand_command(side))
                if hand is not None and hand is not self._taken.get(side):
                    self._taken[side] = hand
                    robot.take_hand_command(side, hand)
            return True

        return Link(self, stages[1], (topics.LOW_CMD,), (), prepare)

    def step(self, t: float) -> None:
        """Advance the robot by one tick; motors without a command of late are limp."""
        command = self._bus.latest(topics.LOW_CMD)
        if command is None or t - command.t > COMMAND_AGE:
            zero = np.zeros(NUM_JOINTS)
            command = LowCommand(t, zero, zero, zero, zero, zero)
        if self._offset is not None:
            command = replace(command, q=command.q + self._offset)
        hands: dict[Side, HandCommand] = {}
        for side in SIDES:
            hand = self._bus.latest(topics.hand_command(side))
            if hand is not None:
                hands[side] = hand
        self._contract.call(self._robot.advance, command, hands, TICK)


def _stages(robot: Robot, offset: Array | None) -> tuple[CompiledStage, CompiledStage] | None:
    return robot.native(offset) if isinstance(robot, HasStages) else None
