"""What is written of an identified robot, and how well it does again what the robot did."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import mujoco
import numpy as np
import yaml

from golem.capabilities.identification import regressor as r
from golem.capabilities.identification.fit import Identified, low_passed
from golem.capabilities.identification.recording import RecordedMotion
from golem.output_file import write_file
from golem.robots.model import mjcf
from golem.robots.model.imu_mount import TORSO
from golem.robots.model.limits import load_limits
from golem.robots.model.table import JOINT_NAMES
from golem.robots.mujoco.motors import Motors
from golem.robots.sensors.profiles import MOTORS
from golem.types import NUM_JOINTS, TICK, Array, LowCommand

BODY, PROFILE, REPORT = "body.xml", "profile.yaml", "report.yaml"
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


def simulate(x: Array, delay: float, motion: RecordedMotion) -> RecordedMotion:
    """Return what a robot with parameters `x` (143,) reports under the commands of `motion`, `delay` [s] old.

    It begins as `motion` does. The pelvis stays where it is; gravity is what the IMU measured.
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
    return motion._replace(q=out[:, 0], dq=out[:, 1], tau=out[:, 2])


def tracking_error(x: Array, delay: float, motion: RecordedMotion) -> float:
    """Return by how much a robot, as for `simulate`, misses the joints of `motion`, root mean square [rad]."""
    return float(np.sqrt(np.mean((simulate(x, delay, motion).q - motion.q) ** 2)))


def save(found: Identified, folder: Path, said: str) -> None:
    """Write body, profile and a report that begins with what is `said` into `folder`.

    Raises:
        OutputError: they cannot be written.
    """
    spec = body_spec(found.x)
    spec.compile()
    zeros, gains = (
        {name: round(float(value), 6) for name, value in zip(JOINT_NAMES, values, strict=True)}
        for values in (found.x[r.ZERO], found.gain - 1.0)
    )
    motors = asdict(MOTORS) | {"torque_gain": 0, "torque_gains": gains}
    own = {"base": "field", "arm_offset": 0, "leg_offset": 0, "arm_friction": None, "leg_friction": None}
    own |= {"actuator_delay": found.delay, "zeros": zeros, "motors": motors}
    rows = zip(r.NAMES, np.column_stack([found.x, found.sigma, r.NOMINAL]).round(5).tolist(), strict=True)
    report = {"found, standard deviation, model": dict(rows), "not told": found.unknown}
    write_file(folder / BODY, spec.to_xml())
    write_file(folder / PROFILE, yaml.safe_dump(own, sort_keys=False))
    write_file(folder / REPORT, f"# {said}\n{yaml.safe_dump(report, sort_keys=False)}")
