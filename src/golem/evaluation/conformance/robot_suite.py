"""What a robot promises: see `golem.robots.base`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np

from golem.capabilities.arms.base import check_pose
from golem.evaluation.conformance.base import Candidate, check
from golem.evaluation.conformance.robot_measures import RobotMeasures
from golem.evaluation.conformance.robot_rig import RobotRig
from golem.evaluation.conformance.suite import Suite, check_fields
from golem.robots.base import Robot
from golem.runtime.contract_check import ContractCheck
from golem.runtime.lockstep import start_posture
from golem.types import NUM_JOINTS, SIDES, TICK, Array, HandCommand, HandState, Imu, LowCommand, Side

TICKS = 25


class RobotInput(NamedTuple):
    """The commands that a robot gets for one tick."""

    command: LowCommand
    hands: dict[Side, HandCommand]


class RobotAnswer(NamedTuple):
    """What it reports afterwards."""

    joints: tuple[Array, Array, Array]
    imu: Imu
    hands: list[HandState]


class RobotSuite(RobotMeasures, Suite):
    """Inputs are commands, answers reports. A robot is no passive module: clock and threads are its own business."""

    slot, contracts, forgets, refuses_nan = "robot", (Robot,), False, False

    @contextmanager
    def rig(self, candidate: Candidate) -> Iterator[RobotRig]:
        """Return a new robot, at home."""
        robot = candidate.contract.call(candidate.make)
        try:
            yield RobotRig(robot, start_posture())
        finally:
            robot.close()

    def context(self) -> Mapping[str, object]:
        """Return the episode."""
        return {"profile": "ideal", "seed": 0, "posture": start_posture()}

    def declared(self, contract: ContractCheck, module: Any) -> None:
        """Check cameras and calibration."""
        if set(module.cameras) != set(module.calibration):
            raise contract.fault("cameras and calibration do not have the same names")
        for name, pose in module.calibration.items():
            contract.array(f"calibration of {name}", pose, 4, 4)
            contract.call(check_pose, f"calibration of {name}", pose)

    def inputs(self) -> Sequence[RobotInput]:
        """Return commands to stay, and to close the hands."""
        zero, posture = np.zeros(NUM_JOINTS), start_posture()
        stiff, damping = np.full(NUM_JOINTS, 100.0), np.full(NUM_JOINTS, 3.0)
        return [
            RobotInput(
                LowCommand(TICK * i, posture, zero, zero, stiff, damping),
                {side: HandCommand(TICK * i, 0.05, 4.0) for side in SIDES},
            )
            for i in range(TICKS)
        ]

    def edges(self) -> Mapping[str, Sequence[RobotInput]]:
        """Return limp motors, and hands without a command."""
        zero = np.zeros(NUM_JOINTS)
        limp = [RobotInput(LowCommand(TICK * i, zero, zero, zero, zero, zero), {}) for i in range(TICKS)]
        return {"limp motors and hands without a command": limp}

    def call(self, module: Robot, given: RobotInput) -> RobotAnswer:
        """Let a tick pass; return what the robot reports."""
        module.advance(given.command, given.hands, TICK)
        hands = [module.hand(side, given.command.t) for side in SIDES]
        return RobotAnswer(module.joints(), module.imu(), hands)

    def judge(self, contract: ContractCheck, answer: RobotAnswer) -> None:
        for name, values in zip(("q", "dq", "tau"), answer.joints, strict=True):
            contract.array(name, values, NUM_JOINTS)
        contract.kind("the IMU's sample", answer.imu, Imu)
        check_fields(contract, answer.imu, quat=(4,), gyro=(3,), acc=(3,))
        for hand in answer.hands:
            contract.kind("the hand's report", hand, HandState)
            check_fields(contract, hand, gap=(), fingers=(2,), force=(2,))

    @check
    def attitude_is_a_rotation(self, candidate: Candidate) -> None:
        """The quaternion of the IMU has length one."""
        for answer in self.answers_of(candidate):
            length = float(np.linalg.norm(answer.imu.quat))
            if abs(length - 1.0) > 1e-3:
                raise candidate.fault(f"the IMU's quaternion has length {length:.4g}")

    @check
    def stamps_its_hands(self, candidate: Candidate) -> None:
        """The report of a hand carries the time it was asked for."""
        for given, answer in zip(self.inputs(), self.answers_of(candidate), strict=True):
            if any(hand.t != given.command.t for hand in answer.hands):
                raise candidate.fault("the report of a hand carries another time than it was asked for")

    @check
    def cameras_see(self, candidate: Candidate) -> None:
        """Every camera gives images of its size: colour, and finite depth that is never negative."""
        robot, contract = candidate.make(), candidate.contract
        for name, info in robot.cameras.items():
            rgb, depth = contract.call(robot.capture, name)
            contract.array(f"the image of {name}", rgb, info.height, info.width, 3)
            contract.array(f"the depth of {name}", depth, info.height, info.width)
            if rgb.dtype != np.uint8 or depth.dtype != np.float32 or depth.min() < 0.0:
                raise candidate.fault(
                    f"{name} gives {rgb.dtype} and {depth.dtype} down to {depth.min():g} m; the contract asks for "
                    "uint8 and float32 from 0 m"
                )
        contract.call(robot.close)

    @check
    def closes_twice(self, candidate: Candidate) -> None:
        """Closing it twice does nothing."""
        robot = candidate.make()
        candidate.contract.call(robot.close)
        candidate.contract.call(robot.close)

    def stale(self) -> Sequence[RobotInput]:
        """Return a command that comes again and again."""
        return [self.inputs()[0]] * 8
