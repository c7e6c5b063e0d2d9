"""`golem drivers hands`: the real MAGPIE hands on a domain, in the twin's place."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack, closing
from dataclasses import dataclass, field, replace
from functools import partial

from tyro.conf import OmitArgPrefixes

from golem.errors import ConfigError
from golem.hardware.drivers.magpie_servos import HandFault, MagpieServoConfig, MagpieServos
from golem.interfaces import public
from golem.middleware.dds.base import Participant
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.interrupt import interrupted
from golem.middleware.ros.node import RosNode
from golem.runtime.live.node_setup import AsyncLogger, log_line, member
from golem.runtime.live.robot_time import RobotTime
from golem.runtime.live.role_endpoints import RoleEndpoints
from golem.types import TICK, HandCommand, Side


@dataclass(frozen=True)
class HandsConfig:
    """Drive the MAGPIE hands whose ports are named, until Ctrl-C; they keep what they hold."""

    left: MagpieServoConfig = field(default_factory=MagpieServoConfig)
    """The left hand."""
    right: MagpieServoConfig = field(default_factory=MagpieServoConfig)
    """The right hand."""
    dds: OmitArgPrefixes[DdsConfig] = field(default_factory=DdsConfig)


class HandProcess:
    """The hands without their loop. One that fails is named once, and reports nothing until it works again."""

    def __init__(
        self,
        participant: Participant,
        node: RosNode,
        hands: Mapping[Side, MagpieServos],
        clock: Callable[[], float] = time.monotonic,
        tell: Callable[[str], None] = log_line,
    ) -> None:
        """Take commands for `hands` and send their reports, stamped with the robot's time.

        Args:
            participant: member of the domain.
            node: its ROS node.
            hands: the drivers.
            clock: this process's own [s].
            tell: says a line to a person.
        """
        self._hands, self._clock, self._tell = hands, clock, tell
        self._faults: dict[Side, str] = dict.fromkeys(hands, "")
        self._robot_time = RobotTime(node, clock)
        states = {public.gripper(side, "state") for side in hands}
        self._endpoints = RoleEndpoints("robot", participant, node, states)
        for side in hands:
            self._endpoints.listen(public.gripper(side, "command"), partial(self._command, side))

    def step(self) -> None:
        """Take what has come, and exchange what there is to exchange with each hand."""
        now = self._clock()
        self._endpoints.step(now)
        for side, hand in self._hands.items():
            try:
                report = hand.step(now)
            except HandFault as fault:
                self._say(side, str(fault))
                continue
            if report is None:
                continue
            self._say(side, "")
            t = self._robot_time.at(report.t)
            if t is not None:
                self._endpoints.send(public.gripper(side, "state"), replace(report, t=t))

    def _command(self, side: Side, command: HandCommand) -> None:
        self._hands[side].command(command)

    def _say(self, side: Side, fault: str) -> None:
        if fault != self._faults[side]:
            self._faults[side] = fault
            self._tell(f"{side} hand: {fault or 'it works again.'}")


def run_hands(config: HandsConfig) -> None:
    """Drive the hands until Ctrl-C.

    Raises:
        ConfigError: no port is named.
        MissingExtra, PortError: a port cannot be opened.
        DdsError: the domain cannot be joined.
    """
    sides: dict[Side, MagpieServoConfig] = {"left": config.left, "right": config.right}
    if not any(hand.port for hand in sides.values()):
        raise ConfigError("Name the port of a hand: --left.port /dev/ttyUSB0, --right.port /dev/ttyUSB1.")
    with (
        interrupted() as stop,
        closing(AsyncLogger()) as tell,
        ExitStack() as ports,
        member("hands", config.dds, tell) as (participant, node),
    ):
        hands: dict[Side, MagpieServos] = {
            side: ports.enter_context(closing(MagpieServos(hand)))
            for side, hand in sides.items()
            if hand.port
        }
        process = HandProcess(participant, node, hands, tell=tell)
        tell(
            f"Hands on {config.dds}: {', '.join(hands)}. Ctrl-C ends their driver; they keep what they hold."
        )
        while not stop.wait(TICK):
            process.step()
