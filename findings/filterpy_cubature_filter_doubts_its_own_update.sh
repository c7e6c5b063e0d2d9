#!/usr/bin/env bash
# filterpy 2.0.0, scipy 1.17.1, numpy 2.4.6, CPython 3.11: the cubature Kalman filter is no Kalman filter on a linear
# system, where all of them are the same one.
#
# CubatureKalmanFilter adds the process noise to P, but weighs the measurement by the points of before, without it. The
# first correction is too weak, and what the measurement should have taken from P stays in it: P ends higher by about
# one step's noise. The mean is soon right, so a comparison of means passes. Who gates measurements, fuses tracks or
# stops a robot by P has a variance of several times the true one. UnscentedKalmanFilter of the same package draws its
# points anew and is exact. Remedy: that one, or between predict and update
# `sigmas_f = spherical_radial_sigmas(x, P)`.
#
# Seen: a random walk, all variances 1, so that the steady variance is the golden ratio less 1. Gain of the first
# update, and variance after 30: KalmanFilter 0.667 and 0.618, unscented 0.667 and 0.618, cubature 0.500 and 1.618;
# cubature with its points drawn anew 0.667 and 0.618.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check \
    filterpy==2.0.0 scipy==1.17.1 numpy==2.4.6 2> /dev/null

cat > "$folder/walk.py" << 'PYTHON'
import numpy as np
from filterpy.kalman import CubatureKalmanFilter, KalmanFilter, MerweScaledSigmaPoints, UnscentedKalmanFilter
from filterpy.kalman.CubatureKalmanFilter import spherical_radial_sigmas


def stay(x, dt):
    return x


def see(x):
    return x


def run(made, start, anew=False):
    """Return the gain of the first update and the variance after 30."""
    made.x, made.P, made.Q, made.R = start, np.eye(1), np.eye(1), np.eye(1)
    gains = []
    for _ in range(30):
        made.predict()
        if anew:
            made.sigmas_f = spherical_radial_sigmas(made.x, made.P)
        made.update(np.ones_like(start))
        gains.append(made.K[0, 0])
    return f"{gains[0]:.3f} {made.P[0, 0]:.3f}"


plain = KalmanFilter(1, 1)
plain.F = plain.H = np.eye(1)
unscented = UnscentedKalmanFilter(1, 1, 1.0, see, stay, MerweScaledSigmaPoints(1, 1.0, 2.0, 2.0))
cubature = [CubatureKalmanFilter(1, 1, 1.0, see, stay) for _ in range(2)]
column, line = np.zeros((1, 1)), np.zeros(1)
print(run(plain, column), "/", run(unscented, line), "/", run(cubature[0], column), "/", run(cubature[1], column, True))
PYTHON

found=$("$folder/venv/bin/python" "$folder/walk.py")
echo "first gain and last variance: Kalman / unscented / cubature / cubature, points drawn anew: $found"
[ "$found" = "0.667 0.618 / 0.667 0.618 / 0.500 1.618 / 0.667 0.618" ]
