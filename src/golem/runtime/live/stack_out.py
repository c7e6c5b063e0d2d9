"""What the stack shows of itself, and what others may ask of it beside its skills."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from golem.interfaces import public, topics
from golem.interfaces import ros_convert as convert
from golem.interfaces.payloads import HandGoal
from golem.middleware.bus import Bus, News
from golem.middleware.ros.msgs import golem_interfaces
from golem.middleware.ros.msgs.std_srvs import Trigger_Response
from golem.robots.model import magpie_model
from golem.robots.model.imu_mount import sensed_base_rate
from golem.runtime.live.role_endpoints import RoleEndpoints
from golem.runtime.nodes import moving
from golem.types import TICK, Side

SHUT = "The safety gate is shut, see /safety/status."


class BaseOut:
    """Sends every estimate of the base to the safety gate."""

    period = TICK

    def __init__(self, bus: Bus, endpoints: RoleEndpoints) -> None:
        """Publish on `surface` what is on `bus`."""
        self._endpoints, self._news = endpoints, News(bus, topics.BASE)

    def step(self, t: float) -> None:
        """Send a new estimate."""
        estimate = self._news.read()
        if estimate is not None:
            self._endpoints.publish("/base_estimate", convert.base_estimate(estimate))


class OdometryOut:
    """Sends where base_link is in odom, where anybody wants it."""

    period = 0.02

    def __init__(self, bus: Bus, endpoints: RoleEndpoints) -> None:
        """Publish on `surface` what is on `bus`."""
        self._bus, self._endpoints = bus, endpoints

    def step(self, t: float) -> None:
        """Send the present estimate."""
        estimate = self._bus.latest(topics.BASE)
        state = self._bus.latest(topics.LOW_STATE)
        if estimate is None or state is None:
            return
        if self._endpoints.heard("/odom"):
            message = convert.odometry(estimate, sensed_base_rate(state))
            self._endpoints.publish("/odom", message)
        if self._endpoints.heard("/tf"):
            pose = estimate.T_odom_base[np.newaxis]
            self._endpoints.publish(
                "/tf", convert.transforms(estimate.t, [("odom", public.BASE_FRAME)], pose)
            )


class LegsOut:
    """Sends what the lower body does, where anybody wants it."""

    period = 0.02

    def __init__(self, bus: Bus, endpoints: RoleEndpoints) -> None:
        """Publish on `surface` what is on `bus`."""
        self._bus, self._endpoints = bus, endpoints

    def step(self, t: float) -> None:
        """Send the present status."""
        status = self._bus.latest(topics.LEG_STATUS)
        if status is not None and self._endpoints.heard("/legs/status"):
            self._endpoints.publish("/legs/status", convert.leg_status(status))


class SightingsOut:
    """Sends what a localizer found."""

    period = TICK

    def __init__(self, bus: Bus, endpoints: RoleEndpoints, camera: str) -> None:
        """Publish on `surface` what was found in the frames of `camera`."""
        self._endpoints, self._topic = endpoints, f"/objects/{camera}"
        self._news = News(bus, topics.detections(camera))

    def step(self, t: float) -> None:
        """Send new sightings."""
        sightings = self._news.read()
        if sightings is not None:
            self._endpoints.publish(self._topic, convert.sightings(sightings))


class HandCommandOut:
    """Sends what one hand is told to its servos."""

    period = 0.01

    def __init__(self, bus: Bus, endpoints: RoleEndpoints, side: Side) -> None:
        """Publish on `surface` what is on `bus`."""
        self._bus, self._endpoints = bus, endpoints
        self._side: Side = side

    def step(self, t: float) -> None:
        """Send the present command."""
        command = self._bus.latest(topics.hand_command(self._side))
        if command is not None:
            message = convert.hand_command(command, self._side)
            self._endpoints.publish(public.gripper(self._side, "command"), message)


class HandStatusOut:
    """Sends what a hand's controller found, where anybody wants it."""

    period = 0.1

    def __init__(self, bus: Bus, endpoints: RoleEndpoints, side: Side) -> None:
        """Publish on `surface` what is on `bus`."""
        self._bus, self._endpoints = bus, endpoints
        self._side: Side = side

    def step(self, t: float) -> None:
        """Send the present status."""
        topic = public.gripper(self._side, "status")
        status = self._bus.latest(topics.hand_status(self._side))
        if status is None or not self._endpoints.heard(topic):
            return
        head = convert.header(max(status.t, 0.0), f"{self._side}_gripper")
        force = np.array(status.force, np.float64)
        self._endpoints.publish(
            topic, golem_interfaces.HandStatus(head, status.state, status.gap, status.offset, force)
        )


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
        public.gripper(side, "close"): lambda _: Trigger_Response(
            *give(HandGoal(None, magpie_model.MAX_FORCE))
        ),
        public.gripper(side, "set_position"): set_gap,
        public.gripper(side, "set_force"): set_force,
    }
