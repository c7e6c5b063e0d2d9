"""The 27 motor drives: they latch commands after a delay and run the PD loop at the physics rate."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from golem.errors import ConfigError
from golem.kernels import njit
from golem.native import COMMAND, Record, Records, address, floats, new_record, view
from golem.native_messages import put_command
from golem.robots.sensors.profiles import MotorErrors, per_joint
from golem.types import NUM_JOINTS, TICK, Array, LowCommand

LEAST_ROTOR = 0.005
"""Inertia of a rotor that a model says nothing of, at the joint [kg m2]."""
SLOTS = 128
"""Commands that are on their way at most."""
LONGEST = 0.002
"""Physics step at most [s]; what is over it was no step, but a moment restored."""
_SLACK = 1e-4
"""Below the shortest physics step [s]: sums of time steps are not exact."""

MOTORS = np.dtype(
    [
        *((name, "i8", (NUM_JOINTS,)) for name in ("q", "v")),
        *((name, "f8", (NUM_JOINTS,)) for name in ("limit", "offset")),
        ("delay", "f8"),
        *((name, "i8") for name in ("given", "taken", "latched")),
        *((name, "f8", (NUM_JOINTS,)) for name in ("constant", "kp", "kd", "tau")),
        ("times", "f8", (SLOTS,)),
        ("waiting", "f8", (SLOTS, 3, NUM_JOINTS)),
        ("encoder_step", "f8"),
        ("noise", "f8", (2,)),
        ("torque_gain", "f8", (NUM_JOINTS,)),
        ("play", "f8"),
        *((name, "f8", (NUM_JOINTS,)) for name in ("rotor", "rubs")),
        ("ahead", "f8", (2, NUM_JOINTS)),
        ("driven", "f8"),
        ("reported", "f8", (2, NUM_JOINTS)),
        ("reported_at", "f8"),
        ("random", "u8"),
    ]
)
"""Indices, options and memory of the drives.

