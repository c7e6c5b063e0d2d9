#!/usr/bin/env bash
# pupil-apriltags 1.0.4.post11 (AprilTag 3), opencv-python-headless 5.0.0.93, CPython 3.11: one tag is half a pixel
# further right and down in AprilTag's corners than in OpenCV's.
#
# AprilTag counts pixels from their upper left corner, OpenCV from their centre. Whoever gives AprilTag's corners to
# cv2.solvePnP, or the intrinsics of cv2.calibrateCamera to AprilTag, sees everything turned: by 0.8 mrad per axis with
# a focal length of 640 px. No average takes it out. OpenCV has both: its CORNER_REFINE_APRILTAG is AprilTag's method,
# and is half a pixel off its CORNER_REFINE_SUBPIX. Remedy: subtract 0.5 from AprilTag's corners.
#
# Seen: 36h11 of 160 px, 40 places, mean of the four corners less the true centre, x and y: OpenCV SUBPIX 0.00 0.00 px,
# OpenCV APRILTAG 0.48 0.54, AprilTag 0.46 0.49.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet pupil-apriltags==1.0.4.post11 opencv-python-headless==5.0.0.93 numpy==2.4.6

cat > "$folder/tags.py" << 'PYTHON'
import cv2
import numpy as np
from pupil_apriltags import Detector

SIDE, FINE = 160, 8
FAMILY = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)


def opencv(refinement):
    options = cv2.aruco.DetectorParameters()
    options.cornerRefinementMethod = refinement
    detector = cv2.aruco.ArucoDetector(FAMILY, options)
    return lambda image: detector.detectMarkers(image)[0][0].reshape(4, 2)


library = Detector(families="tag36h11", quad_decimate=1.0)
finders = (
    opencv(cv2.aruco.CORNER_REFINE_SUBPIX),
    opencv(cv2.aruco.CORNER_REFINE_APRILTAG),
    lambda image: library.detect(image)[0].corners,
)
off = [[] for _ in finders]
for at in np.random.default_rng(0).uniform(100, 101, (40, 2)):
    row, column = np.round(at * FINE).astype(int)
    fine = np.full((400 * FINE, 400 * FINE), 250, np.uint8)
    fine[row : row + SIDE * FINE, column : column + SIDE * FINE] = cv2.aruco.generateImageMarker(FAMILY, 3, SIDE * FINE)
    image = cv2.GaussianBlur(cv2.resize(fine, (400, 400), interpolation=cv2.INTER_AREA), (0, 0), 0.7)
    # The centre of the first pixel is (0, 0), as in OpenCV.
    centre = np.array([column, row]) / FINE + SIDE / 2 - 0.5
    for found, find in zip(off, finders, strict=True):
        found.append(find(image).mean(axis=0) - centre)
print(*(f"{value:.2f}" for found in off for value in np.mean(found, axis=0)))
PYTHON

read -r sx sy ax ay lx ly < <("$folder/venv/bin/python" "$folder/tags.py")
echo "off by [px]: OpenCV SUBPIX $sx $sy, OpenCV APRILTAG $ax $ay, AprilTag $lx $ly"
"$folder/venv/bin/python" -c "
import sys
sys.exit(not (max(abs($sx), abs($sy)) < 0.05 and all(0.4 < v < 0.6 for v in ($ax, $ay, $lx, $ly))))"
