"""The MuJoCo model of the robot, built from the table with MjSpec."""

from __future__ import annotations

import mujoco
import numpy as np

from golem.robots.model import contact_shapes, looks, magpie_model, table
from golem.robots.model.contact_shapes import Feet, Shape
from golem.robots.model.spatial import Inertial, quat_of
from golem.types import SIDES, Array, Side

COLLISION_GROUP = 3
"""Geom group of the contact primitives, hidden by default; see `looks.VISUAL_GROUP` for the others."""
HEAD_FOVY = float(np.degrees(2 * np.arctan(240 / 615)))
"""Vertical field of view of the head camera [deg]: 480 rows at a focal length of 615 px (D435i)."""
PALM_FOVY = 58.0
"""Vertical field of view of the palm cameras [deg] (D405)."""
_FLIP: Array = np.diag([1.0, -1.0, -1.0])
"""MuJoCo's camera axes in the optical frame: MuJoCo looks along -z with y up."""


def robot_spec(
    hands: bool = True, torque: str = "urdf", *, self_collision: bool = False, feet: Feet = "spheres"
) -> mujoco.MjSpec:
    """Return the robot without floor, light or options. Raises ConfigError: unknown torque profile.

    Names: bodies as the links; free joint `base`; joints and motors as in the table, the 27 motors first and in motor
    order; per hand the body `{side}_hand` and per finger `{side}_{a|b}_crank`, `_finger` (body, hinge), `_pad` (geom)
    and a motor at the crank; cameras `head`, `left_hand`, `right_hand`; sites `imu`, `left_gripper`,
    `right_gripper`; sensors `imu_quat`, `imu_gyro`, `imu_acc`. Angles of the spec are radians.

    Args:
        hands: with the MAGPIE hands and their cameras.
        torque: profile of the torque limits, see `table.load_limits`.
        self_collision: legs, arms and trunk touch each other, see `contact_shapes.self_pairs`.
        feet: what the soles are to the floor.
    """
    limits = table.load_limits(torque)
    spec = mujoco.MjSpec()
    spec.modelname = "golem_h12"
    spec.compiler.degree = False
    base = _add_body(spec.worldbody, table.BASE_LINK, table.LINKS[table.BASE_LINK], np.array([0, 0, table.BASE_HEIGHT]))
    base.add_freejoint(name="base")
    bodies = {table.BASE_LINK: base}
    for joint, limit in zip(table.JOINTS, limits.torque, strict=True):
        T = joint.T_parent_joint
        body = _add_body(bodies[joint.parent], joint.child, table.LINKS[joint.child], T[:3, 3], T[:3, :3])
        body.add_joint(
            name=joint.name,
            type=mujoco.mjtJoint.mjJNT_HINGE,
            axis=joint.axis,
            range=[joint.lower, joint.upper],
            limited=mujoco.mjtLimited.mjLIMITED_TRUE,
            damping=[table.DOF.damping, 0, 0],
            armature=table.DOF.armature,
            frictionloss=table.DOF.frictionloss,
        )
        bodies[joint.child] = body
        _add_motor(spec, joint.name, float(limit))
    for shape in contact_shapes.body_shapes(feet):
        _add_shape(bodies[shape.link], shape, contact_shapes.BODY)
    add_torso_sensors(spec)
    if hands:
        for side in SIDES:
            add_hand(spec, side)
    if self_collision:
        _let_touch_itself(spec, hands)
    looks.add_looks(spec, hands)
    return spec


def _let_touch_itself(spec: mujoco.MjSpec, hands: bool) -> None:
    """Add the pairs of shapes that may meet, and the boxes among them that meet nothing else."""
    boxes = [contact_shapes.foot_box(side) for side in SIDES]
    if hands:
        boxes += [contact_shapes.hand_box(side) for side in SIDES]
    for box in boxes:
        if spec.geom(box.name) is None:
            _add_shape(spec.body(box.link), box, 0, 0)
    for one, other in contact_shapes.self_pairs(hands):
        # Without friction: how limbs slide along each other is of no interest, and one solver row does instead of four.
        spec.add_pair(name=f"{one}-{other}", geomname1=one, geomname2=other, condim=1)


def _add_body(
    parent: mujoco.MjsBody, name: str, inertial: Inertial, pos: Array, rotation: Array | None = None
) -> mujoco.MjsBody:
    quat = [1.0, 0.0, 0.0, 0.0] if rotation is None else quat_of(rotation)
    xx, xy, xz, yy, yz, zz = inertial.six()
    body = parent.add_body(name=name, pos=pos, quat=quat, mass=inertial.mass, ipos=inertial.com)
    body.fullinertia, body.explicitinertial = [xx, yy, zz, xy, xz, yz], True
    return body


