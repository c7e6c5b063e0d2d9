"""What a stack saw while it was recorded, it sees again when the bag stands in for the robot."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mcap")
pytest.importorskip("rosbags")

from mcap.writer import Writer

from golem.errors import RobotGone
from golem.interfaces import images, topics
from golem.interfaces import ros_convert as convert
from golem.interfaces.payloads import Detections, Exposure
from golem.interfaces.public import CAMERA_INFO, COLOR, DEPTH, gripper, image, optical_frame
from golem.middleware.bags.base import BagError, BagMessage, BagTopic
from golem.middleware.bags.reader import Bag
from golem.middleware.bags.recorder import topic
from golem.middleware.bags.writer import BagWriter
from golem.middleware.bus import News
from golem.middleware.dds.base import LATCHED, SENSOR, Payload
from golem.middleware.ros import codec
from golem.middleware.ros.message import NANO
from golem.middleware.wire import hg
from golem.middleware.wire.convert import encode_low_state
from golem.robots.replay.robot import ReplayRobot, ReplayRobotConfig
from golem.robots.sensors.cameras import HEAD
from golem.runtime.live.broadcast import broadcast
from golem.runtime.lockstep import LockstepRunner, build
from golem.skills.base import SkillResult
from golem.skills.pick import PickGoal
from golem.stack import Choice, Stack, load_stack
from golem.types import SIDES, HandState, Imu, LowCommand, LowState

ZERO = np.zeros(27)
COMMAND = LowCommand(0.0, ZERO, ZERO, ZERO, ZERO, ZERO)
STILL = Imu(np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), np.array([0.0, 0.0, 9.81]))


class Scribe:
    """Writes a log as a robot on a domain would leave it."""

    def __init__(self, folder: Path, origin: float) -> None:
        self._bag, self._origin = BagWriter(folder), origin
        self._topics: dict[str, BagTopic] = {}

    def write(self, name: str, kind: str, payload: Payload, t: float) -> None:
        at = round((self._origin + t) * NANO)
        if name not in self._topics:
            self._topics[name] = topic(name, kind, LATCHED if name == "/tf_static" else SENSOR)
        self._bag.write(BagMessage(self._topics[name], at, at, payload))

    def state(self, t: float) -> None:
        state = LowState(0.0, ZERO + t, ZERO - t, ZERO, STILL)
        self.write("/lowstate", "unitree_hg/msg/LowState", encode_low_state(state), t)

    def hand(self, t: float, gap: float) -> None:
        state = HandState(t, gap, np.full(2, gap / 2.0), np.zeros(2))
        message = convert.hand_state(state, "left")
        self.write(gripper("left", "state"), message.__msgtype__, codec.serialize(message), t)

    def exposure(self, t: float, arrival: float, shade: int) -> None:
        stamp, frame = self._origin + t, optical_frame("head")
        rgb = np.full((HEAD.height, HEAD.width, 3), shade, np.uint8)
        depth = np.full((HEAD.height, HEAD.width), shade / 100.0, np.float32)
        for what, message in (
            (COLOR, images.color_image(stamp, rgb, frame)),
            (CAMERA_INFO, images.camera_info(stamp, replace(HEAD, fx=600.0), frame)),
            (DEPTH, images.depth_image(stamp, depth, frame)),
        ):
            self.write(image("head", what), message.__msgtype__, codec.serialize(message), arrival)

    def calibration(self, T: np.ndarray, parent: str = "head_camera_optical") -> None:
        message = convert.transforms(0.0, [(parent, optical_frame("head"))], T[np.newaxis])
        self.write("/tf_static", message.__msgtype__, codec.serialize(message), 0.0)

    def close(self) -> None:
        self._bag.close()


@pytest.mark.parametrize("origin", [0.0, 1_700_000_000.25], ids=["sim_time", "wall_time"])
def test_everything_comes_at_its_time(tmp_path: Path, origin: float) -> None:
    T = np.eye(4)
    T[:3, 3] = 0.01, -0.02, 0.03
    scribe = Scribe(tmp_path / "bag", origin)
    of_its_driver = np.eye(4)
    of_its_driver[0, 3] = 0.5
    scribe.calibration(of_its_driver, "camera_color_frame")
    scribe.calibration(T)
    scribe.calibration(of_its_driver, "camera_color_frame")
    for k in range(501):
        t = k * 0.002
        scribe.state(t)
        if k % 5 == 2:
            scribe.hand(t, t / 10.0)
        if k % 50 == 30:
            scribe.exposure(t - 0.05, t, k // 10)
    scribe.close()
    robot = ReplayRobot(ReplayRobotConfig(tmp_path / "bag"))
    assert robot.cameras == {"head": replace(HEAD, fx=600.0)}
    np.testing.assert_allclose(robot.calibration["head"], T, atol=1e-12)
    assert robot.hand("left", 0.0).gap == 0.0 and robot.hand("right", 0.0).t == 0.0
    black, nothing = robot.capture("head")
    assert not black.any() and not nothing.any() and black.shape == (480, 640, 3)
    for k in range(500):
        q, dq, _ = robot.joints()
        assert abs(q - k * 0.002).max() < 1e-6 and (dq == -q).all()
        if k == 135:  # 0.27 s: the exposure at 0.21 s is recorded at 0.26 s
            rgb, depth = robot.capture("head")
            assert (rgb == 13).all() and abs(depth - 0.13).max() < 1e-6
            assert robot.hand("left", 7.0).gap == pytest.approx(0.0264) and robot.hand("left", 7.0).t == 7.0
        robot.advance(COMMAND, {}, 0.002)
    with pytest.raises(RobotGone, match=r"ends after 1\.00 s"):
        robot.advance(COMMAND, {}, 0.002)
    robot.close()


def test_memory_is_bounded_when_nobody_looks(tmp_path: Path) -> None:
    scribe = Scribe(tmp_path / "bag", 0.0)
    for k in range(1001):
        scribe.state(k * 0.002)
        if k % 66 == 0:
            scribe.exposure(k * 0.002, k * 0.002, 1)
    scribe.close()
    robot = ReplayRobot(ReplayRobotConfig(tmp_path / "bag"))
    maximum = 0
    for _ in range(1000):
        robot.advance(COMMAND, {}, 0.002)
        maximum = max(maximum, len(robot._log.pictures["head"]._samples))
    assert maximum <= 5


def test_a_restart_in_the_log_is_its_end(tmp_path: Path) -> None:
    scribe = Scribe(tmp_path / "bag", 0.0)
    for t in (5.0, 5.1, 0.0, 0.1):
        scribe.state(t)
    scribe.close()
    robot = ReplayRobot(ReplayRobotConfig(tmp_path / "bag"))
    robot.advance(COMMAND, {}, 0.1)
    with pytest.raises(RobotGone, match=r"ends after 0\.10 s"):
        robot.advance(COMMAND, {}, 0.1)


def test_a_bag_without_a_robot_is_refused(tmp_path: Path) -> None:
    scribe = Scribe(tmp_path / "bag", 0.0)
    scribe.hand(0.0, 0.05)
    scribe.close()
    with pytest.raises(BagError, match="no messages on /lowstate.*it has /left/gripper/state"):
        ReplayRobot(ReplayRobotConfig(tmp_path / "bag"))
    with pytest.raises(BagError, match="No bag at"):
        ReplayRobot(ReplayRobotConfig(tmp_path / "nothing"))


def test_a_topic_without_a_state_is_no_robot(tmp_path: Path) -> None:
    with (tmp_path / "none.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2", library="x")
        schema = writer.register_schema(name="unitree_hg/msg/LowState", encoding="ros2msg", data=b"uint8 x")
        writer.register_channel(topic="/lowstate", message_encoding="cdr", schema_id=schema)
        writer.finish()
    with pytest.raises(BagError, match="Nothing was published on /lowstate"):
        ReplayRobot(ReplayRobotConfig(tmp_path / "none.mcap"))


@pytest.mark.parametrize("what", ["checksum", "zero quaternion", "big endian", "short"])
def test_a_damaged_state_is_named_with_its_place(what: str, tmp_path: Path) -> None:
    scribe = Scribe(tmp_path / "bag", 0.0)
    for k in range(600):
        state = bytearray(encode_low_state(LowState(0.0, ZERO, ZERO, ZERO, STILL)))
        if k == 300 and what == "checksum":
            state[100] ^= 1
        elif k == 300 and what == "zero quaternion":
            at = state.find(np.array([1, 0, 0, 0], "<f4").tobytes())
            state[at : at + 16] = bytes(16)
            hg.STATE_CHECKSUM.seal(state)
        elif k == 300 and what == "big endian":
            state[1] = 0
        elif k == 300:
            del state[-4:]
        scribe.write("/lowstate", "unitree_hg/msg/LowState", bytes(state), k * 0.002)
    scribe.close()
    robot = ReplayRobot(ReplayRobotConfig(tmp_path / "bag"))
    with pytest.raises(BagError, match=r"bag, /lowstate 0\.600 s after its first state: ") as refusal:
        for _ in range(600):
            robot.advance(COMMAND, {}, 0.002)
    assert "\n" not in str(refusal.value)


@dataclass
class Seen:
    """What a stack took in while it picked."""

    exposures: dict[tuple[str, float], Exposure]
    sightings: dict[tuple[str, float], Detections]
    result: SkillResult


def pick(stack: Stack, seconds: float, bag: Path | None) -> Seen:
    """Let `stack` begin to pick, recorded into `bag`."""
    running, robot = build(stack, seed=0)
    frames = [(n, News(running.bus, topics.exposures(n))) for n in robot.cameras]
    found = [News(running.bus, topics.detections(n)) for n in robot.cameras]
    seen = Seen({}, {}, SkillResult(False, "", None, ""))
    with broadcast(running, robot, bag) as show:

        def watch() -> None:
            show()
            for name, news in frames:
                if (exposure := news.read()) is not None:
                    seen.exposures[name, exposure.t] = exposure
            for news in found:
                if (sightings := news.read()) is not None:
                    seen.sightings[sightings.camera, sightings.t] = sightings

        seen.result = running.execute("pick", PickGoal(), seconds, watch=watch)
        watch()  # the last tick
    robot.close()
    return seen


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Seen, Seen, Path]]:
    """The tethered demo's first seconds, until the hand's camera guides the hand: live and from its bag."""
    bag = tmp_path_factory.mktemp("replay") / "bag"
    stack = load_stack("tether")
    live = pick(stack, 7.0, bag)
    again = pick(stack.with_choice("robot", Choice("replay", {"file": str(bag)})), 10.0, None)
    yield live, again, bag


@pytest.mark.slow
def test_a_replayed_stack_sees_the_recorded_frames(runs: tuple[Seen, Seen, Path]) -> None:
    """Colour to the bit, depth to the half millimetre of the sensor's own format."""
    live, again, _ = runs
    assert len(live.exposures) > 10 and {name for name, _ in live.exposures} == {"head", "right_hand"}
    assert again.exposures.keys() == live.exposures.keys()
    for key, exposure in live.exposures.items():
        np.testing.assert_array_equal(again.exposures[key].rgb, exposure.rgb)
        np.testing.assert_array_equal(
            again.exposures[key].depth, images.millimetres(exposure.depth) * np.float32(0.001)
        )


