"""PD in the motor, gravity feed-forward, integral bias: motor control as the paper has it.

    tau = kp (q_cmd - q) - kd dq + tau_cmd            in the motor, at the physics rate
    tau_cmd = tau_g(q) + tau_b                        here, at 500 Hz
    tau_b <- tau_b + ki (q_cmd - q) dt

(paper: Hardware Interfaces, Motor Control). What the paper leaves open: the integral runs per joint and near steady
state only, because the error of a moving joint is the lag of the damping term and not a missing torque; it is clamped;
and it is frozen while the predicted torque saturates and the error pushes further out. There is no leak: a leaky
integral would leave an error again.

tau_g is that of a robot held at its base. Legs that carry the robot need another torque, which only their controller
knows: where it gives one, the servo adds nothing of its own to the legs and leaves out their ramp.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from golem.finite import check_finite, check_measured, finite_state
from golem.hardware.safety.base import SafetyLimits
from golem.hardware.servo.gains import Gains, default_gains
from golem.hardware.servo.gravity import body_tree, gravity_in_base
from golem.kernels import njit
from golem.native import ORDINARY, UNUSUAL, CompiledStage, Record, new_record, new_shared, own, shared, stage_code, view
from golem.native_messages import command_of, put_legs, put_state
from golem.robots.model.imu_mount import TORSO
from golem.robots.model.leg_kernel import tree_dtype, tree_gravity
from golem.types import LEGS, NUM_JOINTS, UPPER, Array, LowCommand, LowState

_LEGS = LEGS.stop


@dataclass(frozen=True, slots=True)
class ServoConfig:
    """Options of `Servo`.

    Attributes:
        limits: name of the limit profile; the torque bound of the anti-windup is the safety gate's.
        ramp: time from reset to full stiffness [s]; feed-forward and damping act in full at once, so that raised
            arms float instead of falling. Legs whose controller supplies their torque are stiff at once.
        steady_error: position error below which a joint's bias integrates [rad]; 0.1 rad is the sag of a shoulder
            under 4 kg at 0.6 m.
        steady_speed: joint speed below which it does [rad/s]. Faster motion would teach the bias the lag of the damping
            term, and the arm would overshoot when it stops.
        integral: whether the bias exists at all.
        hands: whether the robot wears the MAGPIE hands.
    """

    limits: str = "urdf"
    ramp: float = 1.5
    steady_error: float = 0.10
    steady_speed: float = 0.04
    integral: bool = True
    hands: bool = True


SERVO = np.dtype(
    [
        ("tree", tree_dtype(NUM_JOINTS)),
        ("gains", "f8", (4, NUM_JOINTS)),
        ("torque", "f8", (NUM_JOINTS,)),
        *((name, "f8") for name in ("ramp", "steady_error", "steady_speed")),
        ("integral", "i8"),
        ("bias", "f8", (NUM_JOINTS,)),
        ("elapsed", "f8"),
    ]
)
"""Model, gains (rows kp, kd, ki, bound of the bias), options and memory of the servo."""
_memory_at = view(SERVO)


@njit(cache=True, nogil=True)
def servo(r: Record, m: Record) -> None:
    """Write the command that state and targets of the shared record `r` ask for into it; `m` is a `SERVO`."""
    field, gravity = np.empty(3), np.empty(NUM_JOINTS)
    gravity_in_base(r.quat, r.q[TORSO], field)
    tree_gravity(m.tree, r.q, field, gravity)
    if not r.moving:
        m.elapsed = 0.0
        for i in range(NUM_JOINTS):
            m.bias[i] = 0.0
    m.elapsed += r.dt
    for i in range(NUM_JOINTS):
        leg = i < _LEGS
        at, dq, kp, kd = r.q[i], r.dq[i], m.gains[0, i], m.gains[1, i]
        # A half that has not spoken yet stays where it is.
        goal = at
        if leg and r.has_legs:
            goal = r.leg_q[i]
        elif not leg and r.has_arms:
            goal = r.arm_q[i - _LEGS]
        if leg and r.has_leg_gains:
            kp, kd = r.leg_kp[i], r.leg_kd[i]
        if m.elapsed < m.ramp:
            if not (leg and r.has_leg_tau):
                kp *= m.elapsed / m.ramp
        elif m.integral:
            error = goal - at
            predicted = kp * error - kd * dq + gravity[i] + m.bias[i]
            if abs(error) < m.steady_error and abs(dq) < m.steady_speed:
                # Of joints that rest near their target and whose torque has room.
                if not (abs(predicted) >= m.torque[i] and predicted * error > 0.0):
                    bound = m.gains[3, i]
                    m.bias[i] = min(max(m.bias[i] + m.gains[2, i] * r.dt * error, -bound), bound)
        r.request[i] = goal
        r.request[NUM_JOINTS + i] = 0.0
        r.request[2 * NUM_JOINTS + i] = r.leg_tau[i] if leg and r.has_leg_tau else gravity[i] + m.bias[i]
        r.request[3 * NUM_JOINTS + i] = kp
        r.request[4 * NUM_JOINTS + i] = kd
    r.request_t = r.state_t


@njit(cache=True, nogil=True)
def _finite_targets(r: Record) -> bool:
    total = 0.0  # x - x is 0, or NaN
    for i in range(_LEGS):
        total += r.leg_q[i] - r.leg_q[i]
    for i in range(NUM_JOINTS - _LEGS):
        total += r.arm_q[i] - r.arm_q[i]
    return total == 0.0


@stage_code
def _code(record: int, memory: int) -> int:
    r = shared(record)
    if not (finite_state(r) and _finite_targets(r)):
        return UNUSUAL
    servo(r, _memory_at(memory))
    return ORDINARY


class Servo:
    """The motor servo of all 27 joints.

    Attributes:
        stage: its compiled step; in a chain it is called without this class, with the same memory.
        gains: gains at full stiffness.
        bias: (27,) integral torque [N m].
    """

    def __init__(self, config: ServoConfig | None = None) -> None:
        """Build the gravity model and look the limits up. Raises ConfigError: the limit profile does not exist."""
        self.config = c = config or ServoConfig()
        self.stage = CompiledStage(_code(), new_record(SERVO))
        memory, gains = self.stage.memory, default_gains()
        memory["tree"] = body_tree(c.hands)
        memory["gains"] = gains.kp, gains.kd, gains.ki, gains.bias
        memory["torque"] = SafetyLimits.from_profile(c.limits).torque_command
        memory["ramp"], memory["integral"] = c.ramp, c.integral
        memory["steady_error"], memory["steady_speed"] = c.steady_error, c.steady_speed
        self.gains = Gains(*memory["gains"][0])
        self.bias: Array = memory["bias"][0]
        self._record = new_shared()
        self._record["moving"] = self._record["has_legs"] = self._record["has_arms"] = 1

    def native(self) -> CompiledStage | None:
        """Return the stage; see `HasStage`."""
        return self.stage if own(self, Servo, "step", "reset") else None

    def reset(self, state: LowState) -> None:
        """Start over: stiffness ramps up from zero and the bias is forgotten."""
        self.bias[:] = 0.0
        self.stage.memory["elapsed"] = 0.0

    def step(
        self,
        state: LowState,
        q_cmd: Array,
        dt: float,
        leg_gains: tuple[Array, Array] | None = None,
        leg_tau: Array | None = None,
    ) -> LowCommand:
        """Return the command of this tick; see `MotorServo.step`."""
        check_measured(state)
        check_finite("the targets", q_cmd)
        record = self._record
        put_state(record, state)
        put_legs(record, q_cmd[LEGS], leg_gains, leg_tau)
        record["arm_q"], record["dt"] = q_cmd[UPPER], dt
        self.stage.run(record)
        return command_of(record["request"][0], state.t)
