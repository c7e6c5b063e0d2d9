"""Draw a map: the LiDAR of a robot that stands still, three scans of a furnished hall, and a picture of the floor."""

from __future__ import annotations

import tempfile
from pathlib import Path

import cv2
import numpy as np

from golem.capabilities.mapping.voxel_grid import VoxelGridMapper
from golem.dashboard.map_picture import ROBOT, MapPicture
from golem.evaluation.episodes.episode import legs_stack
from golem.interfaces import topics
from golem.middleware.bus import News
from golem.runtime.lockstep import build
from golem.types import PlanarPose


def main() -> None:
    stack = legs_stack("almi", "bench", {"odometry": "lio"}, {"world": "furnished"})
    running, robot = build(stack, seed=0)
    mapper, scans = VoxelGridMapper(), News(running.bus, topics.SCAN)
    while running.executor.t < 2.0:
        running.executor.step()
        scan = scans.read()
        if scan is not None:
            mapper.add_scan(scan)
    robot.close()
    grid = mapper.grid()
    assert grid is not None
    picture = MapPicture(grid)
    picture.pose(PlanarPose(0.0, 0.0, 0.0), ROBOT)
    path = Path(tempfile.gettempdir()) / "golem_map.png"
    cv2.imwrite(str(path), picture.rgb()[..., ::-1])
    print(f"{np.count_nonzero(grid.cells > 50)} cells of {grid.resolution:.2f} m are taken; see {path}")


if __name__ == "__main__":
    main()
