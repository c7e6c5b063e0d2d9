"""One process of the bench: the robot's or the controller's side of a 500 Hz loop, or a viewer of images.

The robot's side encodes a state with checksum, writes it and takes commands; the controller decodes each state as it
comes and answers it. States have numbers from 1; those with number 0 come before and are not measured: who has found
the other need not have been found by it, and what is written until then has no reader. All measure on this machine's
monotonic clock and print one line of JSON at the end.
"""

from __future__ import annotations

import argparse
import json
import sys
import threading
import time
from collections.abc import Callable

import numpy as np

from golem.errors import GolemError
from golem.middleware.dds.base import SENSOR, DdsError, Qos
from golem.middleware.dds.connect import connect
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.dds.endpoints import CycloneReader, CycloneWriter
from golem.middleware.dds.participant import CycloneParticipant
from golem.middleware.ros import codec, names
from golem.middleware.ros.message import Message
from golem.middleware.wire import convert, hg
from golem.types import NUM_JOINTS, Imu, LowCommand, LowState

PERIOD_NS = 2_000_000
IMAGE_PERIOD, CLOUD_PERIOD = 1.0 / 15.0, 0.1
OFFERED = Qos(depth=8)
PATIENT = Qos(depth=256)
"""What a reader asks for that may be kept off its processor for half a second."""
ZEROS = np.zeros(NUM_JOINTS)
UPRIGHT = Imu(np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), np.array([0.0, 0.0, 9.81]))
"""Joints and IMU of a robot at rest; made once, since what encodes a state is timed."""
CAMERAS = ("head", "left_hand", "right_hand")
COLOR, DEPTH, CLOUD = "color/image_raw", "aligned_depth_to_color/image_raw", "livox/pointcloud"


def main() -> None:
    """Run the side that the arguments name."""
    parser = argparse.ArgumentParser()
    parser.add_argument("side", choices=("robot", "controller", "viewer"))
    parser.add_argument("--domain", type=int, required=True)
    parser.add_argument("--interface", required=True)
    parser.add_argument("--seconds", type=float, required=True)
    parser.add_argument("--cameras", action="store_true")
    arguments = parser.parse_args()
    participant = connect(DdsConfig(arguments.domain, arguments.interface))
    if arguments.side == "robot":
        result = robot(participant, arguments.seconds, arguments.cameras)
    else:
        result = (controller if arguments.side == "controller" else viewer)(participant)
    participant.close()
    print(json.dumps(result))


def robot(participant: CycloneParticipant, seconds: float, cameras: bool) -> dict[str, object]:
    """Write states at 500 Hz; return when each began to be encoded, and which commands came."""
    writer = participant.writer("rt/lowstate", hg.LOW_STATE.type_name, OFFERED)
    reader = participant.reader("rt/lowcmd", hg.LOW_CMD.type_name, PATIENT)
    _wait_for_an_answer(writer, reader)
    count = int(seconds * 1e9 / PERIOD_NS)
    began, answered = np.zeros(count, np.int64), []
    side = Imagery(participant) if cameras else None
    cpu, start = time.process_time(), time.monotonic_ns()
    for i in range(count):
        sleep_until(start + i * PERIOD_NS)
        began[i] = time.monotonic_ns()
        writer.write(_state(i + 1))
        for sample in reader.take():
            convert.decode_low_command(sample.payload, 0.0)
            answered.append(round(convert.answered(sample.payload) * 1e3))
    spent, wall = time.process_time() - cpu, (time.monotonic_ns() - start) * 1e-9
    time.sleep(0.5)
    answered += [round(convert.answered(sample.payload) * 1e3) for sample in reader.take(1 << 20) if sample.alive]
    images = side.stop() if side is not None else {}
    return {"began": began.tolist(), "answered": answered, "cpu": spent, "wall": wall, "images": images}


def _state(number: int) -> bytes:
    """Encode the state of a robot at rest, its number in milliseconds of its time."""
    return convert.encode_low_state(LowState(number * 1e-3, ZEROS, ZEROS, ZEROS, UPRIGHT))


def _wait_for_an_answer(writer: CycloneWriter, reader: CycloneReader) -> None:
    """Write states of number 0 until a command comes.

    Raises:
        DdsError: none came within 20 s.
    """
    end = time.monotonic() + 20.0
    while not reader.take():
        if time.monotonic() > end:
            raise DdsError("No answer of the controller's process came within 20 s.")
        writer.write(_state(0))
        time.sleep(0.02)


