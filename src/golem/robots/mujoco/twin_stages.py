"""The twin's compiled part of the 500 Hz chain: what its sensors report, and how time passes under a command."""

from __future__ import annotations

import ctypes
import math
from functools import cache
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from mujoco.introspect import ast_nodes, structs

from golem.kernels import njit
from golem.native import (
    LOOK,
    ORDINARY,
    UNUSUAL,
    Record,
    address,
    call_library,
    floats,
    ints,
    library_function,
    shared,
    stage_code,
    view,
    words,
)
from golem.robots.model.imu_mount import TORSO, torso_motion
from golem.robots.mujoco.external_forces import HOIST, PUSHES, apply_pushes, clear_pushes, pull
from golem.robots.mujoco.hand_servos import HAND, drive_hand, move_reference, read_hand
from golem.robots.mujoco.motors import MOTORS, drive, give, report
from golem.robots.mujoco.scene import COARSE_STEP, FINE_STEP
from golem.robots.sensors.imu import BLOCK, IMU, measure_imu
from golem.robots.sensors.profiles import TONES
from golem.robots.worlds.fridge import seal_torque
from golem.types import COMMAND_AGE, NUM_JOINTS

_NUMBERS: dict[str, Any] = {
    "int": ctypes.c_int,
    "float": ctypes.c_float,
    "size_t": ctypes.c_size_t,
    "uintptr_t": ctypes.c_size_t,
    "mjtSize": ctypes.c_int64,
    "mjtNum": ctypes.c_double,
    "mjtBool": ctypes.c_bool,
    "mjtByte": ctypes.c_ubyte,
    "uint64_t": ctypes.c_uint64,
    "uint32_t": ctypes.c_uint32,
    "int64_t": ctypes.c_int64,
}


@cache
def struct(name: str) -> type[ctypes.Structure]:
    """Return the C struct called `name`, by the bindings. Raises KeyError: it or a field's type is unknown."""
    described: Any = structs.STRUCTS[name]
    fields = [(field.name, _kind(field.type)) for field in described.fields]
    return type(name, (ctypes.Structure,), {"_fields_": fields})


def _kind(declared: Any) -> Any:
    if isinstance(declared, ast_nodes.PointerType):
        return ctypes.c_void_p
    if isinstance(declared, ast_nodes.ArrayType):
        inner = _kind(declared.inner_type)
        for extent in reversed(declared.extents):
            inner *= extent
        return inner
    return _NUMBERS.get(declared.name) or struct(declared.name)


def data_struct(data: mujoco.MjData) -> Any:
    """Return the struct behind `data`, which it shares; None where the bindings' description does not fit it."""
    try:
        found: Any = struct("mjData").from_address(data._address)
        fits = found.time == data.time and found.ncon == data.ncon and found.qpos == data.qpos.ctypes.data
    except KeyError:
        return None
    return found if fits else None


MOVING = 0.02
"""Speed of a screw above which it counts as moving [m/s, rad/s]."""

_ARRAYS = ("qpos", "qvel", "ctrl", "xfrc_applied", "qfrc_applied", "sensordata", "xpos", "xmat", "xipos")
TWIN = np.dtype(
    [
        *((name, "i8") for name in ("step", "model", "data", *_ARRAYS)),
        ("time", "f8"),
        ("motors", MOTORS),
        ("left", HAND),
        ("right", HAND),
        ("hoist", HOIST),
        ("pushes", PUSHES),
        ("imu", IMU),
        *((name, "i8") for name in ("base_q", "base_v", "acc")),
        # What calibration knows of the encoders' zeros [rad].
        ("joint_offset", "f8", (NUM_JOINTS,)),
        ("sway", "f8", (2, 2, TONES)),
        ("sway_amplitude", "f8"),
        *((name, "i8") for name in ("screws", "screw_bodies", "screw_speeds")),
        ("fingers", "i8", (4,)),
        ("near", "f8"),
        ("fine", "i8"),
        # Contacts that somebody wants to see; see `MujocoRobot.watch_contacts`.
        *((name, "i8") for name in ("kinds", "contact_count", "contacts", "contact_size", "contact_geoms")),
        *((name, "i8") for name in ("sealed", "seal_q", "seal_v")),
        ("seal_torque", "f8"),
        # Moments for the LiDAR, the newest of them: rows of time, qpos and qvel; none where `moment_rows` is zero.
        *((name, "i8") for name in ("moments", "moment_rows", "moment_count", "positions", "velocities")),
    ]
)
"""Everything the stages need of a twin: addresses of the simulation's arrays, the parts of the robot with what they
remember, and how the world differs. `sway`: angular frequencies and phases; `fine`: whether steps are short now."""
_memory_at = view(TWIN)


