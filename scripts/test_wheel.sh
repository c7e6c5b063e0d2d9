#!/usr/bin/env bash
# Builds the wheel, installs it into an empty environment with the locked packages, and runs the demo there: what the
# package needs is in the wheel and not in this checkout. The robot hangs in its hoist and pulls one screw.
set -euo pipefail
cd "$(dirname "$0")/.."
root=$PWD

uv() { if [ -x "$root/.uv/bin/uv" ]; then "$root/.uv/bin/uv" "$@"; else command uv "$@"; fi; }
export UV_PYTHON_DOWNLOADS=never UV_NO_PROGRESS=1

empty=$(mktemp -d)
trap 'rm -rf "$empty"' EXIT
python=$(.venv/bin/python -c 'import sys; print(sys._base_executable)')
uv build --quiet --wheel --python "$python" --out-dir "$empty/dist"
uv venv --quiet --python "$python" "$empty/venv"
for group in core report; do
    uv pip install --quiet --python "$empty/venv/bin/python" --require-hashes -r "requirements/$group.txt"
done
uv pip install --quiet --python "$empty/venv/bin/python" --no-deps "$empty"/dist/*.whl
cd "$empty"
venv/bin/golem ladder --help > /dev/null # it imports every rung: none may need an extra for that
venv/bin/golem demo --stack tether --screws 1 --headless --out demo
ls -l demo/report.html demo/*.webp
