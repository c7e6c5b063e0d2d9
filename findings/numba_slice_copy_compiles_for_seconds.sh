#!/usr/bin/env bash
# numba 0.68.1, NumPy 2.4.6, CPython 3.11: copying a row by a slice compiles over twenty times as long as copying it in a loop.
#
# Both kernels copy 27 numbers, and both run equally fast. `out[:] = a` also compiles what numba would say if the shapes
# did not fit: string joins and formatting, once for every pair of array types. In a 500 Hz kernel made of twenty such
# lines it was most of 20 s of cold start. Numbers for the loop: seconds of CPU, one fresh process each, no cache.
#
# Seen: slice 3.28 s and 38 functions, loop 0.12 s and 1 function.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet numba==0.68.1 numpy==2.4.6

cat > "$folder/compile.py" << 'PYTHON'
import sys
import time

import numpy as np
from numba import njit
from numba.core import event


class Count(event.Listener):
    functions = 0

    def on_start(self, what):
        Count.functions += 1

    def on_end(self, what):
        pass


@njit
def warm(a):
    return a[0]


@njit
def by_slice(a, out):
    out[:] = a


@njit
def by_loop(a, out):
    for i in range(len(a)):
        out[i] = a[i]


a, out = np.arange(27.0), np.zeros(27)
warm(a)
event.register("numba:compile", Count())
start = time.process_time()
{"slice": by_slice, "loop": by_loop}[sys.argv[1]](a, out)
assert (out == a).all()
print(f"{time.process_time() - start:.2f} {Count.functions}")
PYTHON

read -r slice many < <("$folder/venv/bin/python" "$folder/compile.py" slice)
read -r loop few < <("$folder/venv/bin/python" "$folder/compile.py" loop)
echo "slice: $slice s of CPU, $many functions compiled; loop: $loop s, $few functions"
"$folder/venv/bin/python" -c "import sys; sys.exit(not ($slice > 3 * $loop and $many >= 5 and $few == 1))"