def put_simulation(memory: np.ndarray[Any, Any], model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Write where the arrays of a simulation are into `memory`, a `TWIN`."""
    library = next(Path(mujoco.__file__).parent.glob("libmujoco.*"))
    memory["step"] = library_function(str(library), "mj_step")
    memory["model"], memory["data"] = model._address, data._address
    for name in _ARRAYS:
        memory[name] = address(getattr(data, name))


def put_watch(memory: np.ndarray[Any, Any], data: mujoco.MjData, kinds: np.ndarray[Any, Any]) -> bool:
    """Write into `memory`, a `TWIN`, that contacts by `kinds` are watched; return whether that can be."""
    found, contact = data_struct(data), struct("mjContact")
    if found is None:
        return False
    place = ctypes.addressof(found)
    memory["kinds"] = address(kinds)
    memory["contact_count"] = place + type(found).ncon.offset
    memory["contacts"] = place + type(found).contact.offset
    memory["contact_size"], memory["contact_geoms"] = ctypes.sizeof(contact), contact.geom.offset
    return True


@njit(cache=True, nogil=True)
def touching(m: Record) -> bool:
    """Return whether there is a contact that is watched; `m` is a `TWIN`."""
    kinds, first = ints(m.kinds), ints(m.contacts)[0] + m.contact_geoms
    for i in range(words(m.contact_count)[0]):
        geoms = words(first + i * m.contact_size)
        if 1 <= kinds[geoms[0]] + kinds[geoms[1]] <= 2:
            return True
    return False


@njit(cache=True, nogil=True)
def delicate(m: Record) -> bool:
    """Return whether a screw moves, or a finger is so close that it may touch one; `m` is a `TWIN`."""
    speeds, v, p, bodies = ints(m.screw_speeds), floats(m.qvel), floats(m.xpos), ints(m.screw_bodies)
    for i in range(6 * m.screws):
        if abs(v[speeds[i]]) > MOVING:
            return True
    for k in range(m.screws):
        screw = 3 * bodies[k]
        for i in range(4):
            finger = 3 * m.fingers[i]
            x, y, z = p[finger] - p[screw], p[finger + 1] - p[screw + 1], p[finger + 2] - p[screw + 2]
            if x * x + y * y + z * z < m.near * m.near:
                return True
    return False


@njit(cache=True, nogil=True)
def sense(r: Record, m: Record) -> None:
    """Write what motors, IMU and hands report into the shared record `r`; `m` is a `TWIN` whose IMU has noise left."""
    qpos, qvel, sensors = floats(m.qpos), floats(m.qvel), floats(m.sensordata)
    motors = m.motors
    report(motors, m.qpos, m.qvel, r.q, r.dq, r.tau)
    for i in range(NUM_JOINTS):
        r.q[i] -= m.joint_offset[i]
    # MuJoCo's sensors describe the beginning of the last step. Orientation and rate must be of the encoders'
    # instant: 2 ms apart they make planted feet seem to move by a centimetre per second.
    quat, rate, acc = np.empty(4), np.empty(3), np.empty(3)
    for i in range(4):
        quat[i] = qpos[m.base_q + 3 + i]
    for i in range(3):
        rate[i], acc[i] = qvel[m.base_v + 3 + i], sensors[m.acc + i]
    turned, gyro = torso_motion(quat, rate, qpos[motors.q[TORSO]], qvel[motors.v[TORSO]])
    measure_imu(m.imu, turned, gyro, acc, r)
    read_hand(m.left, m.qpos, m.ctrl, r.fingers[0], r.finger_force[0])
    read_hand(m.right, m.qpos, m.ctrl, r.fingers[1], r.finger_force[1])
    r.state_t = r.t
    keep_moment(r.t, m)


@njit(cache=True, nogil=True)
def keep_moment(t: float, m: Record) -> None:
    """Keep the moment `t` [s] for the LiDAR, if there is one; `m` is a `TWIN`."""
    if m.moment_rows == 0:
        return
    nq, nv = m.positions, m.velocities
    row = floats(m.moments + 8 * (1 + nq + nv) * (m.moment_count % m.moment_rows))
    qpos, qvel = floats(m.qpos), floats(m.qvel)
    row[0] = t
    for i in range(nq):
        row[1 + i] = qpos[i]
    for i in range(nv):
        row[1 + nq + i] = qvel[i]
    m.moment_count += 1


@njit(cache=True, nogil=True)
def keep_moment_of(memory: int, t: float) -> None:
    """Do what `keep_moment` does for the `TWIN` at an address."""
    keep_moment(t, _memory_at(memory))


@njit(cache=True, nogil=True)
def let_pass(r: Record, m: Record) -> None:
    """Advance the simulation by one tick under the command in the shared record `r`; `m` is a `TWIN`."""
    command = np.empty(5 * NUM_JOINTS)
    for i in range(5 * NUM_JOINTS):
        command[i] = r.command[i] + (m.joint_offset[i] if i < NUM_JOINTS else 0.0)
    give(m.motors, command, m.time)
    if m.left.commanded:
        move_reference(m.left, r.dt)
    if m.right.commanded:
        move_reference(m.right, r.dt)
    sway_x = sway_y = 0.0
    for i in range(TONES):
        sway_x += math.sin(m.sway[0, 0, i] * m.time + m.sway[1, 0, i])
        sway_y += math.sin(m.sway[0, 1, i] * m.time + m.sway[1, 1, i])
    step = FINE_STEP if m.fine else COARSE_STEP
    for _ in range(round(r.dt / step)):
        drive(m.motors, m.time, m.qpos, m.qvel, m.ctrl)
        drive_hand(m.left, m.qpos, m.qvel, m.ctrl)
        drive_hand(m.right, m.qpos, m.qvel, m.ctrl)
        clear_pushes(m.pushes, m.xfrc_applied)
        amplitude = m.sway_amplitude
        pull(m.hoist, m.time, amplitude * sway_x, amplitude * sway_y, m.qpos, m.qvel, m.xfrc_applied)
        apply_pushes(m.pushes, m.xfrc_applied, m.xpos, m.xmat, m.xipos)
        if m.sealed:
            floats(m.qfrc_applied)[m.seal_v] = -seal_torque(m.seal_torque, floats(m.qpos)[m.seal_q])
        call_library(m.step, m.model, m.data)
        m.time += step


@stage_code
def sense_code(record: int, memory: int) -> int:
    """Sense; see `native.STAGE`."""
    m = _memory_at(memory)
    if m.imu.used >= BLOCK:
        return UNUSUAL
    sense(shared(record), m)
    return ORDINARY


@stage_code
def act_code(record: int, memory: int) -> int:
    """Let time pass; see `native.STAGE`."""
    r, m = shared(record), _memory_at(memory)
    # Motors without a command of late are limp, and the length of a step is the model's.
    if r.t - r.command_t > COMMAND_AGE or delicate(m) != (m.fine != 0):
        return UNUSUAL
    let_pass(r, m)
    return LOOK if m.kinds and touching(m) else ORDINARY