def _add_motor(spec: mujoco.MjSpec, joint: str, limit: float) -> None:
    hinge, limited, bounds = spec.joint(joint), mujoco.mjtLimited.mjLIMITED_TRUE, [-limit, limit]
    hinge.actfrclimited, hinge.actfrcrange = limited, bounds  # Pinocchio and Newton read limits of torque here
    motor = spec.add_actuator(name=joint, target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    motor.ctrllimited, motor.ctrlrange = limited, bounds
    motor.set_to_motor()


def _add_shape(body: mujoco.MjsBody, shape: Shape, contype: int, conaffinity: int = contact_shapes.WORLD) -> None:
    body.add_geom(
        name=shape.name,
        type=shape.kind,
        size=shape.size,
        pos=shape.pos,
        quat=shape.quat,
        contype=contype,
        conaffinity=conaffinity,
        friction=[shape.friction, 0.005, 0.0001],
        group=COLLISION_GROUP,
        mass=0.0,
        rgba=[0.2, 0.6, 0.9, 0.5],
    )


def _add_camera(body: mujoco.MjsBody, name: str, T_body_optical: Array, fovy: float) -> None:
    quat = quat_of(T_body_optical[:3, :3] @ _FLIP)
    body.add_camera(name=name, pos=T_body_optical[:3, 3], quat=quat, fovy=fovy)


def add_torso_sensors(spec: mujoco.MjSpec) -> None:
    """Add head camera and IMU; a site `imu` that is there already stays where it is."""
    torso = spec.body("torso_link")
    _add_camera(torso, "head", table.T_TORSO_HEAD_OPTICAL, HEAD_FOVY)
    T = table.FRAMES["imu_link"].T_parent_frame
    if spec.site("imu") is None:
        torso.add_site(name="imu", pos=T[:3, 3], quat=quat_of(T[:3, :3]), size=[0.01] * 3, group=4)
    for name, kind in (
        ("imu_quat", mujoco.mjtSensor.mjSENS_FRAMEQUAT),
        ("imu_gyro", mujoco.mjtSensor.mjSENS_GYRO),
        ("imu_acc", mujoco.mjtSensor.mjSENS_ACCELEROMETER),
    ):
        spec.add_sensor(name=name, type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname="imu")


def add_hand(spec: mujoco.MjSpec, side: Side) -> None:
    """Mount a MAGPIE hand with its camera and motors to `{side}_wrist_yaw_link`."""
    wrist = spec.body(f"{side}_wrist_yaw_link")
    T = magpie_model.T_WRIST_HAND
    hand = _add_body(wrist, magpie_model.hand_name(side), magpie_model.BASE, T[:3, 3], T[:3, :3])
    _add_shape(hand, contact_shapes.housing_shape(magpie_model.hand_name(side)), contact_shapes.HAND)
    _add_camera(hand, f"{side}_hand", magpie_model.T_HAND_CAMERA, PALM_FOVY)
    hand.add_site(name=f"{side}_gripper", pos=magpie_model.T_HAND_GRIPPER[:3, 3], size=[0.005] * 3, group=4)
    for finger in magpie_model.FINGERS:
        _add_finger(spec, hand, side, finger)


def _add_finger(spec: mujoco.MjSpec, hand: mujoco.MjsBody, side: Side, finger: magpie_model.Finger) -> None:
    """Add crank and finger; an equality keeps the finger's hinge opposite to the crank's, so that it only translates.

    The rocker is not a body of its own: it turns with the crank, whose inertia includes it.
    """
    crank_name, finger_name, pad_name = magpie_model.finger_names(side, finger)
    sign = 1.0 if finger == "a" else -1.0
    inertials = magpie_model.CRANK, magpie_model.FINGER
    if finger == "b":
        inertials = magpie_model.CRANK.mirrored(), magpie_model.FINGER.mirrored()
    crank = _add_body(hand, crank_name, inertials[0], magpie_model.mirror(finger, magpie_model.CRANK_PIVOT))
    blade = _add_body(crank, finger_name, inertials[1], magpie_model.mirror(finger, magpie_model.FINGER_PIVOT))
    crank.add_joint(
        name=crank_name,
        type=mujoco.mjtJoint.mjJNT_HINGE,
        axis=[sign, 0, 0],
        range=[0.0, magpie_model.CLOSED],
        limited=mujoco.mjtLimited.mjLIMITED_TRUE,
        damping=[magpie_model.SERVO_DAMPING, 0, 0],
        armature=magpie_model.SERVO_ARMATURE,
    )
    blade.add_joint(name=finger_name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=[sign, 0, 0])
    spec.add_equality(
        name=finger_name,
        type=mujoco.mjtEq.mjEQ_JOINT,
        objtype=mujoco.mjtObj.mjOBJ_JOINT,
        name1=finger_name,
        name2=crank_name,
        data=[0, -1] + [0] * 10,
        solref=[0.004, 1.0],
        solimp=[0.99, 0.9999, 0.001, 0.5, 2.0],
    )
    _add_motor(spec, crank_name, magpie_model.MAX_TORQUE)
    _add_shape(blade, contact_shapes.blade_shape(finger_name, finger), contact_shapes.HAND)
    blade.add_geom(
        name=pad_name,
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=magpie_model.PAD_HALF_SIZE,
        pos=magpie_model.mirror(finger, magpie_model.PAD_CENTER),
        contype=contact_shapes.HAND,
        conaffinity=contact_shapes.WORLD,
        condim=4,
        priority=2,
        friction=[magpie_model.PAD_FRICTION, 0.01, 0.0001],
        solref=[0.004, 1.0],
        solimp=[0.95, 0.99, 0.001, 0.5, 2.0],
        group=COLLISION_GROUP,
        mass=0.0,
        rgba=[0.1, 0.1, 0.1, 1],
    )
