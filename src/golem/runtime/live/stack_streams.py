"""What a stack reads from and says on the domain where it takes more than a row of the public table."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, Generic, TypeVar

import numpy as np

from golem.capabilities.arms.hand_force import ContactSense, HandForce
from golem.interfaces import images, public, topics
from golem.interfaces import ros_convert as convert
from golem.interfaces.images import Lens, Pairing, to_lens
from golem.interfaces.payloads import Exposure, GateState, GateStatus, HandGoal
from golem.interfaces.ros_convert import MAP_FRAME
from golem.interfaces.unitree_api import ArmSdkCommand
from golem.middleware.bus import Bus, News, Topic
from golem.middleware.ros.future import Future
from golem.middleware.ros.msgs import golem_interfaces, sensor_msgs
from golem.middleware.ros.msgs.geometry_msgs import WrenchStamped
from golem.middleware.ros.msgs.golem_interfaces import HandContact
from golem.middleware.ros.msgs.nav_msgs import Odometry
from golem.middleware.ros.msgs.std_srvs import Trigger_Request, Trigger_Response
from golem.middleware.ros.msgs.tf2_msgs import TFMessage
from golem.middleware.ros.node import RosNode
from golem.middleware.ros.pubsub import Subscription
from golem.middleware.ros.service import Client
from golem.middleware.wire.convert import encode_low_command
from golem.robots.model import magpie_model
from golem.robots.model.imu_mount import sensed_base_rate
from golem.robots.sensors.cameras import CAMERAS
from golem.runtime.executor import Node
from golem.runtime.live.bridge import Encoders
from golem.runtime.live.node_setup import log_line
from golem.runtime.live.role_endpoints import RoleEndpoints
from golem.runtime.live.sim_sync import SILENCE
from golem.runtime.nodes import moving
from golem.runtime.perception_nodes import detection_requested
from golem.types import ARMS, SIDES, TICK, UPPER, Array, BaseEstimate, LowCommand, LowState, Side

RATE = 0.5
"""How fast the weight follows what is asked for [1/s], as xr_teleoperate lets go: 4 rad go by 4 mrad a tick."""
SILENT = 0.25
"""Time without a command after which the arms go back [s] [own: the examples send one each 20 ms]."""
LET_GO = 1.0
"""Time without a command after which whoever held the arms while they were not to be had has let go [s]."""
NOTHING = 1e-3
"""Weight that asks for nothing."""


class ArmSdk:
    """Blends what a program wants of the arms into the motors' command, by its `weight` of 0 to 1."""

    def __init__(self, bus: Bus, closed: Callable[[], bool], tell: Callable[[str], None] = lambda text: None) -> None:
        """Take commands from `bus` unless `closed()`; `tell` says a line to a person."""
        self._news, self._closed, self._tell = News(bus, topics.ARM_SDK), closed, tell
        self._newest: ArmSdkCommand | None = None
        self._heard = self._t = 0.0
        self._held = False
        self.weight = 0.0

    def blend(self, command: LowCommand, t: float) -> LowCommand:
        """Return `command` with the arms as far the program's as it asks for, at robot time `t` [s]."""
        came, dt = self._news.read(), t - self._t
        self._t = t
        if dt < 0.0:  # the robot was restarted
            self._newest, self.weight, dt = None, 0.0, 0.0
        if came is not None:
            self._newest, self._heard = came, t
        silent = t - self._heard
        wanted = 0.0 if self._newest is None or silent > SILENT else self._newest.weight
        if self._closed():
            self._held, wanted = self._held or wanted > NOTHING, 0.0
        elif wanted <= NOTHING and (silent > LET_GO or (silent <= SILENT and self._newest is not None)):
            self._held = False
        before, step = self.weight, RATE * min(dt, TICK)
        wanted = 0.0 if self._held else wanted
        self.weight = min(max(wanted, before - step), before + step)
        if self._newest is None or self.weight <= 0.0:
            return command
        if before <= 0.0:
            self._tell("A program of the vendor's has the arms, by /arm_sdk; the legs go on.")
        w, fields = self.weight, {}
        for k, name in enumerate(("q", "dq", "tau", "kp", "kd")):
            values = getattr(command, name).copy()
            values[ARMS] = (1.0 - w) * values[ARMS] + w * self._newest.motors[k]
            fields[name] = values
        return replace(command, **fields)


