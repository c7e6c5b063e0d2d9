"""`golem identify`: what one robot is like, from a bag of its motion in the hoist."""

from __future__ import annotations

from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path

import mujoco
import numpy as np
import yaml
from tyro.conf import Positional

from golem.errors import ConfigError
from golem.evaluation.identification import regressor as r
from golem.evaluation.identification.fit import Identified, identify, low_passed
from golem.evaluation.identification.recording import COMMAND, STATE, RecordedMotion, read_motion
from golem.evaluation.identification.regressor import NOMINAL, PAYLOAD
from golem.interfaces.recorded import public_topics
from golem.middleware.bags.writer import BagWriter
from golem.output_file import write_file
from golem.robots.model import mjcf
from golem.robots.model.imu_mount import TORSO
from golem.robots.model.table import JOINT_NAMES, load_limits
from golem.robots.mujoco.motors import Motors
from golem.robots.sensors.profiles import MOTORS
from golem.runtime.live.broadcast import Broadcast
from golem.runtime.lockstep import build
from golem.stack import Stack, load_stack
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
    """Write body, profile and a report that begins with `said` into `folder`. Raises OutputError: it cannot."""
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


SWEEP = "golem.capabilities.identification.sweep"
"""Module of the legs and arms that swing every joint."""
KEPT = 0.75
"""Share of the motion that is identified from; the rest is held out."""


@dataclass(frozen=True)
class IdentifyConfig:
    """Find masses, payloads, armature, friction, delay, encoder zeros and torque gains of a robot.

    The bag has /lowstate and /lowcmd of a robot in the hoist whose joints all swing.
    """

    bag: Positional[Path]
    """Folder of a bag, or an MCAP file; with --motion the folder to create."""
    out: Path = Path("runs/identified")
    """Folder of what is written."""
    weight: float | None = None
    """The whole robot's mass as a scale in the hoist shows it [kg]: the motion does not tell that of the trunk."""
    motion: bool = False
    """Identify nothing: let a twin in the hoist swing its joints for 60 s, and write that into the bag."""
    stack: str = "tether"
    """Of --motion: path of a stack file, or the name of a shipped one; its robot swings, in the open."""
    profile: str = "field"
    """Of --motion: realism profile, or its file."""
    seed: int = 0
    """Of --motion: seed of the episode."""


def record_motion(stack: Stack, seed: int, bag: Path, seconds: float = 60.0) -> None:
    """Record the robot of `stack`, episode `seed`, while it swings its joints in an open world.

    Raises ConfigError, ModuleFault, OutputError: see `build` and `BagWriter`; the gate has stopped the robot.
    """
    swinging = stack.with_choice("lower_body", f"{SWEEP}:LegSweep").with_choice("upper_body", f"{SWEEP}:ArmSweep")
    running, robot = build(swinging.with_options("robot", world="open"), seed)
    topics = public_topics((STATE, COMMAND))
    with closing(robot), closing(BagWriter(bag)) as writer:
        with closing(Broadcast(running, robot, writer, lambda recorder: recorder.add(topics))) as every_tick:

            def stopped() -> bool:
                every_tick()
                return running.safety is not None and running.safety.why != ""

            running.executor.run(seconds, stopped)
    if running.safety is not None and running.safety.why:
        raise ConfigError(f"The gate stopped the motion after {running.executor.t:.1f} s: {running.safety.why}.")
    print(f"{writer}.")


def halves(motion: RecordedMotion) -> tuple[RecordedMotion, RecordedMotion]:
    """Return what is identified from, the first `KEPT` of a motion, and the rest, which is held out."""
    at = int(KEPT * len(motion.q))
    return RecordedMotion(*(rows[:at] for rows in motion)), RecordedMotion(*(rows[at:] for rows in motion))


def run_identify(config: IdentifyConfig) -> None:
    """Identify the robot in a bag, and print what was found; or record one.

    Raises:
        BagError, IdentificationError: there is no bag, it is damaged, or does not tell enough, and of which joints.
        OutputError: a file cannot be written.
        ConfigError, ModuleFault: see `record_motion`.
    """
    if config.motion:
        record_motion(load_stack(config.stack, profile=config.profile), config.seed, config.bag)
        return
    kept, rest = halves(read_motion(config.bag))
    found = identify(kept, config.weight)
    before, after = (tracking_error(x, t, rest) * 1e3 for x, t in ((NOMINAL, 0.0), (found.x, found.delay)))
    said = (
        f"Joints of the last {100 * (1 - KEPT):.0f} % of the motion, which played no part: missed by {before:.1f} mrad "
        f"before, by {after:.1f} mrad now."
    )
    save(found, config.out, said)
    print(said)
    for name, why in found.unknown.items():
        print(f"Not told by this motion: {name} {why}.")
    payload = ", ".join(f"{max(float(mass), 0.0):.2f}" for mass in found.x[PAYLOAD])
    print(f"{config.out / REPORT} says the rest; in a stack file:")
    print(f"robot: {{use: mujoco, mjcf: {config.out / BODY}, payload: [{payload}]}}\nprofile: {config.out / PROFILE}")