@pytest.mark.slow
def test_a_replayed_stack_detects_the_same(runs: tuple[Seen, Seen, Path]) -> None:
    """The same objects at the same times and pixels; positions to what the millimetres of depth make of them.

    Where head and cover are nearly as common in an object's window, a millimetre may choose the other one.
    """
    live, again, _ = runs
    assert len(live.sightings) > 10 and again.sightings.keys() == live.sightings.keys()
    apart: list[float] = []
    for key, sightings in live.sightings.items():
        for a, b in zip(again.sightings[key].objects, sightings.objects, strict=True):
            assert a.label == b.label and a.detection.score == b.detection.score
            np.testing.assert_array_equal(a.detection.box, b.detection.box)
            np.testing.assert_array_equal(a.detection.center, b.detection.center)
            apart.append(math.dist(a.position, b.position))
    assert len(apart) > 20
    assert np.quantile(apart, 0.9) < 0.001 and max(apart) < 0.010


@pytest.mark.slow
def test_the_end_of_the_recording_ends_the_skill(runs: tuple[Seen, Seen, Path]) -> None:
    _, again, bag = runs
    assert again.result == SkillResult(False, "robot", "robot", f"The recording {bag} ends after 7.00 s.")


@pytest.mark.slow
def test_the_official_reader_reads_every_message(runs: tuple[Seen, Seen, Path]) -> None:
    """The bag holds what the stack took in and did, as ROS messages that another decoder understands."""
    reader, ros2 = pytest.importorskip("mcap.reader"), pytest.importorskip("mcap_ros2.decoder")
    live, _, bag = runs
    counts: dict[str, int] = {}
    first: dict[str, float] = {}
    with (bag / "bag_0.mcap").open("rb") as file:
        for _, channel, record, message in reader.make_reader(
            file, True, [ros2.DecoderFactory()]
        ).iter_decoded_messages():
            counts[channel.topic] = counts.get(channel.topic, 0) + 1
            first.setdefault(channel.topic, record.log_time / NANO)
            if channel.topic == "/lowstate":
                assert message.tick * 1_000_000 == record.log_time
    assert sum(counts.values()) == sum(1 for _ in Bag(bag).messages())
    # Ticks 0 to 3500: the skill is given up within the tick of its deadline, 7 s, and that tick is recorded.
    assert counts["/lowstate"] == counts["/clock"] == counts["/lowcmd"] == 3501
    assert counts["/tf_static"] == counts["/robot_description"] == 1
    for name in ("head", "right_hand"):
        taken = sum(key[0] == name for key in live.exposures)
        assert counts[image(name, COLOR)] == counts[image(name, DEPTH)] == taken
        assert counts[f"/objects/{name}"] == sum(key[0] == name for key in live.sightings)
    assert first["/lowstate"] == first["/clock"] == first["/robot_description"] == 0.0
    assert all(f"/{side}/gripper/state" in counts for side in SIDES)


def test_running_is_the_same_with_and_without_an_audience(tmp_path: Path) -> None:
    """Being recorded changes nothing of a run in lock-step."""

    def q(bag: Path | None) -> np.ndarray:
        running, robot = build(load_stack("tether", profile="field"), seed=3)
        assert isinstance(running, LockstepRunner)
        with broadcast(running, robot, bag) as show:
            running.executor.run(0.1, lambda: show() is not None)
        robot.close()
        return robot.joints()[0]

    np.testing.assert_array_equal(q(None), q(tmp_path / "bag"))
