"""A walk in a bag holds what the sensors said, and what was true."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

pytest.importorskip("mcap")

from golem.errors import OutputError  # noqa: E402
from golem.evaluation.conformance.room import ROOM, MadeWalk  # noqa: E402
from golem.evaluation.episodes.lidar_walk import LidarWalk  # noqa: E402
from golem.evaluation.rungs.odometry import TRUTH, WalkBag  # noqa: E402
from golem.interfaces import lidar_convert  # noqa: E402
from golem.interfaces.lidar import ExternalOdometry, LidarImu, LidarScan  # noqa: E402
from golem.middleware.bags.reader import Bag  # noqa: E402
from golem.middleware.ros import codec  # noqa: E402
from golem.robots.model.spatial import transform  # noqa: E402


def test_what_was_said_comes_back_with_the_truth(tmp_path: Path) -> None:
    made = MadeWalk(ROOM, still=0.0, every=20)
    t = np.array([0.002 * k for k in range(200)])
    T = np.array([transform((made.way(at), 0.0, 0.0)) for at in t.tolist()])
    walk = LidarWalk(7, "field", cast(Any, None), t, np.zeros((200, 1)), np.zeros((200, 1)), [], T, "")
    bag = WalkBag(tmp_path / "walk", walk)
    said = [r for tenth in made.tenths(0.3) for r in tenth if not isinstance(r, ExternalOdometry)]
    for reading in said:
        bag.write(reading)
    bag.close()
    read = Bag(tmp_path / "walk")
    assert read.custom["seed"] == "7" and read.custom["profile"] == "field"
    names = [message.topic.name for message in read.messages()]
    assert names.count("/livox/imu") == sum(isinstance(r, LidarImu) for r in said) == 60
    assert names.count("/livox/pointcloud") == names.count("/livox/lidar") == 3
    scans = [r for r in said if isinstance(r, LidarScan)]
    for message in read.messages(["/livox/pointcloud", TRUTH]):
        value = codec.deserialize(message.payload, codec.message(message.topic.kind))
        if message.topic.name == TRUTH:
            back = lidar_convert.to_odometry(value)
            assert back.T_frame_child[0, 3] == pytest.approx(made.way(back.t), abs=1e-6)
        else:
            back = lidar_convert.to_scan(value)
            (scan,) = [s for s in scans if abs(s.t - back.t) < 1e-3]
            np.testing.assert_array_equal(scan.points, back.points)
    with pytest.raises(OutputError, match="exists already"):
        WalkBag(tmp_path / "walk", walk)
