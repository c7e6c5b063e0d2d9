#!/usr/bin/env bash
# opencv-python-headless 5.0.0.93, CPython 3.11: cornerRefinementWinSize does nothing for ArUco markers below about 40 px.
#
# The window of the sub-pixel search is the smaller of that option and of a share of one cell of the marker, which is
# another option, relativeCornerRefinmentWinSize = 0.3. A marker of 30 px has cells of 3 px: its window is 1 px, whatever
# was asked for, and the corners are off by half a pixel. Calibration from afar then has tags that are too small.
#
# Seen: 36h11 of 30 px, 40 places, CORNER_REFINE_SUBPIX: 0.51 px rms with a window of 3 and of 5 alike; 0.18 px with
# relativeCornerRefinmentWinSize = 1.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet opencv-python-headless==5.0.0.93 numpy==2.4.6

cat > "$folder/tags.py" << 'PYTHON'
import cv2
import numpy as np

SIDE, FINE = 30, 16
family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)


def error(window, relative):
    options = cv2.aruco.DetectorParameters()
    options.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    options.cornerRefinementWinSize = window
    if relative is not None:
        options.relativeCornerRefinmentWinSize = relative
    detector, errors = cv2.aruco.ArucoDetector(family, options), []
    for at in np.random.default_rng(0).uniform(30, 60, (40, 2)):
        row, column = np.round(at * FINE).astype(int)
        fine = np.full((120 * FINE, 120 * FINE), 250, np.uint8)
        tag = cv2.aruco.generateImageMarker(family, 3, SIDE * FINE)
        fine[row : row + SIDE * FINE, column : column + SIDE * FINE] = tag
        image = cv2.GaussianBlur(cv2.resize(fine, (120, 120), interpolation=cv2.INTER_AREA), (0, 0), 0.7)
        corners, _, _ = detector.detectMarkers(image)
        x, y = column / FINE - 0.5, row / FINE - 0.5
        true = np.array([[x, y], [x + SIDE, y], [x + SIDE, y + SIDE], [x, y + SIDE]])
        errors.append(corners[0].reshape(4, 2) - true)
    return float(np.sqrt(np.mean(np.square(errors))))


print(f"{error(3, None):.3f} {error(5, None):.3f} {error(3, 1.0):.3f}")
PYTHON

read -r three five relative < <("$folder/venv/bin/python" "$folder/tags.py")
echo "window 3: $three px rms, window 5: $five px, window 3 and relative window 1: $relative px"
"$folder/venv/bin/python" -c "import sys; sys.exit(not ($three == $five and $three > 0.4 and $relative < 0.25))"