T = TypeVar("T")

TOLD = 0.1
"""Time between two reports of what touches a hand where nothing changes [s]."""
AHEAD = 0.05
"""How far ahead of the robot's time an image may be stamped [s] [own]: more, and its clock is another."""


class CameraIn(Node):
    """Subscribes to the images of one camera while a skill looks through it, and brings them to the bus in pairs."""

    period = TICK

    def __init__(self, bus: Bus, endpoints: RoleEndpoints, camera: str) -> None:
        self._t, self._warned = 0.0, False
        self._bus, self._endpoints, self._camera = bus, endpoints, camera
        self._wanted = detection_requested(bus, camera)
        self._open: list[Subscription] = []
        self._lens: Lens | None = None
        self._pairing = Pairing(self._take)

    def step(self, t: float) -> None:
        self._t = t
        if bool(self._open) == self._wanted():
            return
        if self._open:
            self.close()
            return
        callbacks = (
            (public.CAMERA_INFO, self._take_info),
            (public.COLOR, self._pairing.color),
            (public.DEPTH, self._pairing.depth),
        )
        for what, callback in callbacks:
            self._open.append(self._endpoints.subscribe(public.image(self._camera, what), callback))

    def close(self) -> None:
        """Read no more."""
        for subscription in self._open:
            subscription.close()
        self._open.clear()
        self._pairing.clear()

    def _take_info(self, message: sensor_msgs.CameraInfo) -> None:
        known = CAMERAS[self._camera]
        self._lens = to_lens(message, self._camera, known.near, known.far, known.rate)

    def _take(self, color: sensor_msgs.Image, depth: sensor_msgs.Image) -> None:
        lens, rgb, metres = self._lens, images.to_rgb(color), images.to_depth(depth)
        if lens is not None and rgb.shape[:2] == metres.shape == (lens.camera.height, lens.camera.width):
            t = convert.seconds(color.header.stamp)
            if t > self._t + AHEAD:
                self._warn(t)
                return
            self._bus.publish(
                topics.exposures(self._camera), Exposure(t, lens.camera, *lens.straighten(rgb, metres)), t
            )

    def _warn(self, t: float) -> None:
        if not self._warned:
            self._warned = True
            log_line(
                f"Images of the {self._camera} camera are ignored: they are stamped {t:.3f} s, the robot's time is "
                f"{self._t:.3f} s. Start the camera's driver with use_sim_time: /clock is the robot's."
            )


class OnePerTick(Node, Generic[T]):
    """Brings values to the bus one per tick: of those that arrive together the bus would keep the newest alone."""

    period = TICK

    def __init__(self, bus: Bus, topic: Topic[T], most: int) -> None:
        """Bring them to `topic` of `bus`; of more than `most` that wait the oldest are dropped."""
        self._bus, self._topic = bus, topic
        self._waiting: deque[T] = deque(maxlen=most)

    def take(self, value: T) -> None:
        """Take a value."""
        self._waiting.append(value)

    def step(self, t: float) -> None:
        if self._waiting:
            self._bus.publish(self._topic, self._waiting.popleft(), t)


