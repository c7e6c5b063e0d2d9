"""The same seed gives the same run, bit for bit: every state, every frame, every result."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from golem.interfaces import topics
from golem.runtime.lockstep import LockstepRunner, build
from golem.skills.base import SkillResult
from golem.skills.context import Context
from golem.stack import Stack

# Sees "something" where the depth image is deepest: needs no weights and depends on every pixel.
EYES = """
import numpy as np
from golem.types import Detection, LocalizedObject

class Eyes:
    latency = 0.05

    def locate(self, frame, labels):
        v, u = np.unravel_index(np.argmax(frame.depth), frame.depth.shape)
        z = float(frame.depth[v, u])
        ray = np.array([(u - frame.info.cx) / frame.info.fx, (v - frame.info.cy) / frame.info.fy, 1.0])
        position = frame.T_odom_optical[:3, :3] @ (z * ray) + frame.T_odom_optical[:3, 3]
        center = np.array([float(u), float(v)])
        detection = Detection(labels[0], 0.5, np.concatenate([center - 5, center + 5]), center)
        return [LocalizedObject(detection, frame.t, position, position[None])]
"""


@dataclass
class Reach:
    """Goes a little towards what each camera shows, and closes the hand."""

    name: str = "reach"

    async def run(self, context: Context, goal: None) -> SkillResult:
        arm, hand = context.arms["right"], context.hands["right"]
        hand.close(8.0)
        found: dict[str, float] = {}
        for camera in ("head", "right_hand"):
            with context.watch(camera, "something") as eye:
                sightings = await eye.look(0.5)
                assert sightings is not None
            target = sightings.objects[0].position
            found |= {f"{camera}_{axis}": float(x) for axis, x in zip("xyz", target, strict=True)}
            T = arm.commanded.copy()
            way = target - T[:3, 3]
            T[:3, 3] += 0.02 * way / np.linalg.norm(way)
            await arm.move(T, 0.2)
        return SkillResult(True, "done", None, "Reached.", found | {"gap": hand.status.gap, "t": context.t})


@dataclass(frozen=True)
class Trace:
    """Everything that came out of a run: hashes of streams, and the result."""

    states: str
    frames: str
    result: SkillResult


def trace(eyes: Path, seed: int, profile: str) -> Trace:
    running, robot = build(Stack(profile=profile).with_choice("localizer", f"{eyes}:Eyes"), seed)
    states, frames = hashlib.sha256(), hashlib.sha256()
    counts = dict.fromkeys(robot.cameras, 0)

    def record(running: LockstepRunner) -> None:
        state = running.bus.latest(topics.LOW_STATE)
        base = running.bus.latest(topics.BASE)
        assert state is not None and base is not None
        for a in (state.q, state.dq, state.tau, state.imu.quat, state.imu.gyro, state.imu.acc, base.T_odom_base):
            states.update(np.ascontiguousarray(a).tobytes())
        for camera in counts:
            count = running.bus.count(topics.rgbd_images(camera))
            frame = running.bus.latest(topics.rgbd_images(camera))
            if frame is not None and count != counts[camera]:
                counts[camera] = count
                for a in (frame.rgb, frame.depth, frame.T_odom_optical):
                    frames.update(np.ascontiguousarray(a).tobytes())

    run = running.start(Reach(), None)
    while run.result is None and running.executor.t < 2.0:
        running.executor.step()
        record(running)
    robot.close()
    assert run.result is not None and run.result.success, run.result
    assert counts["head"] > 0 and counts["right_hand"] > 0
    return Trace(states.hexdigest(), frames.hexdigest(), run.result)


@pytest.fixture
def eyes(tmp_path: Path) -> Path:
    """The file of the stand-in localizer."""
    path = tmp_path / "eyes.py"
    path.write_text(EYES)
    return path


@pytest.mark.parametrize("profile", ["ideal", "field"])
def test_the_same_seed_gives_the_same_run(eyes: Path, profile: str) -> None:
    assert trace(eyes, 3, profile) == trace(eyes, 3, profile)


def test_another_seed_gives_another_run(eyes: Path) -> None:
    one, two = trace(eyes, 3, "field"), trace(eyes, 4, "field")
    assert one.states != two.states
    assert one.frames != two.frames
    assert one.result != two.result


def test_another_profile_gives_another_run(eyes: Path) -> None:
    assert trace(eyes, 3, "ideal").states != trace(eyes, 3, "bench").states
