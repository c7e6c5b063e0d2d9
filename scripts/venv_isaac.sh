#!/usr/bin/env bash
# Usage: scripts/venv_isaac.sh [FOLDER]
#
# Makes the environment in which the robot `isaaclab` runs Isaac Lab: FOLDER, by default .venv-isaac. It is apart from
# ours, since Isaac Lab 3 asks for Python 3.12 and a PyTorch of its own. Needs 8 GB, Linux on x86-64 and a Python 3.12
# (PYTHON names one, by default python3.12). What it prints at the end names the environment for `golem`.
set -euo pipefail
cd "$(dirname "$0")/.."
folder=${1:-.venv-isaac}
python=${PYTHON:-python3.12}

"$python" -c 'import sys; sys.exit(sys.version_info[:2] != (3, 12))' 2> /dev/null || {
    echo "golem: $python is not Python 3.12, which Isaac Lab asks for; name one: PYTHON=/path/to/python3.12 $0" >&2
    exit 2
}
PYTHON='' scripts/bootstrap.sh core # brings uv
uv() { if [ -x .uv/bin/uv ]; then .uv/bin/uv "$@"; else command uv "$@"; fi; }
export UV_PYTHON_DOWNLOADS=never UV_NO_PROGRESS=1
[ -x "$folder/bin/python" ] || uv venv --quiet --python "$python" "$folder"
uv pip install --quiet --no-config --python "$folder/bin/python" --no-deps --require-hashes -r requirements/isaaclab.lock
echo "export GOLEM_ISAACLAB_PYTHON=$(cd "$folder" && pwd)/bin/python"
