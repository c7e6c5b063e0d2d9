"""The node of the lower body: connects the leg controller to the bus, and falls back on another when it fails."""

from __future__ import annotations

import math
import time

from golem.capabilities.legs.base import Envelope, LowerBody
from golem.capabilities.legs.gait import GaitConfig
from golem.capabilities.legs.locomotion import Locomotion, LocomotionConfig
from golem.errors import ModuleFault
from golem.interfaces import topics
from golem.interfaces.payloads import LegCommand, LegStatus, ModuleFaultMsg
from golem.middleware.bus import Bus, News
from golem.runtime.contract_check import ContractCheck
from golem.runtime.executor import Node
from golem.runtime.nodes import MIN_RATE, moving
from golem.types import LEGS, BaseEstimate, LowState, Twist

MAX_LATENCY = 0.1
"""Latency a leg controller may have [s]: a third of the time constant sqrt(h/g) with which the robot falls."""
OVERRUNS = 5
"""Ticks in a row that may each take longer than their period, where the wall clock counts; one is a hiccup."""
RECOVERY = 2.0
"""Time the fallback gets to come to a stand [s]: from 0.8 m/s with a margin, and two steps [own]."""
JOINTS = LEGS.stop - LEGS.start


class CheckedLowerBody:
    """A leg controller that ticks at `rate` [Hz], and who watches it."""

    def __init__(self, controller: LowerBody, contract: ContractCheck, on_ground: bool = False) -> None:
        """Take `controller`, of a robot `on_ground` or in a hoist. Raises ModuleFault: it declares what cannot be."""
        self.controller, self.contract, self._on_ground = controller, contract, on_ground
        contract.kind("envelope", controller.envelope, Envelope)
        contract.kind("gait", controller.gait, GaitConfig)
        self.rate = contract.number("rate", controller.rate, minimum=MIN_RATE)
        contract.times.allowed = 1.0 / self.rate + self.check_latency()

    def check_latency(self) -> float:
        """Return the latency at this moment [s]; a controller may measure its own. Raises ModuleFault: it is none."""
        latency = self.contract.call(getattr, self.controller, "latency")
        if type(latency) is float and 0.0 <= latency < math.inf:
            return latency
        return self.contract.number("latency", latency, minimum=0.0)

    def check(self, command: object) -> LegCommand:
        """Return the `command` that the controller returned.

        Raises ModuleFault: it is none, not finite, or leaves the torque of a robot on the ground to the servo.
        """
        checked = command
        if type(checked) is not LegCommand:
            checked = self.contract.kind("the leg command", command, LegCommand)
        if checked.tau is not None:
            self.contract.arrays(JOINTS, q=checked.q, kp=checked.kp, kd=checked.kd, tau=checked.tau)
            return checked
        self.contract.arrays(JOINTS, q=checked.q, kp=checked.kp, kd=checked.kd)
        if self._on_ground:
            raise self.contract.fault(
                "tau is None, with which the servo carries legs that hang; on the ground the contract asks for a "
                "torque, zero where there is none to add"
            )
        return checked


