"""What a stack is made of: slots with the implementations that come with this package, and the keys of a stack file.

A new implementation is one line here. A new slot is a row in `SLOTS`, a row in `KEYS`, and its node in
`golem.runtime.node_groups`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class Slot:
    """One kind of module.

    Attributes:
        contract: the protocol that its modules satisfy, `package.module:Class`.
        shipped: implementations of this package by name, each `package.module:Class`.
        supplied: parameters of a constructor that the stack fills in; they are no options.
        files: endings of files that can be used themselves, without a class: which implementation takes them, by its
            option `file`.
    """

    contract: str
    shipped: Mapping[str, str]
    supplied: tuple[str, ...] = ()
    files: Mapping[str, str] = field(default_factory=dict[str, str])


@dataclass(frozen=True, slots=True)
class StackKey:
    """A key of the stack file under which one implementation is chosen.

    Attributes:
        slot: of which slot.
        default: the implementation where the file does not have the key.
        standing: the same for a robot that stands on its feet; None: no other.
    """

    slot: str
    default: str
    standing: str | None = None


SLOTS: dict[str, Slot] = {
    "robot": Slot(
        "golem.robots.base:Robot",
        {
            "mujoco": "golem.robots.mujoco.engine:MujocoRobot",
            "isaaclab": "golem.robots.isaaclab.isaac_robot:IsaacLabRobot",
            "physx": "golem.robots.physx.physx_robot:PhysxRobot",
            "replay": "golem.robots.replay.robot:ReplayRobot",
        },
        ("profile", "seed", "posture"),
    ),
    "estimator": Slot(
        "golem.hardware.estimator.base:BaseEstimator",
        {
            "tether": "golem.hardware.estimator.tether:TetherEstimator",
            "random_walk_kf": "golem.hardware.estimator.random_walk_kf:RandomWalkKF",
            "invariant_ekf": "golem.hardware.estimator.invariant_ekf:InvariantEKF",
        },
    ),
    "servo": Slot("golem.hardware.servo.base:MotorServo", {"pd_gravity": "golem.hardware.servo.servo:Servo"}),
    "hand": Slot(
        "golem.hardware.hands.base:HandController",
        {"deligrasp": "golem.hardware.hands.deligrasp:DeliGrasp", "magpie": "golem.hardware.hands.magpie:MagpieHand"},
        ("side",),
    ),
    "lower_body": Slot(
        "golem.capabilities.legs.base:LowerBody",
        {
            "almi": "golem.capabilities.legs.almi:Almi",
            "handover": "golem.capabilities.legs.handover:Handover",
            "hold": "golem.capabilities.legs.hold:JointHold",
            "mpc": "golem.capabilities.legs.mpc.controller:MPC",
            "policy": "golem.capabilities.legs.policy:Policy",
            "vendor": "golem.capabilities.legs.vendor:Vendor",
            "wbc": "golem.capabilities.legs.wbc:Wbc",
        },
        ("onboard",),
        dict.fromkeys((".onnx", ".pt", ".yaml", ".yml"), "policy"),
    ),
    "upper_body": Slot(
        "golem.capabilities.arms.base:UpperBody",
        {"diff_ik": "golem.capabilities.arms.diff_ik:DiffIK", "pink_ik": "golem.capabilities.arms.pink_ik:PinkIK"},
    ),
    "planner": Slot(
        "golem.capabilities.planning.base:ArmPlanner",
        {
            "rrt_connect": "golem.capabilities.planning.rrt_connect:RrtConnect",
            "straight": "golem.capabilities.planning.straight:Straight",
        },
    ),
    "localizer": Slot(
        "golem.capabilities.perception.base:Localizer",
        {
            "clusters": "golem.capabilities.perception.plane_clusters:PlaneClusters",
            "gemini": "golem.capabilities.perception.gemini:Gemini",
            "grounding_dino": "golem.capabilities.perception.grounding_dino:GroundingDino",
            "onnx": "golem.capabilities.perception.onnx_detector:OnnxDetector",
            "owlv2": "golem.capabilities.perception.owlv2:Owlv2",
            "yolo_world": "golem.capabilities.perception.yolo_world:YoloWorld",
        },
    ),
    "grasp_method": Slot(
        "golem.capabilities.grasping.base:GraspMethod",
        {
            "antipodal": "golem.capabilities.grasping.antipodal:Antipodal",
            "centroid": "golem.capabilities.grasping.centroid:Centroid",
            "graspgen": "golem.capabilities.grasping.graspgen:GraspGen",
            "look_and_move": "golem.capabilities.grasping.look_and_move:LookAndMove",
            "reranked": "golem.capabilities.grasping.reranking:Reranking",
            "scorer": "golem.capabilities.grasping.scorer:Scorer",
            "visual_servo": "golem.capabilities.grasping.visual_servo:VisualServo",
        },
    ),
    "properties": Slot(
        "golem.capabilities.properties.base:PropertySource",
        {
            "gemini": "golem.capabilities.properties.gemini_estimate:GeminiEstimate",
            "table": "golem.capabilities.properties.property_table:PropertyTable",
        },
    ),
    "odometry": Slot(
        "golem.capabilities.odometry.base:LidarOdometry",
        {
            "kiss_icp": "golem.capabilities.odometry.kiss_icp:KissIcp",
            "legs": "golem.capabilities.odometry.legs:Legs",
            "lio": "golem.capabilities.odometry.lio:Lio",
            "rko_lio": "golem.capabilities.odometry.rko_lio:RkoLio",
            "topic": "golem.capabilities.odometry.external_topic:ExternalTopic",
        },
    ),
    "mapper": Slot(
        "golem.capabilities.mapping.base:Mapper", {"grid": "golem.capabilities.mapping.voxel_grid:VoxelGridMapper"}
    ),
    "memory": Slot(
        "golem.capabilities.memory.base:Memory",
        {
            "frame_index": "golem.capabilities.memory.frame_index:FrameIndex",
            "object_map": "golem.capabilities.memory.object_map:ObjectMap",
            "reranked": "golem.capabilities.memory.reranked:Reranked",
            "top_down_map": "golem.capabilities.memory.top_down_map:TopDownMap",
        },
    ),
    "navigator": Slot(
        "golem.capabilities.navigation.base:Navigator",
        {
            "goto": "golem.capabilities.navigation.goto:GoTo",
            "costmap_astar": "golem.capabilities.navigation.costmap_astar:CostmapAstar",
            "nav2": "golem.capabilities.navigation.nav2:Nav2",
        },
        ("nav2",),
    ),
    "skill": Slot(
        "golem.skills.base:Skill",
        {
            "calibrate": "golem.skills.calibrate:Calibrate",
            "calibrate_hands": "golem.skills.calibrate_hands:CalibrateHands",
            "calibrate_lidar": "golem.skills.calibrate_lidar:CalibrateLidar",
            "disassemble": "golem.skills.disassemble:Disassemble",
            "dock": "golem.skills.dock:Dock",
            "explore": "golem.skills.explore:Explore",
            "fetch": "golem.skills.fetch:Fetch",
            "navigate": "golem.skills.navigate:Navigate",
            "open": "golem.skills.open_door:OpenDoor",
            "pick": "golem.skills.pick:Pick",
            "place": "golem.skills.place:SetDown",
            "recall": "golem.skills.recall:Recall",
            "remember": "golem.skills.remember:Remember",
            "stand": "golem.skills.walk:Stand",
            "take": "golem.skills.take:Take",
            "walk": "golem.skills.walk:Walk",
        },
    ),
}
"""Every slot by name."""

KEYS: dict[str, StackKey] = {
    "robot": StackKey("robot", "mujoco"),
    "estimator": StackKey("estimator", "tether", standing="random_walk_kf"),
    "servo": StackKey("servo", "pd_gravity"),
    "hand": StackKey("hand", "magpie"),
    "lower_body": StackKey("lower_body", "hold"),
    "upper_body": StackKey("upper_body", "diff_ik"),
    "planner": StackKey("planner", "rrt_connect"),
    "localizer": StackKey("localizer", "onnx"),
    "grasp_method": StackKey("grasp_method", "visual_servo"),
    "properties": StackKey("properties", "table"),
    "odometry": StackKey("odometry", "legs"),
    # Runs where the stack listens to the LiDAR.
    "mapper": StackKey("mapper", "grid"),
    "memory": StackKey("memory", "object_map"),
    "navigator": StackKey("navigator", "goto"),
    # Takes the legs when `lower_body` fails.
    "fallback": StackKey("lower_body", "hold", standing="almi"),
    # Run by the twin's on-board computer for a lower body that speaks to it.
    "onboard": StackKey("lower_body", "almi"),
}
"""Where a stack has one module each, by key of the stack file. Skills, of which it has any number, are no key."""

PARTS: dict[str, str] = {
    "calibration": "golem.robots.sensors.calibration:CalibrationPart",
    "estop": "golem.hardware.estop.estop_config:EstopConfig",
    "locomotion": "golem.capabilities.legs.locomotion:LocomotionConfig",
}
"""What has options in a stack file and no alternatives: key -> its dataclass, `package.module:Class`."""
