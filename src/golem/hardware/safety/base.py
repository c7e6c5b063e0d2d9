"""The words of the safety gate: its limits, its states, its reasons, what goes in and what comes out.

The limits are 90 % of the maxima of a named profile, as in the paper ("Hardware Interfaces, Safety"). What the paper
leaves open is chosen here; `SafetyLimits` names the source of each number.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np

from golem.hardware.safety.limit_table import limit_table
from golem.hardware.servo.gains import default_gains
from golem.interfaces.payloads import EstopMessage, Fault
from golem.robots.model.table import JOINT_NAMES, load_limits
from golem.types import LEGS, NUM_JOINTS, UPPER, Array, BaseEstimate, LowCommand, LowState

KP_MAX, KD_MAX = 500.0, 30.0
"""Bounds of the gains [authors]."""
LIMIT_RATIO = 0.9
"""Share of the vendor's maxima that is used [paper]."""
EASE = 0.2
"""Share of the speed limit over which the torque that drives a joint on gives way to the one that brakes it [own]."""
SPACE = 0.05
"""Distance before the end of its range over which it does [rad] [own]."""
EARLY = 0.5
"""Share of `deceleration` by which the limiter judges where a joint would come to rest [own]."""
JOLT = 0.6
"""Share of the torque limit by which what a command asks for may jump [own]."""


STANDING = slice(0, UPPER.start + 1)
"""Joints that standing needs: the legs, and the torso, which tells how the pelvis leans under the IMU."""


class OperatorRequest(StrEnum):
    """What the operator asks for. Only the change to a request counts, so one that is stuck does nothing."""

    NONE = "none"
    ACTIVATE = "activate"
    STOP = "stop"
    RESET = "reset"