class LowerBodyNode(Node):
    """Runs the leg controller at its rate; when it fails, the fallback for the rest of the run.

    A controller fails when it raises, returns what the contract forbids, declares a latency beyond `MAX_LATENCY`, or
    takes longer than its period `OVERRUNS` times in a row. The fallback then gets the legs in the same tick, at zero
    twist. When it fails too, the fault goes up and stops the motors.

    Attributes:
        realtime: whether the wall clock counts; in lock-step a controller pays by its declared latency.
    """

    def __init__(self, bus: Bus, legs: CheckedLowerBody, fallback: CheckedLowerBody, config: LocomotionConfig) -> None:
        """Run `legs`, with `fallback` in reserve, under a base layer with `config`."""
        self._bus, self._legs, self._fallback = bus, legs, fallback
        self._locomotion = Locomotion(legs.controller, config)
        self._twists = News(bus, topics.TWIST)
        self._fault: ModuleFault | None = None
        self._failed_at = -RECOVERY
        self._overruns = 0
        self._reported, self._speed = self.envelope, self.envelope.speed
        self.realtime = False
        self.period = 1.0 / max(legs.rate, fallback.rate)

    @property
    def envelope(self) -> Envelope:
        """The twists that the controller in charge can follow."""
        return self._legs.controller.envelope

    def recovering(self, t: float) -> bool:
        """Return whether at time `t` [s] the fallback has just taken over."""
        return t - self._failed_at < RECOVERY

    def step(self, t: float) -> None:
        state = self._bus.latest(topics.LOW_STATE)
        base = self._bus.latest(topics.BASE)
        if state is None or base is None:
            return
        twist = self._twists.read()
        try:
            command, latency = self._control(state, base, twist)
        except ModuleFault as fault:
            if self._fault is not None:
                raise self._both(fault) from fault
            # A copy: the one that was raised holds every frame it passed.
            self._fault = ModuleFault(fault.slot, fault.use, fault.reason, fault.trace)
            self._bus.publish(topics.MODULE_FAULT, ModuleFaultMsg(fault.slot, str(fault), trace=fault.trace), t)
            self._failed_at = t
            self._legs, self._overruns = self._fallback, 0
            self._bus.withdraw(topics.LEG_COMMAND)  # what the failed one sent late shall not come any more
            try:
                # What the motors are at now, which is not what was computed last if that was on its way.
                last = self._bus.latest(topics.LEG_COMMAND)
                self._legs.contract.call(self._locomotion.hand_over, self._legs.controller, state, last)
                command, latency = self._control(state, base, None)
            except ModuleFault as second:
                raise self._both(second) from second
        self._bus.publish(topics.LEG_COMMAND, command, t, latency)
        self._report(t)

    def _control(self, state: LowState, base: BaseEstimate, twist: Twist | None) -> tuple[LegCommand, float]:
        """Run the controller in charge for one tick; return its command and latency. A fault of it is raised."""
        contract = self._legs.contract
        started, runs = time.perf_counter() if self.realtime else 0.0, self._locomotion.runs
        if not moving(self._bus):
            contract.call(self._locomotion.reset, state)
            twist = None
        command = contract.call(self._locomotion.step, state, base, twist, self.period)
        if self._locomotion.runs != runs:
            # Only where it ran: in between, on the ticks of a faster fallback, its last command stands.
            late = self.realtime and time.perf_counter() - started > 1.0 / self._legs.rate
            self._overruns = self._overruns + 1 if late else 0
        if self._overruns >= OVERRUNS:
            raise contract.fault(f"it took longer than its period {OVERRUNS} times in a row")
        latency = self._legs.check_latency()
        if latency > MAX_LATENCY:
            raise contract.fault(f"its latency is {latency:g} s, legs need at most {MAX_LATENCY:g} s")
        return self._legs.check(command), latency

    def _both(self, second: ModuleFault) -> ModuleFault:
        """Return the fault of the stack's own controller, with that of the fallback added."""
        first = self._fault
        assert first is not None
        reason = f"{first.reason}; the fallback {second.use} failed too: {second.reason}"
        return ModuleFault(first.slot, first.use, reason, "\n".join(filter(None, (first.trace, second.trace))))

    def _report(self, t: float) -> None:
        locomotion, envelope = self._locomotion, self._legs.controller.envelope
        if envelope is not self._reported:
            self._reported, self._speed = envelope, envelope.speed
        status = LegStatus(
            t, locomotion.commanded, locomotion.applied, locomotion.clamped, locomotion.reason,
            locomotion.motion.stepping, locomotion.moving, locomotion.rest, locomotion.motion.phase,
            self._legs.contract.use, None if self._fault is None else str(self._fault), self._speed,
            None if self._fault is None else self._fault.trace, locomotion.height, envelope.height,
        )  # fmt: skip
        self._bus.publish(topics.LEG_STATUS, status, t)
