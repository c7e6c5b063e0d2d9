"""Tags are found with their numbers and corners, on a drawn image and on the twin's cuff."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from golem.capabilities.calibration.tag_detector import TagDetector
from golem.robots.model.tag_cuff import CELLS, cuff_tags


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