@dataclass(frozen=True, slots=True)
class SafetyLimits:
    """Every number the gate compares with; arrays are (27,) in motor order and read-only.

    Source of each: [profile] `golem.robots.model.table`; [paper]; [authors] their published safety relay;
    [board] frame period of the e-stop firmware; [own] chosen here, with the reason.

    Attributes:
        lower, upper: range of commanded positions [rad]: the middle 90 % of the profile's range [profile, paper].
        state_lower, state_upper: range of measured positions [rad]: the profile's full range and 0.05 rad [own:
            a limp joint leans on its mechanical stop, and must not keep the robot from being reset].
        velocity: measured joint speed that stops the robot [rad/s]: 90 % [profile, paper].
        torque: measured joint torque that stops the robot [N m]: 90 % [profile, paper].
        torque_command: bound of the predicted PD torque [N m]: 95 % of `torque` [own: a command at its bound plus
            the noise of the torque estimate must not stop the robot].
        torque_rate: bound of the feed-forward torque's rate [N m/s]: the whole range in 0.1 s for torso and arms, whose
            weight changes slowly, in 0.02 s for the legs, which feel the ground [own].
        jolt: jump of the feed-forward torque, of torso and arms of stiffness times position, too, from one command to
            the next, that counts [N m]: `JOLT` of `torque`.
        middle: middle of the range of measured positions [rad].
        ordinary: (108,) magnitudes of position and of the limiter's resting place, both from `middle`, of speed and
            torque, below which nothing is to be limited or judged.
        sane: (135,) magnitudes of q, dq, tau, kp, kd that no sender who knows the robot reaches: 5 rad beyond its
            range, ten times its speed, torque and gains [own: legs that fall ask for 2.4 rad beyond, and a controller
            that steers a fall with torques for four times an ankle's].
        slew: bound of the commanded position's rate [rad/s]: `velocity` for the legs, whose policies use distant
            targets as torques; 3 rad/s for torso and arms, three times what the controllers ask for [own].
        deceleration: what each joint can surely be braked with [rad/s^2]: torso and arms 20 [own: torque left after
            gravity over the inertia of the stretched limb is 26 at the shoulder], hip pitch and roll 40 [own: 68 with
            the straight leg], hip yaw and knee 200, ankles 150 [own: half of the torque over what hangs below and the
            rotor: 0.4, 0.4 and 0.11 kg m^2].
        damping: kd of the damping stop [N m s/rad]: at most 5, and at most `torque_command / velocity`, so that
            damping breaks no torque limit at any legal speed [own].
        least_kp, least_kd: what holds a motor at least: a third of the servo's stiffness, for legs that carry [own: in
            a ramp to nothing they stand until a quarter]; damping of 30 % for legs, 10 % for torso and arms [own: the
            authors' published arms have a quarter].
        kp_max, kd_max: bounds of the gains [authors].
        kp_rate, kd_rate: how fast gains may rise, per second; they may fall at once [own: full arm stiffness in 0.2 s].
        tilt: angle between the torso's and the world's up that stops the robot [rad] [own: legs that
            recover from the largest pushes lean up to 38 degrees; from here no step helps].
        estop_age: age of the e-stop frame that counts as pressed [s]: five frames [board].
        state_age: age of the state that stops the robot [s]: 25 samples at 500 Hz [own].
        base_age: time without a base estimate that is not stale, after which a robot that had one is stopped [s]
            [own: the estimators call themselves stale after 0.2 s; together more than three times the longest time
            without a planted foot on a floor like ice, 0.15 s, and no step or push recovery comes near].
        command_age: age of the command that stops the robot [s] [own].
        command_late: age that commands may have for no longer than `command_age` [s] [own: one hiccup is borne, but
            legs that always answer what was 90 ms ago fall].
        future: how far ahead of the clock a stamp may be [s] [own].
        samples: consecutive bad samples of position, speed, braking distance or tilt that stop the robot [own].
        leg_samples: the same for position, speed and braking distance of the legs, whose stop is a fall [own: a foot
            that slaps down after a push turns an ankle half a radian in 50 ms, and may come to its stop].
        torque_samples: the same for torque [own: it is bounded below the motors' peak anyway, by a prediction from a
            state as old as the command is late; the legs stand a push at that bound for a tenth of a second].
        gross: multiple of the velocity limit, and violation of the position range [rad], that no sensor noise
            explains and that one sample of suffices [own].
        damping_time: how long STOP1 damps before STOP0 [s] [own: arms have sunk after 2 s].
        longest_tick: time step up to which slewing accumulates [s] [own].
        stall: time between two ticks that stops the robot [s]: meanwhile nobody looked, it may lie on the floor, and
            what comes first after a pause looks fresh [own: as old as a command may be].
        frozen: time for which the sensors of a limb, or the IMU, may report the very same numbers [s]; 0 where they
            stand still, as those of a simulation without noise do [own: as long as a state may be old].
        jump: how far a joint may be from where its speed has taken it since the last sample [rad]; a sample beyond is
            dropped [own: 50 rad/s for one tick, twice the fastest joint].
        drift: how far the positions of a joint may leave its integrated speed, beyond `drift_lag` [rad] [own: see the
            margins in docs/reference/safety.md; so for the other numbers of plausibility].
        drift_lag: delay between a joint's position and its speed that is no fault [s].
        imu_drift: how far the IMU's orientation may leave its integrated rate [rad].
        gravity: bounds of the mean specific force over half a second [m/s^2], for a robot that hardly moves.
        gravity_moving: the same for one that moves.
        gravity_angle: angle between mean specific force and the orientation's up for a robot that hardly moves [rad].
        dead_share, dead_load: a motor whose torque is below this share of the one asked for, where that is above this
            share of `torque`, for `dead_time` [s] does not follow.
        temperature: range of the motors' temperature [degrees].
        voltage: range of their voltage [V], once they have reported one.
        bad_frames: level at which damaged frames stop the robot: each counts one, each sound one takes `frame_leak`
            off. So three in a row stop it, or more than one in fifty for long [own].
        frame_leak: see `bad_frames`.
        jolts: level of jumps of torque that stops the robot: each counts one, each other command takes `jolt_leak`
            off. So three within half a second stop it, or more than one a second for long [own].
        jolt_leak: see `jolts`.
        throw: by how much the constant torque of a leg's motor, that of all twelve together, and all that is asked of
            the twelve may differ from the command before, in shares of `torque` [own: in the hardest shoves they stand
            the shipped legs reach 0.5, 0.9 and 4.3].
        throws: consecutive commands beyond the last of these that stop the robot [own: legs that decide at 50 Hz and
            once saw nonsense give their answer ten times; meanwhile the last sound command holds].
        grace: time from the activation in which legs may become stiff [s] [own: the servo's ramp takes 1.5 s].
        reset_after: time from a stop to its reset [s] [own].
        at_rest: rate of the torso, and of joints, below which a reset is accepted [rad/s] [own].
        opening: at the activation, how far targets of stiff motors may be away [rad], and by how much predicted torques
            may differ from those measured, in shares of `torque` [own].
        hung: time for which the targets of legs that answer the state may be the same, bit for bit [s]; see `sender`
            [own: five and a half decisions at 50 Hz].
        capture: how far the capture point may be outside what both soles span, where both carry, and where a foot is in
            the air or landing [m] [own: see decisions/control.md].
        sinking: speed with which the centre of mass of a robot on its feet may sink [m/s] [own].
        lean: angle between the IMU's up and that of two flat feet [rad] [own: a ramp of 8 degrees is 0.14].
        low: height of base_link above the lower sole below which legs that carry no longer stand [m] [own: legs take
            commanded heights from 0.75 on, and the standing controller rises from 0.67].
        table: the limits by motor for compiled code, see `limit_table`.
    """

    lower: Array
    upper: Array
    state_lower: Array
    state_upper: Array
    velocity: Array
    torque: Array
    torque_command: Array
    torque_rate: Array
    jolt: Array
    middle: Array
    ordinary: Array
    sane: Array
    slew: Array
    deceleration: Array
    damping: Array
    least_kp: Array
    least_kd: Array
    kp_max: float = KP_MAX
    kd_max: float = KD_MAX
    kp_rate: float = 1000.0
    kd_rate: float = 100.0
    tilt: float = 0.8
    estop_age: float = 0.050
    state_age: float = 0.050
    base_age: float = 0.300
    command_age: float = 0.100
    command_late: float = 0.050
    future: float = 0.005
    samples: int = 3
    leg_samples: int = 25
    torque_samples: int = 50
    gross: float = 3.0
    damping_time: float = 3.0
    longest_tick: float = 0.010
    stall: float = 0.100
    frozen: float = 0.050
    jump: float = 0.100
    drift: float = 0.060
    drift_lag: float = 0.010
    imu_drift: float = 0.120
    gravity: tuple[float, float] = (4.0, 20.0)
    gravity_moving: tuple[float, float] = (3.0, 30.0)
    gravity_angle: float = 0.35
    dead_share: float = 0.1
    dead_load: float = 0.10
    dead_time: float = 0.150
    temperature: tuple[float, float] = (-30.0, 100.0)
    voltage: tuple[float, float] = (30.0, 75.0)
    bad_frames: float = 3.0
    frame_leak: float = 0.02
    jolts: float = 2.5
    jolt_leak: float = 0.002
    throw: tuple[float, float, float] = (1.05, 3.0, 5.0)
    throws: int = 15
    grace: float = 3.0
    reset_after: float = 1.0
    at_rest: tuple[float, float] = (0.5, 1.5)
    opening: tuple[float, float] = (1.6, 1.0)
    hung: float = 0.110
    capture: tuple[float, float] = (0.18, 0.33)
    sinking: float = 0.5
    lean: float = 0.25
    low: float = 0.7
    table: Array = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "table", limit_table(self))

    def still(self) -> SafetyLimits:
        """Return these limits for sensors without noise, which may repeat their numbers while the robot rests."""
        return replace(self, frozen=0.0)

    def believing(self) -> SafetyLimits:
        """Return these limits for a robot that says nothing of its sensors.

        They may stand still and feel no torque, and speeds need not add up to positions.
        """
        return replace(self, frozen=0.0, dead_time=np.inf, drift=np.inf)

    @classmethod
    def from_profile(cls, profile: str = "urdf", ratio: float = LIMIT_RATIO) -> SafetyLimits:
        """Return the limits that use the share `ratio` of the limit profile called `profile`.

        Raises ConfigError: there is no such profile.
        """
        limits, gains = load_limits(profile), default_gains()
        middle = 0.5 * (limits.lower + limits.upper)
        half = 0.5 * (limits.upper - limits.lower)
        reach = half + 0.05
        velocity = ratio * limits.velocity
        torque = ratio * limits.torque
        slew = np.full(NUM_JOINTS, 3.0)
        slew[LEGS] = velocity[LEGS]
        deceleration = np.full(NUM_JOINTS, 20.0)
        deceleration[LEGS] = 40.0
        for part, maximum in (("hip_yaw", 200.0), ("knee", 200.0), ("ankle", 150.0)):
            deceleration[[k for k, name in enumerate(JOINT_NAMES) if part in name]] = maximum
        torque_command = 0.95 * torque
        torque_rate = 2.0 * torque / 0.1
        torque_rate[LEGS] = 2.0 * torque[LEGS] / 0.02
        new = cls(
            lower=middle - ratio * half,
            upper=middle + ratio * half,
            state_lower=limits.lower - 0.05,
            state_upper=limits.upper + 0.05,
            velocity=velocity,
            torque=torque,
            torque_command=torque_command,
            torque_rate=torque_rate,
            jolt=JOLT * torque,
            middle=middle,
            ordinary=np.concatenate((reach, reach - SPACE, (1.0 - EASE) * velocity, torque)),
            sane=np.concatenate(
                (
                    np.maximum(np.abs(limits.lower), np.abs(limits.upper)) + 5.0,
                    10.0 * velocity,
                    10.0 * torque,
                    np.full(NUM_JOINTS, 10.0 * KP_MAX),
                    np.full(NUM_JOINTS, 10.0 * KD_MAX),
                )
            ),
            slew=slew,
            deceleration=deceleration,
            damping=np.minimum(5.0, torque_command / velocity),
            least_kp=gains.kp / 3.0,
            least_kd=np.where(np.arange(NUM_JOINTS) < LEGS.stop, 0.3, 0.1) * gains.kd,
        )
        for name in cls.__slots__:
            value = getattr(new, name)
            if isinstance(value, np.ndarray):
                value.flags.writeable = False
        return new


