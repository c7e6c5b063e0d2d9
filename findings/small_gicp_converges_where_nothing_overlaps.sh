#!/usr/bin/env bash
# small_gicp 1.0.1, CPython 3.11: two clouds that share no point are "converged", with an error of 0.
#
# A robot that has lost its place registers its scan against the map and asks `converged` whether it is found again.
# Where no point has a partner within max_correspondence_distance (1 m), the equations are all zero. The first step is
# then zero, which passes for convergence. The answer is the guess that was given, with the best error that there is: of
# several guesses, the one beside the map wins. All four methods do so. With some overlap `converged` is what one
# expects, and its reference says no more than "if the optimization converged". Remedy: ask `num_inliers` first, as a
# share of the points, and compare `error / num_inliers`.
#
# Seen: a room of 9000 points against itself, moved up. By 0.3 m: converged, some 5000 inliers, shift found. By 100 m:
# ICP, PLANE_ICP, GICP and VGICP say converged after 0 iterations, with 0 inliers, an error of 0 and a shift of 0 m.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check small_gicp==1.0.1 numpy==2.4.6 2> /dev/null

cat > "$folder/room.py" << 'PYTHON'
import numpy as np
import small_gicp

draw = np.random.default_rng(0).uniform
floor = np.column_stack([draw(-10, 10, (5000, 2)), np.zeros(5000)])
north = np.column_stack([draw(-10, 10, 2000), np.full(2000, 10.0), draw(0, 3, 2000)])
east = np.column_stack([np.full(2000, 8.0), draw(-10, 10, 2000), draw(0, 3, 2000)])
room = np.concatenate([floor, north, east])


def registered(method, shift):
    out = small_gicp.align(room, room + [0, 0, shift], registration_type=method)
    found = out.converged, out.num_inliers > 4000, out.iterations > 0, out.error > 0
    return "/".join(map(str, found)) + f"/{abs(out.T_target_source[2, 3]):.1f}"


print(registered("GICP", 0.3), *(registered(method, 100.0) for method in ("ICP", "PLANE_ICP", "GICP", "VGICP")))
PYTHON

read -r near far < <("$folder/venv/bin/python" "$folder/room.py")
echo "converged / inliers / iterations / error above 0 / shift found [m]; of 0.3 m: $near; of 100 m: $far"
lost=True/False/False/False/0.0
[ "$near $far" = "True/True/True/True/0.3 $lost $lost $lost $lost" ]
