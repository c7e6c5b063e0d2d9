#!/usr/bin/env bash
# numba 0.68.1, llvmlite 0.50.0, CPython 3.11: Ctrl-C while a function compiles can be dropped without a trace.
#
# LLVM asks Python through ctypes whether it has the object code. A handler of SIGINT that runs within that question
# raises KeyboardInterrupt in a ctypes callback: it is printed as "ignored", and the compilation goes on. A robot's
# command that compiles for seconds at its start is then not stopped by the operator's first Ctrl-C. A program has to
# hold the signal back while numba compiles (`numba.core.event`, "numba:compiler_lock"), and raise it afterwards.
#
# Seen: the signal comes at the question (a profile function raises it there, as chance else does). The call returns 3,
# KeyboardInterrupt does not come. The same signal one function earlier, within numba's own Python, ends the call.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet numba==0.68.1 llvmlite==0.50.0

cat > "$folder/press.py" << 'PYTHON'
import signal
import sys

from numba import njit

NAME = sys.argv[1]
pressed = []


def press(frame, event, arg):
    if event == "call" and frame.f_code.co_name == NAME and not pressed:
        pressed.append(NAME)
        sys.setprofile(None)
        signal.raise_signal(signal.SIGINT)


@njit
def add(a):
    return a + 2


sys.setprofile(press)
try:
    print("returned", add(1))
except KeyboardInterrupt:
    print("interrupted")
assert pressed == [NAME]
PYTHON

for name in _raw_object_cache_getbuffer finalize; do
    echo "$name: $("$folder/venv/bin/python" "$folder/press.py" "$name" 2> "$folder/said")"
done | tee "$folder/out"
printf '%s\n' '_raw_object_cache_getbuffer: returned 3' 'finalize: interrupted' | diff - "$folder/out"
