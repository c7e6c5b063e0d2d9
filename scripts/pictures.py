"""Takes the pictures of the documentation: `python scripts/pictures.py docs/images`."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

from PIL import Image

from golem.dashboard.film import Film
from golem.dashboard.status import Timeline
from golem.errors import GolemError
from golem.robots.mujoco.balance import BalanceRecorder
from golem.robots.mujoco.spectator import Shot, SpectatorView
from golem.runtime.lockstep import build
from golem.skills.pick_config import PickGoal
from golem.stack import Stack, load_stack

PULL = Shot(look_at=(0.30, 0.0, 0.90), azimuth=55.0, elevation=-12.0, distance=2.6, fovy=45.0)
PULLED = 1.15
"""Time into the extraction at which the picture is taken [s]: the screw is out, and still above its bore."""


def take(folder: Path, stack: Stack, seed: int = 0) -> list[Path]:
    """Write `pull.png` and `pick.webp`: the second pick, whose screw no tray hides.

    Args:
        folder: where to.
        stack: what works.
        seed: seed of the episode.

    Returns:
        The files.

    Raises:
        GolemError: a pick failed.
    """
    running, robot = build(stack, seed)
    recorder = BalanceRecorder(robot)
    film = Film(robot, fps=10.0, recorder=recorder)
    timeline = Timeline()
    picture = folder / "pull.png"
    taken = False

    def watch() -> None:
        nonlocal taken
        recorder(running.executor.t)
        film.tick(running)
        timeline.update(running)
        stage, since = timeline.stages[-1] if timeline.stages else ("", 0.0)
        if not taken and stage == "extract" and running.executor.t - since > PULLED:
            taken = True
            view = SpectatorView(robot, {"pull": PULL}, (1280, 720), fancy=True)
            Image.fromarray(view.picture("pull")).save(picture, optimize=True)
            view.close()

    def pick(watch: Callable[[], None]) -> None:
        result = running.execute("pick", PickGoal(), watch=watch)
        if not result.success:
            raise GolemError(f"No picture: {result.reason}")

    try:
        pick(lambda: recorder(running.executor.t))
        timeline = Timeline.of(running)
        pick(watch)
        film_file, *rest = film.save(folder / "pick.webp")
        for other in rest:
            other.unlink()
    finally:
        film.close()
        robot.close()
    return [picture, film_file]


if __name__ == "__main__":
    print(*take(Path(sys.argv[1]), load_stack("stand")), sep="\n")
