"""What is written of an identified robot, and how well it does again what the robot did."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path

import mujoco
import numpy as np
import yaml

from golem.capabilities.identification import regressor as r
from golem.capabilities.identification.fit import Identified, low_passed
from golem.capabilities.identification.recording import Motion
from golem.errors import OutputError
from golem.robots.model import mjcf
from golem.robots.model.imu_mount import TORSO
from golem.robots.model.limits import load_limits
from golem.robots.model.table import JOINT_NAMES
from golem.robots.mujoco.motors import Motors
from golem.robots.sensors.profiles import MOTORS
from golem.types import NUM_JOINTS, TICK, Array, LowCommand

BODY, PROFILE, REPORT = "body.xml", "profile.yaml", "report.md"
"""Names of the files."""


def body_spec(x: Array, loaded: bool = False) -> mujoco.MjSpec:
    """Return the robot with masses, armature, damping and friction of the parameters `x` (143,).

    It has no hands, or, `loaded`, wrists as heavy as with hands and payloads.
    """
    spec = mjcf.robot_spec(hands=False)
    for name, inertial in r.links(x, loaded).items():
        body = spec.body(name)
        body.mass, body.ipos = inertial.mass, inertial.com
        body.fullinertia = np.array(inertial.six())[[0, 3, 5, 1, 2, 4]]
    for i, name in enumerate(JOINT_NAMES):
        joint = spec.joint(name)
        joint.armature, damping, joint.frictionloss = (
            max(float(x[at][i]), 0.0) for at in (r.ARMATURE, r.DAMPING, r.FRICTION)
        )
        joint.damping = [damping, 0.0, 0.0]
    return spec


def simulate(x: Array, delay: float, motion: Motion) -> Motion:
    """Return what the motors of a robot with parameters `x` (143,) report under the commands of `motion`.

    The pelvis stays where it is; gravity is what the IMU of the `motion` measured.

    Args:
        x: parameters.
        delay: from a command to its torque [s].
        motion: commands, and where to begin.
    """
    spec = body_spec(x, loaded=True)
    spec.delete(spec.joint("base"))
    spec.option.timestep, spec.option.integrator = TICK, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.disableflags = mujoco.mjtDisableBit.mjDSBL_CONTACT
    model = spec.compile()
    data, motors = mujoco.MjData(model), Motors(model, load_limits().torque, x[r.ZERO], delay)
    motors.place(data, motion.q[0] - x[r.ZERO])
    data.qvel[[model.joint(name).dofadr[0] for name in JOINT_NAMES]] = motion.dq[0]
    # Specific force at the pelvis, whose origin is the waist's; turns of the hanging base are small.
    c, s = np.cos(motion.q[:, TORSO] - x[r.ZERO][TORSO]), np.sin(motion.q[:, TORSO] - x[r.ZERO][TORSO])
    gyro = low_passed(motion.gyro)
    swung = np.cross(np.gradient(gyro, TICK, axis=0), r.IMU_AT) + np.cross(gyro, np.cross(gyro, r.IMU_AT))
    acc = low_passed(motion.acc) - x[r.BIAS] - swung
    field = -np.column_stack([c * acc[:, 0] - s * acc[:, 1], s * acc[:, 0] + c * acc[:, 1], acc[:, 2]])
    out = np.empty((len(motion.q), 3, NUM_JOINTS))
    for k, row in enumerate(motion.command):
        out[k] = motors.measure(data)
        model.opt.gravity = field[k]
        motors.give(LowCommand(k * TICK, *row), data.time)
        motors.drive(data)
        mujoco.mj_step(model, data)
    return replace(motion, q=out[:, 0], dq=out[:, 1], tau=out[:, 2])


def tracking_error(x: Array, delay: float, motion: Motion) -> float:
    """Return by how much a robot, as for `simulate`, misses the joints of `motion`, root mean square [rad]."""
    return float(np.sqrt(np.mean((simulate(x, delay, motion).q - motion.q) ** 2)))


def save(found: Identified, folder: Path, report: str) -> None:
    """Write body, profile and report into `folder`.

    Raises:
        OutputError: they cannot be written.
    """
    spec = body_spec(found.x)
    spec.compile()
    zeros, gains = (
        {name: round(float(value), 6) for name, value in zip(JOINT_NAMES, values, strict=True)}
        for values in (found.x[r.ZERO], found.gain - 1.0)
    )
    profile = {"base": "field", "arm_offset": 0, "leg_offset": 0, "arm_friction": None, "leg_friction": None}
    # The twin's drives act at ticks.
    profile |= {"actuator_delay": max(round(found.delay / TICK), 0) * TICK, "zeros": zeros}
    profile["motors"] = asdict(MOTORS) | {"torque_gain": 0, "torque_gains": gains}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in (
            (BODY, spec.to_xml()),
            (PROFILE, yaml.safe_dump(profile, sort_keys=False)),
            (REPORT, report),
        ):
            (folder / name).write_text(text, encoding="utf-8")
    except OSError as error:
        raise OutputError(f"Cannot write {folder}: {error.strerror}.") from error


def report_text(found: Identified) -> str:
    """Return what was found as Markdown; masses are shares by which links differ from the model's."""
    rows = [
        (f"torque gain of {n}", g, s, 1.0) for n, g, s in zip(JOINT_NAMES, found.gain, found.gain_sigma, strict=True)
    ]
    rows = [*zip(r.NAMES, found.x, found.sigma, r.NOMINAL, strict=True), *rows]
    return "\n".join(
        [
            f"Commands act {found.delay * 1e3:.2f} ms late.\n",
            "| what | found | standard deviation | model | not told |\n|---|---|---|---|---|",
            *(f"| {n} | {v:.4f} | {s:.4f} | {m:g} | {found.unknown.get(n, '')} |" for n, v, s, m in rows),
            "",
        ]
    )