def controller(participant: CycloneParticipant) -> dict[str, object]:
    """Decode and answer every state until standard input ends.

    Returns when each had been decoded [ns], and how long after it was written its bytes were there [us].
    """
    came: list[tuple[int, int, float]] = []
    command = LowCommand(0.0, *(np.zeros(NUM_JOINTS) for _ in range(5)))
    writer = participant.writer("rt/lowcmd", hg.LOW_CMD.type_name, OFFERED)

    def on_state() -> None:
        samples, taken = reader.take(), time.time()
        for sample in samples:
            if sample.alive:
                state = convert.decode_low_state(sample.payload)
                way = (taken - sample.source_time) * 1e6
                came.append((round(state.t * 1e3), time.monotonic_ns(), way))
                writer.write(convert.encode_low_command(command, convert.MODE_MACHINE, state.t))

    reader = participant.reader("rt/lowstate", hg.LOW_STATE.type_name, PATIENT, on_data=on_state)
    cpu = wait_for_stop()
    return {"came": came, "cpu": cpu}


def viewer(participant: CycloneParticipant) -> dict[str, object]:
    """Take images and clouds until standard input ends; return how many bytes came of each topic."""
    came: dict[str, list[int]] = {}

    def watch(topic: str, type_name: str) -> None:
        sizes = came[topic] = []

        def on_data() -> None:
            sizes.extend(len(sample.payload) for sample in reader.take() if sample.alive)

        reader = participant.reader(names.topic(topic), codec.dds_name(type_name), SENSOR, on_data=on_data)

    for camera in CAMERAS:
        for kind in (COLOR, DEPTH):
            watch(f"/realsense/{camera}/{kind}", "sensor_msgs/msg/Image")
    watch("/" + CLOUD, "sensor_msgs/msg/PointCloud2")
    cpu = wait_for_stop()
    return {"came": {topic: len(sizes) for topic, sizes in came.items()}, "cpu": cpu}


def wait_for_stop() -> float:
    """Wait for the end of standard input; return the processor time that this process spent meanwhile [s]."""
    print("ready", flush=True)
    sys.stdin.readline()
    cpu = time.process_time()
    sys.stdin.read()
    return time.process_time() - cpu


class Imagery:
    """Publishes three RGB-D cameras of 640 x 480 at 15 Hz and a cloud of 320 kB at 10 Hz, in a thread of its own."""

    def __init__(self, participant: CycloneParticipant) -> None:
        """Start."""
        self._spent: dict[str, list[float]] = {"image": [], "cloud": []}
        self._stopped = threading.Event()
        image, cloud = codec.message("sensor_msgs/msg/Image"), codec.message("sensor_msgs/msg/PointCloud2")
        rng = np.random.default_rng(0)
        color = image(height=480, width=640, encoding="rgb8", step=1920)
        color.data = rng.integers(0, 256, 480 * 1920, np.uint8)
        depth = image(height=480, width=640, encoding="16UC1", step=1280)
        depth.data = rng.integers(0, 256, 480 * 1280, np.uint8)
        points = cloud(height=1, width=20_000, point_step=16, row_step=320_000)
        points.data = rng.integers(0, 256, 320_000, np.uint8)

        def sender(topic: str, type_name: str, message: Message, kind: str) -> Callable[[], None]:
            writer = participant.writer(names.topic(topic), codec.dds_name(type_name), SENSOR)

            def send() -> None:
                start = time.thread_time()
                writer.write(codec.serialize(message))
                self._spent[kind].append(time.thread_time() - start)

            return send

        self._images = [
            sender(f"/realsense/{camera}/{kind}", "sensor_msgs/msg/Image", message, "image")
            for camera in CAMERAS
            for kind, message in ((COLOR, color), (DEPTH, depth))
        ]
        self._cloud = sender("/" + CLOUD, "sensor_msgs/msg/PointCloud2", points, "cloud")
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def stop(self) -> dict[str, list[float]]:
        """Stop, and return the processor time of each publication, serialising included [s]."""
        self._stopped.set()
        self._thread.join()
        return self._spent

    def _run(self) -> None:
        """Send what is due: every camera at a time of its own within the period, as cameras of their own clocks do."""
        start = time.monotonic()
        due = [start + i * IMAGE_PERIOD / len(CAMERAS) for i in range(len(CAMERAS))] + [start]
        while not self._stopped.is_set():
            i = due.index(min(due))
            time.sleep(max(0.0, due[i] - time.monotonic()))
            if i < len(CAMERAS):
                for send in self._images[2 * i : 2 * i + 2]:
                    send()
                due[i] += IMAGE_PERIOD
            else:
                self._cloud()
                due[i] += CLOUD_PERIOD


def sleep_until(due: int) -> None:
    """Sleep until the monotonic clock shows `due` [ns]."""
    time.sleep(max(0, due - time.monotonic_ns()) * 1e-9)


if __name__ == "__main__":
    try:
        main()
    except GolemError as error:
        sys.exit(f"golem: {error}")