class GateIn(Node):
    """Brings the verdicts of the safety gate to the bus; a gate that is silent counts as shut."""

    period = TICK

    def __init__(self, bus: Bus, clock: Callable[[], float] = time.monotonic) -> None:
        """Bring them to `bus`; `clock` is this process's own [s]."""
        self._bus, self._clock = bus, clock
        self._heard_at, self._t = -SILENCE, 0.0
        self._status: GateStatus | None = None

    def step(self, t: float) -> None:
        self._t = t
        silent = self._clock() - self._heard_at > SILENCE
        if silent or self._status is None:
            moved = self._status is not None and self._status.state in (GateState.ACTIVE, GateState.STOP2)
            text = LOST if moved else "the safety process is silent"
            self._bus.publish(topics.SAFETY, GateStatus(t, GateState.INIT, None, text), t)
        else:
            self._bus.publish(topics.SAFETY, self._status, t)

    def take(self, status: GateStatus) -> None:
        """Take a verdict; the gate's clock is none of ours."""
        self._heard_at, self._status = self._clock(), replace(status, t=self._t)


class RemoteGantry:
    """The band of a twin that stands, let go by a call, as far as is known; see `HasGantry`."""

    def __init__(self, node: RosNode) -> None:
        self._client: Client = node.client("/elastic_band/release", public.TRIGGER)
        self._answer: Future[Trigger_Response] | None = None
        self.on_gantry = True

    def release(self) -> None:
        """Ask for it; the answer comes later, and a call that fails is made again."""
        if self._answer is None and self._client.ready():
            self._answer = self._client.call(Trigger_Request())
            self._answer.then(self._answered)

    def renew(self) -> None:
        """Begin anew: the robot was started again."""
        self._answer, self.on_gantry = None, True

    def _answered(self, answer: Future[Trigger_Response]) -> None:
        if answer is not self._answer:
            return
        self._answer = None
        try:
            answer.result()
        except Exception:  # whatever became of the call: it is made again
            return
        # Let go, or there was none.
        self.on_gantry = False


LOST = "ALARM, the safety gate is silent, and the robot was moving: press the robot's own emergency stop"
MEAN = 5
"""Messages of a hand's wrench whose mean is sent: the torques of one tick are off by 2 to 3 N at the hand."""
SHUT = "The safety gate is shut, see /safety/status."


def encoders(
    bus: Bus, mode_machine: Callable[[], int], joint_offset: Array | None = None, arms: ArmSdk | None = None
) -> Encoders:
    """Return what makes the messages that take the newest state on `bus` beside their value.

    Args:
        mode_machine: returns the machine type that the robot reports, which its commands repeat.
        joint_offset: (27,) reported minus true joint positions by calibration [rad]; None believes them.
        arms: who else may have the arms; what a program of the vendor's tells them is in reported positions.
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
        if arms is not None:
            command = arms.blend(command, state.t)
        return encode_low_command(command, mode_machine(), answers=state.t)

    force = HandForce()
    felt = {public.wrench(side): partial(_felt, force, side, deque(maxlen=MEAN)) for side in SIDES}
    touched = {public.contact(side): partial(_touched, ContactSense(side), force, side) for side in SIDES}
    return {"/odom": odometry, "/tf": frames, "/safety/lowcmd_in": request, **felt, **touched}


def _felt(force: HandForce, side: Side, last: deque[Array], state: LowState) -> WrenchStamped:
    """Return the mean of `last`, the wrenches that a hand felt of late, with that of `state`."""
    last.append(-force.wrench(side, state.q[UPPER], state.tau[UPPER]))
    return convert.wrench(state.t, f"{side}_gripper", np.mean(last, axis=0))


def _touched(sense: ContactSense, force: HandForce, side: Side, state: LowState) -> HandContact | None:
    """Return whether something touches a hand, where that has changed, and every `TOLD`."""
    q = state.q[UPPER]
    changed = sense.step(state)
    if not changed and round(state.t / TICK) % round(TOLD / TICK):
        return None
    stamped = convert.wrench(state.t, f"{side}_gripper", -sense.change)
    return HandContact(stamped.header, sense.touching, stamped.wrench, force.covariance(side, q).ravel())


def hand_services(bus: Bus, side: Side, now: Callable[[], float]) -> dict[str, Callable[[Any], Any]]:
    """Return what answers the services of one hand, whose controller reads `bus`; `now` is robot time [s]."""

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