@dataclass(frozen=True, slots=True)
class GateInputs:
    """What the gate sees at one tick. Frames may be absent, repeated, late or out of order.

    Attributes:
        t: present time of the monotonic clock that also stamps the frames [s].
        state: newest state that arrived, or None.
        command: newest command that arrived, or None.
        estop: newest frame of the emergency stop that arrived, or None.
        request: what the operator asks for.
        base: newest estimate of the base that arrived, or None.
        transport: all that is wrong with the way the frames came, such as a checksum or a second writer.
        tick: the robot's own time of `state` [s]; None where its stamp is that.
        stands: whether a standing controller can take the legs.
        standing: what it tells the motors; None before it has them, or when it fails.
        earlier: states that arrived since the last tick, before `state`, each with its tick.
    """

    t: float
    state: LowState | None = None
    command: LowCommand | None = None
    estop: EstopMessage | None = None
    request: OperatorRequest = OperatorRequest.NONE
    base: BaseEstimate | None = None
    transport: tuple[Fault, ...] = ()
    tick: float | None = None
    stands: bool = False
    standing: LowCommand | None = None
    earlier: tuple[tuple[float, LowState], ...] = ()


@dataclass(frozen=True, slots=True)
class Counters:
    """Consecutive bad samples of each check, and whether a joint is fast, near its end, or loaded.

    What is not `strained` needs no braking by the limiter.
    """

    position: int = 0
    leg_position: int = 0
    velocity: int = 0
    leg_velocity: int = 0
    torque: int = 0
    braking: int = 0
    leg_braking: int = 0
    tilt: int = 0
    strained: bool = False


@dataclass(frozen=True, slots=True)
class Outgoing:
    """What the slew limits refer to: the command that went out last.

    Attributes:
        q, kp, kd: (27,) each, before any scaling for torque.
        tau: (27,) feed-forward torque; None before the first command, which may carry the arms' weight at once.
    """

    q: Array
    kp: Array
    kd: Array
    tau: Array | None = None
