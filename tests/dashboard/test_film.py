from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from golem.dashboard.film import WEBP_SCALE, Film
from golem.errors import OutputError
from golem.runtime.lockstep import LockstepRunner

SIZE = (240, 136)


def test_a_picture_is_taken_once_per_period(twin: tuple[LockstepRunner, Any]) -> None:
    running, robot = twin
    film = Film(robot, SIZE, fps=25.0)

    def over() -> bool:
        film.tick(running)
        return False

    running.executor.run(0.2, over)
    film.close()
    assert len(film) == 5  # at 0.002 s, then every 0.04 s


def test_the_film_is_a_webp_of_the_right_length(twin: tuple[LockstepRunner, Any], tmp_path: Path) -> None:
    running, robot = twin
    film = Film(robot, SIZE, fps=10.0)
    for i in range(4):
        film.headline = f"{i} of 3"
        film.frame(running)
    files = film.save(tmp_path / "film.webp")
    film.close()
    assert files[0] == tmp_path / "film.webp"
    assert sorted(tmp_path.iterdir()) == sorted(files)  # nothing half-written stays
    with Image.open(files[0]) as webp:
        assert webp.size == (round(SIZE[0] * WEBP_SCALE), round(SIZE[1] * WEBP_SCALE))
        assert getattr(webp, "n_frames", 1) == 4
        webp.seek(3)
        shown = np.asarray(webp.convert("RGB"), dtype=float)
    assert np.abs(shown - film.picture(3, WEBP_SCALE)).mean() < 6.0


def test_a_film_without_pictures_is_refused(twin: tuple[LockstepRunner, Any], tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="No picture"):
        Film(twin[1], SIZE).save(tmp_path / "film.webp")
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_is_named(twin: tuple[LockstepRunner, Any], tmp_path: Path) -> None:
    running, robot = twin
    (tmp_path / "taken").write_text("a file")
    film = Film(robot, SIZE)
    film.frame(running)
    with pytest.raises(OutputError, match="taken"):
        film.save(tmp_path / "taken" / "film.webp")
    film.close()
