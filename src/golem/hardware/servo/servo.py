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
from numba import njit

from golem.finite import check_finite, check_measured
from golem.hardware.safety.base import SafetyLimits
from golem.hardware.servo.gains import default_gains
from golem.hardware.servo.gravity import Gravity
from golem.types import LEGS, NUM_JOINTS, UPPER, Array, LowCommand, LowState


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


class Servo:
    """The motor servo of all 27 joints.

    Attributes:
        config: its options.
        gains: gains at full stiffness.
        bias: (27,) integral torque [N m].
    """

    def __init__(self, config: ServoConfig | None = None) -> None:
        """Build the gravity model and look the limits up.

        Raises:
            ConfigError: the limit profile does not exist.
        """
        self.config = config or ServoConfig()
        self.gains = default_gains()
        self.bias: Array = np.zeros(NUM_JOINTS)
        self._torque = SafetyLimits.from_profile(self.config.limits).torque_command
        self._gravity = Gravity(hands=self.config.hands)
        self._elapsed = 0.0

    def reset(self, state: LowState) -> None:
        """Start over: stiffness ramps up from zero and the bias is forgotten."""
        self.bias = np.zeros(NUM_JOINTS)
        self._elapsed = 0.0

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
        self._elapsed += dt
        kp, kd = self.gains.kp.copy(), self.gains.kd.copy()
        if leg_gains is not None:
            kp[LEGS], kd[LEGS] = leg_gains
        gravity = self._gravity.torque(state.q, state.imu.quat)
        if self._elapsed < self.config.ramp:
            ramped = slice(None) if leg_tau is None else UPPER
            kp[ramped] *= self._elapsed / self.config.ramp
        elif self.config.integral:
            error = q_cmd - state.q
            self._integrate(error, state.dq, kp * error - kd * state.dq + gravity + self.bias, dt)
        tau = gravity + self.bias
        if leg_tau is not None:
            tau[LEGS] = leg_tau
        return LowCommand(t=state.t, q=q_cmd.copy(), dq=np.zeros(NUM_JOINTS), tau=tau, kp=kp, kd=kd)

    def _integrate(self, error: Array, dq: Array, predicted: Array, dt: float) -> None:
        c, gains = self.config, self.gains
        self.bias = _integrated(
            self.bias,
            error,
            dq,
            predicted,
            self._torque,
            gains.bias,
            gains.ki * dt,
            c.steady_error,
            c.steady_speed,
        )


@njit(cache=True, nogil=True)
def _integrated(
    bias: Array,
    error: Array,
    dq: Array,
    predicted: Array,
    torque: Array,
    bound: Array,
    gain: Array,
    steady_error: float,
    steady_speed: float,
) -> Array:
    """Return the bias (27,) after one step: of joints that rest near their target and whose torque has room."""
    out = bias.copy()
    for i in range(len(bias)):
        steady = abs(error[i]) < steady_error and abs(dq[i]) < steady_speed
        if steady and not (abs(predicted[i]) >= torque[i] and predicted[i] * error[i] > 0.0):
            out[i] = min(max(bias[i] + gain[i] * error[i], -bound[i]), bound[i])
    return out