Waiting commands are a ring: the k-th one given is in slot k modulo `SLOTS`, rows `constant`, `kp`, `kd`. `constant` is
what the motors add to -kp q - kd dq; q is the true position, the encoders' error is in the target. `noise` is that of
speed and torque, `random` the state of their generator; see `MotorErrors`. `ahead` is how far a rotor is ahead of its
link, and how fast; `rotor` its inertia, `rubs` its dry friction and `play` half of the backlash, all at the joint;
`driven` is when the last step began. `reported` is how far a rotor was ahead at the last report, and its mean speed
since the one before.
"""
_motors_at = view(MOTORS)


@njit(cache=True, nogil=True)
def report(m: Record, qpos: int, qvel: int, q: Array, dq: Array, tau: Array) -> None:
    """Write what encoders and drives report into `q`, `dq`, `tau` (27,); arrays of the simulation by address."""
    place, speed, step, state = floats(qpos), floats(qvel), m.encoder_step, m.random
    noisy = m.noise[0] + m.noise[1] > 0.0
    since, m.reported_at = m.driven - m.reported_at, m.driven
    for i in range(NUM_JOINTS):
        if m.play > 0.0 and since > 0.0:  # a drive tells speed by the difference of two places
            m.reported[1, i] = (m.ahead[0, i] - m.reported[0, i]) / since
            m.reported[0, i] = m.ahead[0, i]
        q[i] = place[m.q[i]] + m.ahead[0, i] + m.offset[i]
        if step > 0.0:
            q[i] = step * round(q[i] / step)
        dq[i], tau[i] = speed[m.v[i]] + m.reported[1, i], m.torque_gain[i] * m.tau[i]
        if noisy:  # two normal numbers by Box and Muller, of two uniform ones by xorshift64*
            state = _shifted(state)
            radius = math.sqrt(-2.0 * math.log(_unit(state)))
            state = _shifted(state)
            angle = 2.0 * math.pi * _unit(state)
            dq[i] += m.noise[0] * radius * math.cos(angle)
            tau[i] += m.noise[1] * radius * math.sin(angle)
    m.random = state


@njit(cache=True, nogil=True)
def _shifted(state: np.uint64) -> np.uint64:
    state ^= state >> np.uint64(12)
    state ^= state << np.uint64(25)
    return state ^ (state >> np.uint64(27))


@njit(cache=True, nogil=True)
def _unit(state: np.uint64) -> float:
    """Return a number above 0 and up to 1."""
    return (float((state * np.uint64(2685821657736338717)) >> np.uint64(11)) + 1.0) * 2.0**-53


@njit(cache=True, nogil=True)
def _report_at(motors: int, qpos: int, qvel: int, out: Array) -> None:
    report(_motors_at(motors), qpos, qvel, out[0], out[1], out[2])


@njit(cache=True, nogil=True)
def give(m: Record, command: Array, t: float) -> None:
    """Take `command` (135,) at time `t` [s]; see `Motors.give`."""
    slot = m.given % SLOTS
    m.times[slot] = t
    for i in range(NUM_JOINTS):
        kp, kd = command[3 * NUM_JOINTS + i], command[4 * NUM_JOINTS + i]
        held = kp * (command[i] - m.offset[i]) + kd * command[NUM_JOINTS + i]
        m.waiting[slot, 0, i] = held + command[2 * NUM_JOINTS + i]
        m.waiting[slot, 1, i], m.waiting[slot, 2, i] = kp, kd
    m.given += 1
    if not m.latched:
        _latch(m, slot)


@njit(cache=True, nogil=True)
def _latch(m: Record, slot: int) -> None:
    m.latched = 1
    for i in range(NUM_JOINTS):
        m.constant[i], m.kp[i], m.kd[i] = m.waiting[slot, 0, i], m.waiting[slot, 1, i], m.waiting[slot, 2, i]


@njit(cache=True, nogil=True)
def drive(m: Record, time: float, qpos: int, qvel: int, ctrl: int) -> None:
    """Set the torques for one physics step that begins at `time` [s]; arrays of the simulation by address."""
    due, newest = time - m.delay + _SLACK, -1
    while m.taken < m.given and m.times[m.taken % SLOTS] <= due:
        newest = m.taken % SLOTS
        m.taken += 1
    if newest >= 0:
        _latch(m, newest)
    if not m.latched:
        return
    q, v, out = floats(qpos), floats(qvel), floats(ctrl)
    dt = min(max(time - m.driven, 0.0), LONGEST)
    m.driven = time
    for i in range(NUM_JOINTS):
        tau = m.constant[i] - m.kp[i] * (q[m.q[i]] + m.ahead[0, i]) - m.kd[i] * (v[m.v[i]] + m.ahead[1, i])
        m.tau[i] = min(max(tau, -m.limit[i]), m.limit[i])
        out[i] = m.tau[i] if m.play == 0.0 or _pushes(m, i, dt) else 0.0


@njit(cache=True, nogil=True)
def _pushes(m: Record, i: int, dt: float) -> bool:
    """Move the rotor of joint `i` in its play for `dt` [s]; return whether its torque reaches the link.

    It does while the rotor is at that end of the play to which its torque drives it (dead zone with inertia: Nordin and
    Gutman, Controlling mechanical systems with backlash: a survey, Automatica 38, 2002). Gears rub on the rotor's side,
    so a small torque moves nothing. Left out: the acceleration of the link in the play, and what the rotor's impact
    hands over.
    """
    speed = m.ahead[1, i] + m.tau[i] / m.rotor[i] * dt
    slower = min(m.rubs[i] / m.rotor[i] * dt, abs(speed))
    speed -= math.copysign(slower, speed)
    place = m.ahead[0, i] + speed * dt
    touches = abs(place) >= m.play
    m.ahead[0, i] = min(max(place, -m.play), m.play)
    m.ahead[1, i] = 0.0 if touches else speed
    return touches


def torque_limits(model: mujoco.MjModel, otherwise: Array) -> Array:
    """Return the most that each motor of `model` gives, (27,) [N m]: `otherwise` (27,) where the model does not say."""
    motors, joints = slice(NUM_JOINTS), model.actuator_trnid[:NUM_JOINTS, 0]
    out = np.full(NUM_JOINTS, np.inf)
    for limited, span in (
        (model.actuator_ctrllimited[motors], model.actuator_ctrlrange[motors, 1]),
        (model.actuator_forcelimited[motors], model.actuator_forcerange[motors, 1]),
        (model.jnt_actfrclimited[joints], model.jnt_actfrcrange[joints, 1]),
    ):
        out = np.where(limited, np.minimum(out, span), out)
    return np.where(np.isinf(out), otherwise, out)


class Motors:
    """Drives of the model's first 27 actuators; `tau` (27,) is of the last step [N m], `memory` a `MOTORS`."""

    def __init__(
        self,
        model: mujoco.MjModel,
        limit: Array,
        offset: Array,
        delay: float,
        memory: Records | None = None,
        errors: MotorErrors | None = None,
        rng: np.random.Generator | None = None,
        backlash: float = 0.0,
    ) -> None:
        """Attach to `model`. Raises ConfigError: the delay is longer than commands are kept.

        Args:
            model: its first 27 actuators are the motors, named as their joints.
            limit: (27,) most torque [N m].
            offset: (27,) reported minus true joint position [rad].
            delay: time from a command being given to its torque [s].
            memory: where they remember, a `MOTORS`; None is a place of their own.
            errors: of what they report; None reports what is.
            backlash: play of the gears between rotor, whose encoder reports, and link [rad].
        """
        if delay > (longest := (SLOTS - 2) * TICK):
            raise ConfigError(f"The motors' delay is {delay:g} s; it may be up to {longest:g} s.")
        joints = [model.joint(model.actuator(i).name) for i in range(NUM_JOINTS)]
        self._q = np.array([joint.qposadr[0] for joint in joints])
        self._v = np.array([joint.dofadr[0] for joint in joints])
        self.memory = memory = new_record(MOTORS) if memory is None else memory
        memory["q"], memory["v"] = self._q, self._v
        memory["limit"], memory["offset"], memory["delay"] = limit, offset, delay
        errors, rng = errors or MotorErrors(), rng or np.random.default_rng(0)
        memory["encoder_step"], memory["noise"] = errors.encoder_step, (errors.speed_noise, errors.torque_noise)
        gains = per_joint(errors.torque_gains)
        memory["torque_gain"] = 1.0 + gains + errors.torque_gain * rng.standard_normal(NUM_JOINTS)
        memory["random"] = rng.integers(1, 2**63)
        memory["play"], memory["rotor"] = 0.5 * backlash, np.maximum(model.dof_armature[self._v], LEAST_ROTOR)
        memory["rubs"] = model.dof_frictionloss[self._v]
        self._numbers = np.empty(COMMAND)
        self.tau: Array = memory["tau"][0]

    def resist(self, model: mujoco.MjModel, friction: Array) -> None:
        """Give the joints of `model` their dry `friction` (27,) [N m]; NaN leaves one as it is."""
        model.dof_frictionloss[self._v] = np.where(np.isnan(friction), model.dof_frictionloss[self._v], friction)
        self.memory["rubs"] = model.dof_frictionloss[self._v]

    def place(self, data: mujoco.MjData, q: Array) -> None:
        """Put the joints at their true positions `q` (27,) [rad]."""
        data.qpos[self._q] = q

    def measure(self, data: mujoco.MjData) -> tuple[Array, Array, Array]:
        """Return q, dq, tau, (27,) each, as encoders and drives report them."""
        out = np.empty((3, NUM_JOINTS))
        _report_at(address(self.memory), address(data.qpos), address(data.qvel), out)
        return out[0], out[1], out[2]

    def give(self, command: LowCommand, t: float) -> None:
        """Take `command` at time `t` [s]; it acts when its delay has passed. The very first acts at once."""
        put_command(self._numbers, command)
        give(self.memory[0], self._numbers, t)

    def drive(self, data: mujoco.MjData) -> None:
        """Set the torques for one physics step; before the first command there are none."""
        drive(self.memory[0], data.time, address(data.qpos), address(data.qvel), address(data.ctrl))
