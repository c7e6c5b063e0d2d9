"""One second of a stack: recorded at once, by way of a bag, and back into one."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("pyarrow")
pytest.importorskip("av")
pytest.importorskip("mcap")
from tests.dashboard.conftest import BLIND

from golem.datasets import commands
from golem.datasets.commands import PictureOptions
from golem.datasets.commands import findings as check
from golem.datasets.episode_writer import DatasetWriter
from golem.datasets.sampling import StackRecorder, recipe
from golem.datasets.schema import DatasetError
from golem.datasets.store import DatasetFolder
from golem.errors import ConfigError
from golem.interfaces import topics
from golem.middleware.bags.reader import Bag
from golem.run import on_air
from golem.runtime.lockstep import build
from golem.stack import Stack

PICTURES = PictureOptions(fps=20, cameras=("right_hand",), width=96, depth=True)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the data set `direct` and the bag `bag` of the same second and a half."""
    folder = tmp_path_factory.mktemp("recorded")
    what = PICTURES.recipe()
    running, robot = build(Stack(profile="bench").with_choice("localizer", BLIND), 0)
    with (
        closing(robot),
        closing(DatasetWriter(folder / "direct", what)) as writer,
        on_air(running, robot, folder / "bag") as show,
    ):
        running.executor.add(StackRecorder(writer, what, running.bus, "Hang."))
        running.start("stand", {"seconds": 9.0})

        def over() -> bool:
            show()
            return running.executor.t >= 1.5

        running.executor.run(9.0, over)
        writer.finish()
    return folder


@pytest.mark.slow
def test_a_bag_exports_to_what_was_recorded_at_once(recorded: Path) -> None:
    assert commands.export(recorded / "bag", recorded / "exported", pictures=PICTURES) == 1
    direct, exported = DatasetFolder(recorded / "direct"), DatasetFolder(recorded / "exported")
    assert [*check(direct)] == [*check(exported)] == []
    a, b = direct.episodes[0], exported.episodes[0]
    # The bag says when a thing was published, so its frames may lie a tick beside; those of one state are the same.
    x, y = direct.values(a, "observation.state"), exported.values(b, "observation.state")
    nearest = [int(np.abs(y - row).max(1).argmin()) for row in x[2:-2]]
    worst = max(float(np.abs(y[k] - row).max()) for k, row in zip(nearest, x[2:-2], strict=True))
    assert abs(a.length - b.length) <= 2 and len(set(nearest)) == len(nearest)
    assert worst < 1e-6, worst


@pytest.mark.slow
def test_an_episode_becomes_a_bag_that_stands_in_for_the_robot(recorded: Path) -> None:
    from golem.robots.replay.robot import ReplayRobot, ReplayRobotConfig

    assert commands.to_bag(recorded / "direct", recorded / "again") > 100
    assert "/realsense/right_hand/color/image_raw" in Bag(recorded / "again").topics
    robot = ReplayRobot(ReplayRobotConfig(recorded / "again"))
    data = DatasetFolder(recorded / "direct")
    state = data.values(data.episodes[0], "observation.state")
    np.testing.assert_allclose(robot.joints()[0], state[0, :27], atol=1e-6)
    assert robot.capture("right_hand")[0].shape == (270, 480, 3)
    with pytest.raises(DatasetError, match="no 7"):
        commands.to_bag(recorded / "direct", recorded / "other", episode=7)


def test_cameras_and_sizes_are_checked() -> None:
    for wrong in (("nose",), 0), (("head",), 9), (("head",), 9999):
        with pytest.raises(ConfigError):
            recipe(15, *wrong, False, ())
    size = recipe(15, ("right_hand",), 97, True, ("screw",)).features()["observation.images.right_hand"].shape
    assert size == (54, 96, 3)


def test_a_recorder_keeps_the_last_stretch_of_its_stages() -> None:
    from golem.interfaces.payloads import Feedback
    from golem.middleware.bus import Bus

    bus, calls = Bus(), list[str]()

    class Writer:
        def begin(self, task: str) -> None:
            calls.append("begin")

        def add(self, frame: Any) -> None:
            calls.append("add")

    node = StackRecorder(Writer(), recipe(10, (), 0, False, ()), bus, "x", ("servo",))  # type: ignore[arg-type]
    node._sampler.frame = lambda: {}  # type: ignore[method-assign]
    for t, stage in enumerate(("detect", "servo", "servo", "approach", "servo", "pull")):
        bus.publish(topics.FEEDBACK, Feedback(float(t), "pick", stage, ""), float(t))
        node.step(float(t))
    assert calls == ["begin", "add", "add", "begin", "add"] and node.begun
