"""The robot as the leg policy trains on it: the twin's own table, made cheap enough to run by the hundred.

All 27 joints move and the hands weigh what they weigh, but their fingers do not turn and nothing is drawn. The motors
are position servos with the gains of the stack, so that the PD loop runs inside the physics at its coarse step.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from golem.capabilities.legs.hold import STANCES
from golem.hardware.safety.base import SafetyLimits
from golem.hardware.servo.gains import default_gains
from golem.robots.model import magpie_model, mjcf
from golem.robots.model.leg_kinematics import SOLE_CENTER, leg_poses, sole_centers
from golem.robots.model.table import BASE_LINK, SOLE, load_limits
from golem.types import LEGS, NUM_JOINTS, SIDES, Array

STEP = 0.01
"""Physics step [s]; twice as fast as 0.005, and what it teaches transfers to the twin's 0.002."""
STANCE: Array = np.tile(STANCES["crouch"], 2)
"""(12,) standing posture of the legs [rad]."""
KP: Array = np.tile([200.0, 200.0, 200.0, 300.0, 40.0, 40.0], 2)
"""(12,) stiffness of the legs [N m/rad]; ALMI-Open's."""
KD: Array = np.tile([2.5, 2.5, 2.5, 4.0, 4.0, 4.0], 2)
"""(12,) damping of the legs [N m s/rad]; ALMI-Open's at hips and knees, twice its 2 at the ankles, which it leaves
underdamped: they exceed the speed at which the safety gate stops the robot."""
_SOLES = sole_centers(*leg_poses(STANCE))
STAND_HEIGHT = float(-_SOLES[:, 2].mean())
"""Height of base_link above the soles in the standing posture [m]."""
FEET_APART: Array = _SOLES[0, :2] - _SOLES[1, :2]
"""(2,) where the left sole belongs relative to the right one [m]."""


@dataclass(frozen=True)
class Ids:
    """Where things are in the training model.

    Attributes:
        base, torso: bodies.
        hands: (2,) bodies of the hands.
        soles: (8,) geoms of the foot spheres, left foot first.
        touch: (2,) addresses of the normal forces in the sensor data.
        sole_velocity: (2, 3) addresses of the soles' world velocities.
    """

    base: int
    torso: int
    hands: NDArray[np.intp]
    soles: NDArray[np.intp]
    touch: NDArray[np.intp]
    sole_velocity: NDArray[np.intp]


def build_model() -> tuple[mujoco.MjModel, Ids]:
    """Return the model and where things are in it: floor, robot, position servos in motor order."""
    spec = mjcf.robot_spec(hands=True, self_collision=True)
    _strip(spec)
    _servos(spec)
    floor = spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[50, 50, 1])
    floor.friction[0] = 0.05  # the pair takes the larger one: the sole's
    for side in SIDES:
        foot = spec.body(f"{side}_ankle_roll_link")
        size = [0.5 * (SOLE.x[1] - SOLE.x[0]) + 0.03, 0.5 * (SOLE.y[1] - SOLE.y[0]) + 0.03, 0.05]
        foot.add_site(name=f"{side}_sole", pos=SOLE_CENTER, size=size, type=mujoco.mjtGeom.mjGEOM_BOX)
        kinds = {"touch": mujoco.mjtSensor.mjSENS_TOUCH, "sole_velocity": mujoco.mjtSensor.mjSENS_FRAMELINVEL}
        for name, kind in kinds.items():
            site = mujoco.mjtObj.mjOBJ_SITE
            spec.add_sensor(name=f"{side}_{name}", type=kind, objtype=site, objname=f"{side}_sole")
    spec.option.timestep = STEP
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    # Roughness moves the feet's spheres, but the midphase asks the volumes that were compiled around their old places.
    # One robot is one island: looking for more costs a twentieth.
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_MIDPHASE | mujoco.mjtDisableBit.mjDSBL_ISLAND
    # With 4 and 8 a foot that lands is off by up to 0.04 rad/s after one step; the mean is below 2.
    spec.option.iterations = 10
    spec.option.ls_iterations = 20
    model = spec.compile()
    feet = [model.body(f"{side}_ankle_roll_link").id for side in SIDES]
    sphere = mujoco.mjtGeom.mjGEOM_SPHERE
    soles = [g for f in feet for g in range(model.ngeom) if model.geom_bodyid[g] == f and model.geom_type[g] == sphere]
    return model, Ids(
        base=model.body(BASE_LINK).id,
        torso=model.body("torso_link").id,
        hands=np.array([model.body(magpie_model.hand_name(side)).id for side in SIDES]),
        soles=np.array(soles),
        touch=np.array([model.sensor(f"{side}_touch").adr[0] for side in SIDES]),
        sole_velocity=np.array([model.sensor(f"{side}_sole_velocity").adr[0] + np.arange(3) for side in SIDES]),
    )


def _strip(spec: mujoco.MjSpec) -> None:
    """Remove what costs time and teaches nothing: pictures, cameras, moving fingers, the IMU's noise-free sensors."""
    seen = [geom for geom in spec.geoms if geom.group != mjcf.COLLISION_GROUP]
    for element in (*spec.equalities, *spec.sensors, *spec.cameras, *seen):
        spec.delete(element)
    for side in SIDES:
        for finger in magpie_model.FINGERS:
            crank = magpie_model.finger_names(side, finger)[0]
            spec.delete(spec.actuator(crank))
            spec.delete(spec.body(crank))
        spec.body(magpie_model.hand_name(side)).mass = magpie_model.MASS
    for joint in list(spec.joints):
        # 0.2 N m of dry friction cost a fifth of the physics and disappear in the randomised motor strength.
        joint.frictionloss = 0.0
    for mesh in list(spec.meshes):
        spec.delete(mesh)


def _servos(spec: mujoco.MjSpec) -> None:
    """Turn the motors into position servos with the stack's gains.

    Torques are bounded by what the safety gate lets through; those of the legs, to which `LegGate` sees, by the motors.
    """
    gains, limits = default_gains(), SafetyLimits.from_profile("urdf")
    kp, kd = gains.kp.copy(), gains.kd.copy()
    kp[LEGS], kd[LEGS] = KP, KD
    torque = limits.torque_command.copy()
    torque[LEGS] = load_limits("urdf").torque[LEGS]
    for i, motor in enumerate(list(spec.actuators)[:NUM_JOINTS]):
        motor.gaintype = mujoco.mjtGain.mjGAIN_FIXED
        motor.biastype = mujoco.mjtBias.mjBIAS_AFFINE
        motor.gainprm = [kp[i]] + [0.0] * (len(motor.gainprm) - 1)
        motor.biasprm = [0.0, -kp[i], -kd[i]] + [0.0] * (len(motor.biasprm) - 3)
        motor.ctrllimited = mujoco.mjtLimited.mjLIMITED_FALSE
        motor.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
        motor.forcerange = [-torque[i], torque[i]]
