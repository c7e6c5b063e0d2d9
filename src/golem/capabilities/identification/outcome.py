"""What is written of an identified robot, and how well it does again what the robot did."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import yaml

from golem.capabilities.identification.fit import Identified, low_passed
from golem.capabilities.identification.recording import Motion
from golem.capabilities.identification.regressor import (
    ARMATURE,
    BIAS,
    DAMPING,
    FRICTION,
    IMU_AT,
    NOMINAL,
    PAYLOAD,
    ZERO,
    identified_links,
    loaded_links,
)
from golem.errors import OutputError
from golem.robots.model import mjcf
from golem.robots.model.imu_mount import TORSO
from golem.robots.model.limits import load_limits
from golem.robots.model.table import JOINT_NAMES, LINKS
from golem.robots.mujoco.motors import Motors
from golem.types import NUM_JOINTS, SIDES, TICK, Array, LowCommand

BODY, PROFILE, REPORT = "body.xml", "profile.yaml", "report.md"
"""Names of the files."""


def body_spec(x: Array, loaded: bool = False) -> mujoco.MjSpec:
    """Return the robot with masses, armature, damping and friction of the parameters `x` (143,).

    It has no hands, or, `loaded`, wrists as heavy as with hands and payloads.
    """
    spec = mjcf.robot_spec(hands=False)
    for name, inertial in (loaded_links if loaded else identified_links)(x).items():
        body = spec.body(name)
        body.mass, body.ipos = inertial.mass, inertial.com
        body.fullinertia = np.array(inertial.six())[[0, 3, 5, 1, 2, 4]]
    for i, name in enumerate(JOINT_NAMES):
        joint = spec.joint(name)
        joint.armature, joint.frictionloss = x[ARMATURE][i], max(float(x[FRICTION][i]), 0.0)
        joint.damping = [max(float(x[DAMPING][i]), 0.0), 0.0, 0.0]
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
    data = mujoco.MjData(model)
    motors = Motors(model, load_limits().torque, x[ZERO], delay)
    motors.place(data, motion.q[0] - x[ZERO])
    data.qvel[[model.joint(name).dofadr[0] for name in JOINT_NAMES]] = motion.dq[0]
    out = np.empty((len(motion.q), 3, NUM_JOINTS))
    # Specific force at the pelvis, whose origin is the waist's; turns of the hanging base are small.
    c, s = np.cos(motion.q[:, TORSO] - x[ZERO][TORSO]), np.sin(motion.q[:, TORSO] - x[ZERO][TORSO])
    gyro = low_passed(motion.gyro)
    swung = np.cross(np.gradient(gyro, TICK, axis=0), IMU_AT) + np.cross(gyro, np.cross(gyro, IMU_AT))
    acc = low_passed(motion.acc) - x[BIAS] - swung
    field = -np.column_stack([c * acc[:, 0] - s * acc[:, 1], s * acc[:, 0] + c * acc[:, 1], acc[:, 2]])
    for k, row in enumerate(motion.command):
        out[k] = motors.measure(data)
        model.opt.gravity = field[k]
        motors.give(LowCommand(k * TICK, *row), data.time)
        motors.drive(data)
        mujoco.mj_step(model, data)
    return replace(motion, q=out[:, 0], dq=out[:, 1], tau=out[:, 2])


def tracking_error(found: Identified, motion: Motion) -> tuple[float, float]:
    """Return by how much model and identified robot miss the joints of `motion`, root mean square [rad]."""
    return tuple(
        float(np.sqrt(np.mean((simulate(x, delay, motion).q - motion.q) ** 2)))
        for x, delay in ((NOMINAL, 0.0), (found.x, found.ticks * TICK))
    )  # type: ignore[return-value]


def save(found: Identified, folder: Path, report: str) -> None:
    """Write body, profile and report into `folder`.

    Raises:
        OutputError: they cannot be written.
    """
    spec = body_spec(found.x)
    spec.compile()

    def rows(values: Array) -> dict[str, float]:
        return {name: round(float(value), 6) for name, value in zip(JOINT_NAMES, values, strict=True)}

    profile = {
        "base": "field",
        "actuator_delay": found.ticks * TICK,
        "zeros": rows(found.x[ZERO]),
        "torque_gains": rows(found.gain - 1.0),
    }
    try:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / BODY).write_text(spec.to_xml(), encoding="utf-8")
        (folder / PROFILE).write_text(yaml.safe_dump(profile, sort_keys=False), encoding="utf-8")
        (folder / REPORT).write_text(report, encoding="utf-8")
    except OSError as error:
        raise OutputError(f"Cannot write {folder}: {error.strerror}.") from error


def stack_lines(found: Identified, folder: Path) -> str:
    """Return what a stack file says to simulate this robot."""
    payload = ", ".join(f"{max(float(mass), 0.0):.2f}" for mass in found.x[PAYLOAD])
    return f"robot: {{use: mujoco, mjcf: {folder / BODY}, payload: [{payload}]}}\nprofile: {folder / PROFILE}"


def report_text(found: Identified, before: float, after: float) -> str:
    """Return what was found as Markdown; tracking errors `before` and `after` in [rad]."""
    x, sigma = found.x, found.sigma
    links = identified_links(x)
    lines = [
        "# Identified robot", "",
        f"Joints of the part that was held out: missed by {before * 1e3:.1f} mrad before, {after * 1e3:.1f} after.", "",
        f"Delay of commands: {found.delay * 1e3:.1f} ms. Payload [kg]: "
        + ", ".join(f"{s} {x[PAYLOAD][k]:.3f} +- {sigma[PAYLOAD][k]:.3f}" for k, s in enumerate(SIDES)) + ".", "",
        "| joint | zero [mrad] | friction [N m] | damping [N m s/rad] | armature [kg m2] | torque gain |",
        "|---|---|---|---|---|---|",
        *(
            f"| {name} | " + " | ".join(
                f"{v[i] * scale:.{digits}f} +- {s[i] * scale:.{digits}f}"
                for v, s, scale, digits in (
                    (x[ZERO], sigma[ZERO], 1e3, 1), (x[FRICTION], sigma[FRICTION], 1.0, 3),
                    (x[DAMPING], sigma[DAMPING], 1.0, 2), (x[ARMATURE], sigma[ARMATURE], 1.0, 4),
                    (found.gain, found.gain_sigma, 1.0, 3),
                )
            ) + " |"
            for i, name in enumerate(JOINT_NAMES)
        ), "",
        "| link | mass [kg] | model [kg] |", "|---|---|---|",
        *(
            f"| {n} | {links[n].mass:.3f} +- {sigma[k] * i.mass:.3f} | {i.mass:.3f} |"
            for k, (n, i) in enumerate(LINKS.items())
        ), "",
        "Not told by this motion:" if found.unknown else "The motion tells all of it.",
        *(f"- {name}: {why}" for name, why in found.unknown.items()), "",
    ]  # fmt: skip
    return "\n".join(lines)
