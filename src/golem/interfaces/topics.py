"""The streams of the bus: one typed key per stream, with its rate and who writes it."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import TypeVar

from golem.interfaces import nav_payloads, payloads
from golem.interfaces.lidar import ExternalOdometry, LidarImu, LidarScan
from golem.interfaces.memory_payloads import MemoryStatus, RememberedPlaces, ShownPicture
from golem.interfaces.unitree_api import ArmSdkCommand
from golem.middleware.bus import Topic
from golem.middleware.wire.api import ApiRequest, Response, request_topic, response_topic
from golem.types import BaseEstimate, HandCommand, HandState, LowCommand, LowState, PalmTargets, RgbdImage, Twist

T = TypeVar("T")

LOW_STATE = Topic("lowstate", LowState)
"""At 500 Hz, from the robot."""
LOW_CMD_REQUEST = Topic("safety/lowcmd_in", LowCommand)
"""At 500 Hz, from the servo to the safety gate."""
LOW_CMD = Topic("lowcmd", LowCommand)
"""At 500 Hz, from the safety gate to the robot; nobody else writes it."""
BASE = Topic("base_estimate", BaseEstimate)
"""At 500 Hz, from the base estimator."""
ESTOP = Topic("estop", payloads.EstopMessage)
"""At 100 Hz, from the emergency stop."""
SAFETY = Topic("safety/status", payloads.GateStatus)
"""Whenever the safety gate ran."""
TRANSPORT_FAULT = Topic("safety/transport", payloads.Fault)
"""What the gate shall stop for: something is wrong with the way its frames come."""
PALM_TARGETS = Topic("palm_targets", PalmTargets)
"""In odom, from the running skill."""
ARM_TRAJECTORY = Topic("arm_trajectory", payloads.JointTrajectory)
"""From the running skill; it holds until palm targets, or another one, come."""
ARM_COMMAND = Topic("arm_command", payloads.ArmCommand)
"""From the upper-body controller."""
ARM_SDK = Topic("arm_sdk", ArmSdkCommand)
"""From a program of the vendor's."""
LEG_COMMAND = Topic("leg_command", payloads.LegCommand)
"""From the lower-body controller."""
TWIST = Topic("cmd_vel", Twist)
"""For the lower body."""
MODULE_FAULT = Topic("module_fault", payloads.ModuleFaultMsg)
"""Of a module without which the robot can still stand."""
LEG_STATUS = Topic("legs/status", payloads.LegStatus)
"""From the base layer of the lower body."""
ODOMETRY = Topic("odometry", payloads.Odometry)
"""From whatever locates the robot better than its base estimate; a stack without it never sends any."""
ODOMETRY_SILENCE = Topic("odometry/silence", payloads.OdometrySilence)
"""From the same, whenever it has another reason to be silent, or none any more."""
LIDAR_SCAN = Topic("lidar/scan", LidarScan)
"""At 10 Hz, from the LiDAR while somebody listens; a robot without one never sends any."""
LIDAR_IMU = Topic("lidar/imu", LidarImu)
"""At 200 Hz, from the IMU inside it."""
EXTERNAL_ODOMETRY = Topic("odometry/external", ExternalOdometry)
"""From an odometry outside of this stack."""
MAP = Topic("map", nav_payloads.OccupancyGrid)
"""From whatever maps; a stack without it never sends any."""
MAP_POSE = Topic("map/pose", nav_payloads.MapPlace)
"""From whatever maps, with every scan, while the place in the map is known."""
MAP_SAVE = Topic("map/save", nav_payloads.MapFile)
"""From a skill that wants the map to be kept."""
MAP_SAVED = Topic("map/saved", nav_payloads.MapFile)
"""The answer, from whatever maps."""
MEMORY_STATUS = Topic("memory/status", MemoryStatus)
"""From the memory, when it begins and after each look that it was given."""
MEMORY_PLACES = Topic("memory/places", RememberedPlaces)
"""After each look that it took, what a memory shows to people."""
SCAN = Topic("scan", nav_payloads.Scan)
"""From a LiDAR that an odometry locates; a robot without one never sends any."""
NAV_GOAL = Topic("navigation/goal", nav_payloads.NavGoal)
"""From the running skill, whenever it changes."""
NAV_STEP = Topic("navigation/step", nav_payloads.NavStep)
"""From the navigator while it has a goal."""
NAV_PATH = Topic("navigation/path", nav_payloads.NavPath)
"""From the navigator whenever it has found another way."""
NAV2_GOAL = Topic("nav2/goal", nav_payloads.Nav2Goal)
"""From a navigator that leaves the way to Nav2."""
NAV2_REPLY = Topic("nav2/reply", nav_payloads.Nav2Reply)
"""From whoever speaks to Nav2, at every change."""
NAV2_TWIST = Topic("nav2/cmd_vel", nav_payloads.Nav2Twist)
"""From Nav2's controller."""
CAMERAS_WANTED = Topic("cameras_wanted", tuple)
"""Names of cameras that somebody wants exposed though nothing is looked for: who records, or a policy."""
REMOVALS = Topic("removals", str)
"""From a gantry that loosens fasteners: a sentence before each."""
PACK_PLAN = Topic("pack/plan", ShownPicture)
"""From a job that takes a pack apart, whenever something happened to a fastener."""
FEEDBACK = Topic("skill/feedback", payloads.Feedback)
"""Of the running skill."""
ONBOARD_LEGS = Topic("onboard/legs", payloads.LegCommand)
"""From the on-board leg controller."""


def _of_each(name: str, kind: type[T]) -> Callable[[str], Topic[T]]:
    """Return what gives the stream of one hand, service or camera, whose own name `name` holds."""
    return cache(lambda which: Topic(name.format(which), kind))


hand_state = _of_each("{}/gripper/state", HandState)
"""What the hand of a side reports."""
hand_command = _of_each("{}/gripper/command", HandCommand)
"""What it is told."""
hand_goal = _of_each("{}/gripper/goal", payloads.HandGoal)
"""From a skill: what it is to do."""
hand_status = _of_each("{}/gripper/status", payloads.HandStatus)
"""What its controller found."""
api_request = _of_each(request_topic("{}"), ApiRequest)
"""Calls to a service of the on-board computer."""
api_response = _of_each(response_topic("{}"), Response)
"""Its answers."""
exposures = _of_each("exposures/{}", payloads.Exposure)
"""What a camera saw."""
rgbd_images = _of_each("realsense/{}", RgbdImage)
"""Its posed images."""
detection_request = _of_each("look/{}", payloads.DetectionRequest)
"""From a skill: what to look for in them."""
detections = _of_each("objects/{}", payloads.Detections)
"""What was detected in them."""
