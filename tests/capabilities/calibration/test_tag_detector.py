"""Tags are found with their numbers and corners, on a drawn image and on the twin's cuff."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from golem.capabilities.calibration.tag_detector import TagDetector
from golem.robots.model.magpie_model import CELLS, cuff_tags


@pytest.mark.parametrize("number", [0, 3, 7])
def test_a_drawn_tag_is_found_where_it_is(number: int) -> None:
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    image = np.full((240, 320), 250, np.uint8)
    side = 10 * CELLS
    image[60 : 60 + side, 100 : 100 + side] = cv2.aruco.generateImageMarker(family, number, side)
    blurred = np.asarray(cv2.GaussianBlur(image, (0, 0), 0.7), np.uint8)
    found = TagDetector().find(np.repeat(blurred[:, :, None], 3, axis=2))
    assert list(found) == [number]
    edge = side - 0.5
    wanted = np.array([[99.5, 59.5], [100.0 + edge, 59.5], [100.0 + edge, 60.0 + edge], [99.5, 60.0 + edge]])
    assert np.abs(found[number] - wanted).max() < 0.6


@pytest.mark.parametrize("side", [24, 30, 38])
def test_the_corners_of_a_small_tag_are_found_to_a_third_of_a_pixel(side: int) -> None:
    """Drawn at 16 times its size, then averaged, so that its corners lie at fractions of pixels."""
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    errors = []
    for at in np.random.default_rng(side).uniform(20.0, 60.0, (12, 2)):
        large, corner = np.full((120 * 16, 120 * 16), 250, np.uint8), np.round(at * 16).astype(int)
        rows, columns = (slice(c, c + side * 16) for c in corner)
        large[rows, columns] = cv2.aruco.generateImageMarker(family, 3, side * 16)
        image = cv2.resize(large, (120, 120), interpolation=cv2.INTER_AREA)
        blurred = np.asarray(cv2.GaussianBlur(image, (0, 0), 0.7), np.uint8)
        found = TagDetector().find(np.repeat(blurred[:, :, None], 3, axis=2))[3]
        (y, x), half = corner / 16, 0.5
        wanted = np.array([[x, y], [x + side, y], [x + side, y + side], [x, y + side]]) - half
        errors.append(found - wanted)
    assert np.sqrt(np.mean(np.square(errors))) < 0.33


def test_an_empty_image_and_a_tiny_tag_show_nothing() -> None:
    detector = TagDetector()
    assert detector.find(np.full((120, 160, 3), 128, np.uint8)) == {}
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    image = np.full((120, 160), 255, np.uint8)
    image[40:56, 40:56] = cv2.aruco.generateImageMarker(family, 1, 16)
    assert detector.find(np.repeat(image[:, :, None], 3, axis=2)) == {}


def test_the_hands_have_different_tags_that_look_outward() -> None:
    left, right = cuff_tags("left"), cuff_tags("right")
    assert not set(left) & set(right) and len(left) == len(right) == 4
    for T in (*left.values(), *right.values()):
        assert np.linalg.det(T[:3, :3]) == pytest.approx(1.0)
        assert T[:2, 3] @ T[:2, 2] < 0.0  # z goes into the plate, towards the hand
