"""CPU time of a tick of the gate, and of the safety process around it, without a network."""

from __future__ import annotations

import time
from itertools import count

import numpy as np

from golem.errors import GolemError
from golem.hardware.estop.virtual import VirtualEstop
from golem.hardware.safety.base import GateInputs, OperatorRequest, SafetyLimits
from golem.hardware.safety.gate import Gate
from golem.interfaces import public
from golem.interfaces.payloads import EstopMessage, GateState
from golem.interfaces.ros_convert import base_estimate
from golem.middleware.dds.local import LocalDomain
from golem.middleware.ros import names
from golem.middleware.ros.codec import dds_name
from golem.middleware.ros.msgs.std_srvs import Trigger_Request
from golem.middleware.ros.node import RosNode
from golem.middleware.wire.convert import encode_low_command, encode_low_state
from golem.runtime.live.safety_process import SafetyProcess
from golem.runtime.lockstep import start_posture
from golem.types import NUM_JOINTS, TICK, Array, BaseEstimate, Imu, LowCommand, LowState

WARM_UP = 500
"""Ticks of the gate alone that are not timed; it is activated half-way."""


def gate_ticks(n: int) -> Array:
    """Return the (n,) CPU times of ticks with a new state, command and base estimate each, in an active gate [s].

    Raises:
        GolemError: the gate did not stay active.
    """
    domain, clock = LocalDomain(), 0.0
    safety, robot = domain.participant(), domain.participant()
    limits, estop = SafetyLimits.from_profile(), VirtualEstop()
    gate = SafetyProcess(safety, RosNode(safety, "safety"), limits, estop, clock=lambda: clock)
    states, commands = (
        robot.writer(names.topic(row.name), dds_name(row.type), row.qos)
        for row in (public.topic("/lowstate"), public.topic("/safety/lowcmd_in"))
    )
    node, base = RosNode(robot, "others"), public.topic("/base_estimate")
    estimates = node.publisher(base.name, base.type, base.qos)
    activate = node.client("/safety/activate", public.TRIGGER)
    q, zeros = start_posture(), np.zeros(NUM_JOINTS)
    up, noise = np.array([1.0, 0.0, 0.0, 0.0]), np.random.default_rng(0)
    command = LowCommand(0.0, q, zeros, zeros, np.full(NUM_JOINTS, 100.0), np.full(NUM_JOINTS, 3.0))
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


def check_ticks(n: int) -> Array:
    """Return the (n,) CPU times of the gate alone, with a new frame of each kind at every tick [s].

    Raises:
        GolemError: the gate did not stay active.
    """
    gate, noise = Gate(), np.random.default_rng(0)
    q, zeros, up = start_posture(), np.zeros(NUM_JOINTS), np.array([1.0, 0.0, 0.0, 0.0])
    kp, kd = np.full(NUM_JOINTS, 100.0), np.full(NUM_JOINTS, 3.0)
    times: list[float] = []
    for i in range(1, WARM_UP + n + 1):
        t, shake = i * TICK, 1e-3 * noise.standard_normal((4, NUM_JOINTS))
        imu = Imu(up, shake[3, :3], np.array([0.0, 0.0, 9.81]) + shake[3, 3:6])
        state = LowState(t, q + 10.0 * shake[0], shake[1], shake[2], imu)
        command = LowCommand(t, q + shake[0], zeros, shake[2], kp, kd)
        request = OperatorRequest.ACTIVATE if i > WARM_UP // 2 else OperatorRequest.NONE
        estop, base = EstopMessage(t, i % 65536, False), BaseEstimate(t, np.eye(4))
        inputs = GateInputs(t, state, command, estop, request, base)
        start = time.thread_time_ns()
        result = gate.step(inputs)
        if i > WARM_UP:
            times.append((time.thread_time_ns() - start) * 1e-9)
    if result.state is not GateState.ACTIVE:
        raise GolemError(f"The gate is {result.state} ({result.reason}: {result.detail}), not active.")
    return np.array(times)
