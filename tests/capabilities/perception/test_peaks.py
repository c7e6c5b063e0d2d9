"""Maps to detections: sub-pixel centres with integer pixel centres, boxes, classes, thresholds."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from golem.capabilities.perception.peaks import STRIDE, find_peaks, normalise

LABELS = ("screw", "tray")
SIZE = (64, 48)


def empty() -> NDArray[np.float32]:
    """Return maps with nothing in them, for an image of `SIZE`."""
    maps = np.zeros((len(LABELS) + 6, SIZE[1] // STRIDE, SIZE[0] // STRIDE), np.float32)
    maps[: len(LABELS)] = -10.0
    return maps


def test_the_middle_of_a_cell_lies_between_its_pixels() -> None:
    maps = empty()
    maps[0, 3, 5] = 2.0
    (found,) = find_peaks(maps, LABELS, {"screw"}, 0.3, SIZE)
    # Cell 5 stands for the pixels 20, 21, 22, 23, whose centres are at these integers.
    np.testing.assert_allclose(found.center, [np.mean([20, 21, 22, 23]), np.mean([12, 13, 14, 15])])
    assert found.label == "screw"
    np.testing.assert_allclose(found.score, 1 / (1 + np.exp(-2.0)))


def test_offset_and_sides_are_decoded() -> None:
    maps = empty()
    maps[1, 4, 6] = 0.5
    maps[2:, 4, 6] = [0.25, -0.5, *np.log([3.0, 4.0, 5.0, 6.0])]
    (found,) = find_peaks(maps, LABELS, {"screw", "tray"}, 0.3, SIZE)
    x, y = 4 * 6.25 + 1.5, 4 * 3.5 + 1.5
    np.testing.assert_allclose(found.center, [x, y])
    np.testing.assert_allclose(found.box, [x - 3, y - 4, x + 5, y + 6], rtol=1e-6)


def test_a_box_is_clipped_to_the_image_and_a_centre_outside_is_dropped() -> None:
    maps = empty()
    maps[0, 2, 1] = maps[0, 8, 15] = 3.0
    maps[4:, 2, 1] = np.log(30.0)
    maps[2, 8, 15] = 2.0
    (found,) = find_peaks(maps, LABELS, {"screw"}, 0.3, SIZE)
    np.testing.assert_allclose(found.box, [0, 0, 35.5, 39.5], rtol=1e-6)


def test_only_wanted_peaks_over_the_threshold_and_best_first() -> None:
    maps = empty()
    maps[0, 2, 2], maps[0, 2, 3], maps[0, 8, 8], maps[0, 10, 2], maps[1, 5, 5] = 1.0, 0.9, 2.0, -3.0, 5.0
    found = find_peaks(maps, LABELS, {"screw"}, 0.3, SIZE)
    assert [tuple(d.center) for d in found] == [(33.5, 33.5), (9.5, 9.5)]


@pytest.mark.parametrize("shape", [(480, 640), (270, 480)])
def test_images_are_normalised_and_padded_with_the_mean_colour(shape: tuple[int, int]) -> None:
    image = np.full((*shape, 3), (0, 127, 255), np.uint8)
    x = normalise(image, np.array([0.5, 0.5, 0.5]), np.array([0.25, 0.5, 1.0]), 16)
    assert x.shape[2] % 16 == 0 and x.shape[3] % 16 == 0 and x.shape[2] - shape[0] < 16
    np.testing.assert_allclose(x[0, :, 0, 0], [-2.0, (127 / 255 - 0.5) / 0.5, 0.5], atol=1e-6)
    assert np.abs(x[..., shape[0] :, :]).sum() == 0.0


def test_of_two_peaks_on_one_part_the_better_stays() -> None:
    maps = empty()
    maps[1, 4, 4], maps[1, 4, 6], maps[0, 4, 6], maps[1, 4, 12] = 2.0, 1.0, 1.0, 0.5
    maps[4:] = np.log(12.0)
    found = find_peaks(maps, LABELS, {"screw", "tray"}, 0.3, SIZE)
    assert [(d.label, d.center[0]) for d in found] == [("tray", 17.5), ("screw", 25.5), ("tray", 49.5)]
