#!/usr/bin/env bash
# opencv-python-headless 5.0.0.93, av 18.1.0, CPython 3.11: OpenCV opens an AV1 video and reads no picture from it.
#
# LeRobot writes its videos as AV1 (libsvtav1). OpenCV's FFmpeg knows AV1 by hardware only: `isOpened()` is true, and the
# first `read()` returns False, with a line on the console. Whoever counts frames by `read()` finds a video of none.
# PyAV's wheel has dav1d and reads all of them.
#
# Seen: opened True, 0 pictures by OpenCV, 30 by PyAV.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet opencv-python-headless==5.0.0.93 av==18.1.0 numpy==2.4.6

cat > "$folder/read.py" << 'PYTHON'
import sys

import av
import cv2
import numpy as np

path = sys.argv[1]
with av.open(path, "w") as out:
    stream = out.add_stream("libsvtav1", rate=30, options={"preset": "11"})
    stream.width, stream.height, stream.pix_fmt = 128, 96, "yuv420p"
    for k in range(30):
        out.mux(stream.encode(av.VideoFrame.from_ndarray(np.full((96, 128, 3), 8 * k, np.uint8), "rgb24")))
    out.mux(stream.encode())
video, count = cv2.VideoCapture(path), 0
opened = video.isOpened()
while video.read()[0]:
    count += 1
with av.open(path) as video:
    print(opened, count, sum(1 for _ in video.decode(video=0)))
PYTHON

found=$(SVT_LOG=1 "$folder/venv/bin/python" "$folder/read.py" "$folder/video.mp4" 2> /dev/null)
echo "opened, pictures by OpenCV, pictures by PyAV: $found"
[ "$found" = "True 0 30" ]
