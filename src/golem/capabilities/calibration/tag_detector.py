"""Finds AprilTags of the family 36h11 in an image, with OpenCV."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from golem.types import Array

SMALLEST = 18.0
"""Side below which a tag's corners are not to be relied on [px]."""


class TagDetector:
    """Finds tags."""

    def __init__(self) -> None:
        options = cv2.aruco.DetectorParameters()
        options.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
        options.cornerRefinementWinSize = 3
        options.relativeCornerRefinmentWinSize = 1.0  # of a cell; by default tags below 40 px get a window of 1 px
        options.cornerRefinementMaxIterations = 50
        options.cornerRefinementMinAccuracy = 0.01
        family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
        self._detector = cv2.aruco.ArucoDetector(family, options)

    def find(self, rgb: NDArray[np.uint8]) -> dict[int, Array]:
        """Return the (4, 2) corners of each tag in `rgb` [px], in the order of `tag_corners`, by its number."""
        corners, numbers, _ = self._detector.detectMarkers(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY))
        if numbers is None:
            return {}
        found: dict[int, Array] = {}
        for number, four in zip(numbers.reshape(-1).tolist(), corners, strict=True):
            points = np.asarray(four, np.float64).reshape(4, 2)
            sides = np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1)
            if sides.min() >= SMALLEST:
                found[int(number)] = points
        return found
