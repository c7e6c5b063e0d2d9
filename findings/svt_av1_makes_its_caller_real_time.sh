#!/usr/bin/env bash
# PyAV 18.1.0 (FFmpeg's libavcodec 62.28, SVT-AV1 4.1.0), Linux, as root: whoever opens an AV1 encoder is real-time from then on.
#
# Robots run as root, in containers too, and record beside their controllers; LeRobot's data sets are AV1 by default. The
# encoder sets SCHED_FIFO with priority 99 for its own threads, and for the thread that opened it. Nothing says so, no
# option of FFmpeg turns it off, and it stays when the encoder is closed. From then on everything that the caller does
# goes before every other process of the machine, controllers with `nice` or a lower real-time priority included.
# Remedy: read the scheduling of the thread before, and set it again for all threads of the process after opening.
#
# Seen: `0 0` (SCHED_OTHER) before, `1 99` (SCHED_FIFO) after the first frame, `1 99` after closing. A user who may set no
# real-time priority sees `0 0` three times.
set -euo pipefail
[ "$(id -u)" = 0 ] || { echo "run it as root" >&2; exit 2; }
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check av==18.1.0 numpy==2.3.5 2> /dev/null

cat > "$folder/encode.py" << 'PYTHON'
import os
import sys

import av
import numpy as np


def scheduling(moment):
    print(moment, os.sched_getscheduler(0), os.sched_getparam(0).sched_priority)


scheduling("before")
container = av.open(sys.argv[1], "w")
stream = container.add_stream("libsvtav1", rate=30)
stream.width, stream.height, stream.pix_fmt = 160, 120, "yuv420p"
container.mux(stream.encode(av.VideoFrame.from_ndarray(np.zeros((120, 160, 3), np.uint8), format="rgb24")))
scheduling("encoding")
container.mux(stream.encode())
container.close()
scheduling("closed")
PYTHON

found=$(SVT_LOG=1 timeout 120 "$folder/venv/bin/python" "$folder/encode.py" "$folder/video.mp4" 2> /dev/null)
echo "$found"
[ "$found" = "$(printf 'before 0 0\nencoding 1 99\nclosed 1 99')" ]
