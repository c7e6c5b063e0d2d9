"""What the stack shows of itself beside what its rows of the public table say, and what others may ask of its hands."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from golem.capabilities.arms.hand_force import HandForce
from golem.interfaces import public, topics
from golem.interfaces import ros_convert as convert
from golem.interfaces.nav_convert import MAP_FRAME
from golem.interfaces.payloads import HandGoal
from golem.middleware.bus import Bus
from golem.middleware.ros.msgs import golem_interfaces
from golem.middleware.ros.msgs.geometry_msgs import WrenchStamped
from golem.middleware.ros.msgs.nav_msgs import Odometry
from golem.middleware.ros.msgs.std_srvs import Trigger_Response
from golem.middleware.ros.msgs.tf2_msgs import TFMessage
from golem.middleware.wire.convert import encode_low_command
from golem.robots.model import magpie_model
from golem.robots.model.imu_mount import sensed_base_rate
from golem.runtime.live.bridge import Encoders
from golem.runtime.nodes import moving
from golem.types import SIDES, UPPER, Array, BaseEstimate, LowCommand, LowState, Side

MEAN = 5
"""Messages of a hand's wrench whose mean is sent: the torques of one tick are off by 2 to 3 N at the hand."""
SHUT = "The safety gate is shut, see /safety/status."


def encoders(bus: Bus, mode_machine: Callable[[], int], joint_offset: Array | None = None) -> Encoders:
    """Return what makes the messages that take the newest state on `bus` beside their value.

    Args:
        bus: of the stack.
        mode_machine: returns the machine type that the robot reports, which its commands repeat.
        joint_offset: (27,) reported minus true joint positions by calibration [rad]; None believes them.
    """

    def odometry(estimate: BaseEstimate) -> Odometry | None:
        """Return where base_link is in odom, and how it moves."""
        state = bus.latest(topics.LOW_STATE)
        return None if state is None else convert.odometry(estimate, sensed_base_rate(state))

    def frames(estimate: BaseEstimate) -> TFMessage:
        """Return where base_link is in odom, and odom in the map."""
        pairs, poses = [("odom", public.BASE_FRAME)], [estimate.T_odom_base]
        place = bus.latest(topics.MAP_POSE)
        if place is not None:
            pairs.append((MAP_FRAME, "odom"))
            poses.append(place.T_map_estimate.matrix())
        return convert.transforms(estimate.t, pairs, np.array(poses))

    def request(command: LowCommand) -> bytes | None:
        """Return what the stack wants of the motors, with the time of the state that it answers."""
        state = bus.latest(topics.LOW_STATE)
        if state is None:
            return None
        if joint_offset is not None:
            command = replace(command, q=command.q + joint_offset)
        return encode_low_command(command, mode_machine(), answers=state.t)

    force = HandForce()
    felt = {public.wrench(side): partial(_felt, force, side, deque(maxlen=MEAN)) for side in SIDES}
    return {"/odom": odometry, "/tf": frames, "/safety/lowcmd_in": request, **felt}


def _felt(force: HandForce, side: Side, last: deque[Array], state: LowState) -> WrenchStamped:
    """Return the mean of `last`, the wrenches that a hand felt of late, with that of `state`."""
    last.append(-force.wrench(side, state.q[UPPER], state.tau[UPPER]))
    return convert.wrench(state.t, f"{side}_gripper", np.mean(last, axis=0))


def hand_services(bus: Bus, side: Side, now: Callable[[], float]) -> dict[str, Callable[[Any], Any]]:
    """Return what answers the services of one hand.

    Args:
        bus: where its controller takes goals from.
        side: which hand.
        now: robot time [s].
    """

    def give(goal: HandGoal) -> tuple[bool, str]:
        if not moving(bus):
            return False, SHUT
        bus.publish(topics.hand_goal(side), goal, now())
        return True, ""

    def set_gap(request: Any) -> Any:
        if not 0.0 <= request.gap <= magpie_model.MAX_GAP:
            return golem_interfaces.SetGap_Response(
                False, f"The gap is {request.gap} m; it must lie between 0 and {magpie_model.MAX_GAP:.3f} m."
            )
        return golem_interfaces.SetGap_Response(*give(HandGoal(request.gap)))

    def set_force(request: Any) -> Any:
        if not magpie_model.MIN_FORCE <= request.force <= magpie_model.MAX_FORCE:
            return golem_interfaces.SetForce_Response(
                False,
                f"The force is {request.force} N; it must lie between {magpie_model.MIN_FORCE} and "
                f"{magpie_model.MAX_FORCE} N.",
            )
        return golem_interfaces.SetForce_Response(*give(HandGoal(None, request.force)))

    return {
        public.gripper(side, "open"): lambda _: Trigger_Response(*give(HandGoal(magpie_model.MAX_GAP))),
        public.gripper(side, "close"): lambda _: Trigger_Response(*give(HandGoal(None, magpie_model.MAX_FORCE))),
        public.gripper(side, "set_position"): set_gap,
        public.gripper(side, "set_force"): set_force,
    }
