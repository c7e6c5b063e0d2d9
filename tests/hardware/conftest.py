"""Frames and a fixed-base robot for the tests of Layer 2."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import mujoco
import numpy as np
import pytest

from golem.capabilities.legs.hold import STANCES
from golem.hardware.safety.base import GateInputs, OperatorRequest, SafetyLimits
from golem.hardware.safety.gate import Gate
from golem.hardware.safety.memory import GateResult
from golem.interfaces.payloads import EstopMessage, GateState
from golem.robots.model.leg_kernel import LegDynamics
from golem.robots.model.mjcf import robot_spec
from golem.robots.model.table import JOINT_NAMES
from golem.types import GRAVITY, LEGS, NUM_JOINTS, Array, Imu, LowCommand, LowState

DT = 0.002


def make_state(t: float, q: Array | None = None, **changes: Array) -> LowState:
    """Return an upright robot at rest, or with the given arrays (`dq`, `tau`, `quat`)."""
    quat = changes.pop("quat", np.array([1.0, 0.0, 0.0, 0.0]))
    arrays = {"dq": np.zeros(NUM_JOINTS), "tau": np.zeros(NUM_JOINTS), **changes}
    q = np.zeros(NUM_JOINTS) if q is None else q
    return LowState(t=t, q=q, imu=Imu(quat, np.zeros(3), np.array([0.0, 0.0, 9.81])), **arrays)


def make_command(t: float, q: Array | None = None, **changes: Array) -> LowCommand:
    """Return a command to stay at zero with ordinary gains, or with the given arrays."""
    arrays = {
        "dq": np.zeros(NUM_JOINTS),
        "tau": np.zeros(NUM_JOINTS),
        "kp": np.full(NUM_JOINTS, 100.0),
        "kd": np.full(NUM_JOINTS, 3.0),
        **changes,
    }
    return LowCommand(t=t, q=np.zeros(NUM_JOINTS) if q is None else q, **arrays)


def carrying() -> tuple[Array, Array]:
    """Return positions and torques, (27,) each, of a robot of 66 kg that stands level on crouching legs."""
    q, tau, legs = np.zeros(NUM_JOINTS), np.zeros(NUM_JOINTS), LegDynamics()
    q[LEGS] = np.tile(STANCES["crouch"], 2)
    legs.update(q, np.zeros(NUM_JOINTS))
    weight = legs.gravity(q, np.array([0.0, 0.0, -GRAVITY])).reshape(2, 6)
    ground = np.array([0.0, 0.0, 33.0 * GRAVITY, 0.0, 0.0, 0.0])
    tau[LEGS] = np.concatenate([weight[k] - legs.jacobians[k].T @ ground for k in range(2)])
    return q, tau


@dataclass
class Bench:
    """A gate on a bench: every tick it is fed sound frames, unless the test says otherwise."""

    gate: Gate
    t: float = 0.0
    sequence: int = 0
    results: list[GateResult] = field(default_factory=list)
    q: Array = field(default_factory=lambda: np.zeros(NUM_JOINTS))
    tau: Array = field(default_factory=lambda: np.zeros(NUM_JOINTS))

    def carry(self) -> None:
        """Put the robot on its feet: legs that crouch, with the torques of its weight."""
        self.q, self.tau = carrying()

    def wait(self, seconds: float, **changes: object) -> GateResult:
        """Let time pass, with `changes` at every tick."""
        for _ in range(round(seconds / DT)):
            self.tick(**changes)
        return self.results[-1]

    def tick(self, **changes: object) -> GateResult:
        """Advance by 2 ms and feed sound frames; `changes` replace fields of the inputs."""
        self.t += DT
        self.sequence += 1
        sound = GateInputs(
            self.t,
            make_state(self.t, self.q, tau=self.tau),
            make_command(self.t, self.q),
            EstopMessage(self.t, self.sequence, False),
        )
        self.results.append(self.gate.step(replace(sound, **changes)))  # pyright: ignore[reportArgumentType]
        return self.results[-1]

    def activate(self) -> None:
        """Bring the gate to ACTIVE."""
        result = self.tick(request=OperatorRequest.ACTIVATE)
        assert result.state is GateState.ACTIVE, result.reason


@pytest.fixture(scope="session")
def limits() -> SafetyLimits:
    """The limits of the default profile, for the frames of these tests, which have no noise."""
    return SafetyLimits.from_profile().still()


@pytest.fixture
def bench(limits: SafetyLimits) -> Bench:
    """A gate that has seen nothing yet."""
    return Bench(Gate(limits))


@pytest.fixture
def state_at() -> Callable[..., LowState]:
    """`make_state`."""
    return make_state


@pytest.fixture
def command_at() -> Callable[..., LowCommand]:
    """`make_command`."""
    return make_command


class Plant:
    """The twin's robot with its pelvis nailed down and no contacts; motors run PD at 1 kHz."""

    def __init__(self, payload: float = 0.0) -> None:
        """Hang `payload` [kg] on the left hand, unknown to everybody else."""
        spec = robot_spec(hands=True)
        spec.delete(spec.joint("base"))
        self._model = spec.compile()
        self._model.opt.timestep = 0.001
        self._model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        self._model.geom_contype[:] = 0
        self._model.geom_conaffinity[:] = 0
        self._model.body("left_hand").mass += payload
        self.data = mujoco.MjData(self._model)
        self._q = np.array([self._model.joint(name).qposadr[0] for name in JOINT_NAMES])
        self._v = np.array([self._model.joint(name).dofadr[0] for name in JOINT_NAMES])
        self._bound = self._model.actuator_ctrlrange[:NUM_JOINTS, 1]

    def place(self, q: Array) -> None:
        """Put the joints at `q` (27,), at rest."""
        self.data.qpos[self._q] = q
        self.data.qvel[:] = 0.0
        mujoco.mj_forward(self._model, self.data)

    def state(self) -> LowState:
        """Return what the motors and the IMU report."""
        return make_state(
            self.data.time,
            self.data.qpos[self._q].copy(),
            dq=self.data.qvel[self._v].copy(),
            tau=self.data.ctrl[:NUM_JOINTS].copy(),
            quat=self.data.sensor("imu_quat").data.copy(),
        )

    def advance(self, command: LowCommand) -> None:
        """Let 2 ms pass under `command`."""
        for _ in range(2):
            error = command.q - self.data.qpos[self._q]
            torque = command.kp * error + command.kd * (command.dq - self.data.qvel[self._v]) + command.tau
            self.data.ctrl[:NUM_JOINTS] = np.clip(torque, -self._bound, self._bound)
            mujoco.mj_step(self._model, self.data)


@pytest.fixture
def plant() -> Callable[..., Plant]:
    """Builds a `Plant`."""
    return Plant
