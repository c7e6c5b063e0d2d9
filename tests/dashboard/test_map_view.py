"""What is remembered is on the picture of the map, and what is gone is faint."""

from __future__ import annotations

import numpy as np
import pytest

from golem.dashboard.map_picture import FAINT, INK, MapPicture
from golem.dashboard.status import place_words
from golem.interfaces.memory_payloads import RememberedPlace
from golem.interfaces.nav_payloads import OccupancyGrid
from golem.types import PlanarPose


def picture() -> MapPicture:
    return MapPicture(OccupancyGrid(0.0, PlanarPose(-4.0, -3.0, 0.0), 0.1, np.zeros((60, 80), np.int8)), 4)


@pytest.mark.parametrize(("x", "y"), [(0.0, 0.0), (3.0, -2.0), (-2.0, 2.5)])
def test_a_mark_is_where_a_dot_of_the_same_place_is(x: float, y: float) -> None:
    dots, marks = picture(), picture()
    dots.dots(np.array([[x, y]]), (255, 0, 0))
    marks.mark(np.array([x, y]), "", (255, 0, 0))
    (dot,) = np.argwhere((dots.rgb() == (255, 0, 0)).all(axis=2))
    middle = np.argwhere((marks.rgb() == (255, 0, 0)).all(axis=2)).mean(axis=0)
    assert np.abs(middle - dot).max() <= 1.0


@pytest.mark.parametrize(("y", "colour"), [(0.0, FAINT), (-2.9, INK), (2.9, INK)])
def test_words_stay_inside_the_picture_and_have_their_colour(y: float, colour: tuple[int, int, int]) -> None:
    plain, marked = picture().rgb(), picture()
    marked.mark(np.array([0.0, y]), "bottle 12 s", colour)
    rgb = marked.rgb()
    changed = np.argwhere((rgb != plain).any(axis=2))
    assert len(changed) > 200 and np.ptp(changed[:, 1]) > 50  # whole words, also at the right edge
    assert (rgb == colour).all(axis=2).sum() > 40


def test_words_of_things_side_by_side_do_not_cover_each_other() -> None:
    def red(*colours: tuple[int, int, int]) -> int:
        view = picture()
        for colour in colours:
            view.mark(np.array([0.5, 0.5]), "bottle 12 s", colour)
        rgb = view.rgb().astype(int)
        dot = np.argwhere((rgb == colours[-1]).all(axis=2))[:, 1].min()
        return int((rgb[:, dot + 12 :, 0] > rgb[:, dot + 12 :, 2] + 40).sum())

    first, last = (220, 0, 0), (0, 0, 220)
    assert red(first) > 50 and red(first, last) >= 0.9 * red(first)


@pytest.mark.parametrize(
    ("age", "there", "words"),
    [(12.4, True, "mug 12 s"), (600.0, True, "mug 10 min"), (86400.0, True, "mug 24 h"), (5.0, False, "mug, gone")],
)
def test_what_is_written_beside_a_place(age: float, there: bool, words: str) -> None:
    assert place_words(RememberedPlace("mug", 0.0, 0.0, age, there)) == words
