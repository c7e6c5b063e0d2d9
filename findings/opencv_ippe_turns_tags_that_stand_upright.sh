#!/usr/bin/env bash
# opencv-python-headless 5.0.0.93, CPython 3.11: cv2.solvePnP with SOLVEPNP_IPPE_SQUARE, the method made for markers,
# returns True and a false rotation for a marker that stands upright in the picture.
#
# To the camera, an upright marker is turned by exactly half a turn, about an axis in the plane of x and z. The method
# makes its rotation vector by a formula that breaks down there. Detected corners are whole pixels unless they are
# refined, so "exactly" is common: a camera that looks squarely at a tag on a dock, a bin or a bench. One picture is
# right and the next, one pixel further, is not. The distance stays about right, so a glance shows nothing, and a hand
# that grasps by the tag comes in askew. Noise hides it in tests with random corners. Remedy: SOLVEPNP_SQPNP or
# SOLVEPNP_ITERATIVE, or keep a pose only if it is finite and projects onto the corners.
#
# Seen: one marker of 10 cm that faces the camera, 80 to 160 px wide, at 9 columns: 729 pictures, detected with default
# options. IPPE_SQUARE is more than 10 degrees off in 207 of them (28 %), mostly by 30 to 50 degrees, and once the
# rotation is NaN. SQPNP and ITERATIVE are in none. All three say True. OpenCV 4.13 does the same.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check \
    opencv-python-headless==5.0.0.93 numpy==2.4.6 2> /dev/null

cat > "$folder/tags.py" << 'PYTHON'
import cv2
import numpy as np

K = np.array([[400.0, 0, 320], [0, 400, 240], [0, 0, 1]])
CORNERS = 0.05 * np.array([[-1.0, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]])  # the order that the method asks for
FACING = np.diag([1.0, -1.0, -1.0])
FAMILY = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
detector = cv2.aruco.ArucoDetector(FAMILY, cv2.aruco.DetectorParameters())
methods = (cv2.SOLVEPNP_IPPE_SQUARE, cv2.SOLVEPNP_SQPNP, cv2.SOLVEPNP_ITERATIVE)
false, worst, lost, pictures, said = [0] * 3, 0.0, 0, 0, set()
for side in range(80, 161):
    for left in range(100, 401, 37):
        picture = np.full((480, 640), 255, np.uint8)
        picture[150 : 150 + side, left : left + side] = cv2.aruco.generateImageMarker(FAMILY, 7, side)
        found = detector.detectMarkers(picture)[0]
        pictures += 1
        for k, method in enumerate(methods):
            good, rotation, place = cv2.solvePnP(CORNERS, found[0], K, None, flags=method)
            said.add(good)
            cosine = (np.trace(FACING.T @ cv2.Rodrigues(rotation)[0]) - 1) / 2
            off = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
            lost += not np.isfinite(off)
            false[k] += not off <= 10
            worst = max(worst, off) if k == 0 and np.isfinite(off) else worst
print(pictures, *false, f"{worst:.0f}", lost, *said, cv2.__version__)
PYTHON

read -r pictures ippe sqpnp iterative worst lost said version < <("$folder/venv/bin/python" "$folder/tags.py")
echo "OpenCV $version: $pictures pictures; more than 10 degrees off: IPPE_SQUARE $ippe (worst $worst, NaN $lost)," \
    "SQPNP $sqpnp, ITERATIVE $iterative; solvePnP said $said"
[ "$ippe" -gt 70 ] && [ "$worst" -gt 30 ] && [ "$sqpnp $iterative $said" = "0 0 True" ]
