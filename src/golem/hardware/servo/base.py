"""The contract of motor control: measured state and 27 joint targets in, what the motors are told out."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from golem.types import Array, LowCommand, LowState


@runtime_checkable
class MotorServo(Protocol):
    """Closes the loop around the PD controllers in the motors; runs at 500 Hz."""

    def reset(self, state: LowState) -> None:
        """Start over from the measured `state`: gains ramp up from zero, whatever was learnt is forgotten."""
        ...

    def step(
        self,
        state: LowState,
        q_cmd: Array,
        dt: float,
        leg_gains: tuple[Array, Array] | None = None,
        leg_tau: Array | None = None,
    ) -> LowCommand:
        """Return the command for this tick.

        Args:
            state: measured joints and IMU.
            q_cmd: (27,) joint targets [rad].
            dt: time since the previous tick [s], positive.
            leg_gains: kp [N m/rad] and kd [N m s/rad] of the legs, (12,) each, if their controller wants its own.
            leg_tau: (12,) feed-forward torque of the legs [N m] from a controller that carries the robot with them. It
                replaces the servo's own gravity torque and integral, and the gains of the legs then act in full from
                the first tick: legs that stand must not soften. None: the legs hang, and the servo carries them.
        """
        ...
