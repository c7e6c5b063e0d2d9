"""CPU time of one tick of the safety process, without a network: `python -m golem.evaluation.speed.gate_bench`."""

from __future__ import annotations

import time
from dataclasses import dataclass
from itertools import count

import numpy as np
import tyro

from golem.errors import GolemError
from golem.hardware.estop.virtual import VirtualEstop
from golem.hardware.safety.base import SafetyLimits
from golem.interfaces import public
from golem.interfaces.payloads import GateState
from golem.interfaces.ros_convert import base_estimate
from golem.middleware.dds.local import LocalDomain
from golem.middleware.ros import names
from golem.middleware.ros.codec import dds_name
from golem.middleware.ros.msgs.std_srvs import Trigger_Request
from golem.middleware.ros.node import DdsNode
from golem.middleware.wire.convert import encode_low_command, encode_low_state
from golem.runtime.live.safety_process import SafetyProcess
from golem.runtime.lockstep import start_posture
from golem.types import NUM_JOINTS, TICK, Array, BaseEstimate, Imu, LowCommand, LowState


@dataclass(frozen=True)
class GateBenchConfig:
    """Time the safety process while it lets commands through."""

    ticks: int = 5000
    """Ticks to time."""


def gate_ticks(n: int) -> Array:
    """Return the (n,) CPU times of ticks with a new state, command and base estimate each, in an active gate [s].

    Raises:
        GolemError: the gate did not stay active.
    """
    domain, clock = LocalDomain(), 0.0
    safety, robot = domain.participant(), domain.participant()
    limits, estop = SafetyLimits.from_profile(), VirtualEstop()
    gate = SafetyProcess(safety, DdsNode(safety, "safety"), limits, estop, clock=lambda: clock)
    states, commands = (
        robot.writer(names.topic(row.name), dds_name(row.type), row.qos)
        for row in (public.topic("/lowstate"), public.topic("/safety/lowcmd_in"))
    )
    node, base = DdsNode(robot, "others"), public.topic("/base_estimate")
    estimates = node.publisher(base.name, base.type, base.qos)
    activate = node.client("/safety/activate", public.TRIGGER)
    q, zeros = start_posture(), np.zeros(NUM_JOINTS)
    up, noise = np.array([1.0, 0.0, 0.0, 0.0]), np.random.default_rng(0)
    command = LowCommand(0.0, q, zeros, zeros, np.full(NUM_JOINTS, 50.0), np.full(NUM_JOINTS, 2.0))
    times: list[float] = []
    for i in count(1):
        clock = i * TICK
        dq, shake = 1e-3 * noise.standard_normal((2, NUM_JOINTS))
        imu = Imu(up, shake[:3], np.array([0.0, 0.0, 9.81]) + shake[3:6])
        states.write(encode_low_state(LowState(clock, q, dq, zeros, imu)))
        commands.write(encode_low_command(command, 0, answers=clock))
        estimates.publish(base_estimate(BaseEstimate(clock, np.eye(4))))
        start = time.thread_time_ns()
        gate.step()
        if i > n:
            times.append((time.thread_time_ns() - start) * 1e-9)
        if i == n // 2:
            activate.call(Trigger_Request())
        if len(times) == n:
            break
    if gate.status.state is not GateState.ACTIVE:
        raise GolemError(f"The gate is {gate.status.state} ({gate.status.why}), not active.")
    return np.array(times)


def main() -> None:
    """Print the median and the 99th percentile."""
    times = gate_ticks(tyro.cli(GateBenchConfig).ticks) * 1e6
    print(
        f"safety process, CPU time per tick: median {np.median(times):.0f} us, p99 {np.quantile(times, 0.99):.0f} us"
    )


if __name__ == "__main__":
    main()
