#!/usr/bin/env bash
# Usage: scripts/test_extras.sh [EXTRA...]     default: every extra that the package's own code asks for
#
# For each extra: an environment with nothing but the locked core has to answer with the sentence that names the line
# which installs it; then a fresh one with the extra's own lock has to do what it is for. Takes minutes and, with torch,
# gigabytes.
set -euo pipefail
cd "$(dirname "$0")/.."
root=$PWD

uv() { if [ -x "$root/.uv/bin/uv" ]; then "$root/.uv/bin/uv" "$@"; else command uv "$@"; fi; }
export UV_PYTHON_DOWNLOADS=never UV_NO_PROGRESS=1 PYTHONDONTWRITEBYTECODE=1

# What needs the extra, as a Python statement. A refusal for another reason than a missing package is a success.
probe() {
    case $1 in
        pink) echo "from golem.registry import create; create('upper_body', 'pink_ik', {})" ;;
        dds) echo "from golem.middleware.dds.library import cyclone; cyclone(); from golem.middleware.ros.definitions import load; load('humble')" ;;
        train) echo "from golem.cli import _dispatch; _dispatch(['train', 'detector', '--help'])" ;;
        record) echo "from golem.middleware.bags import reader, writer" ;;
        foxglove) echo "from golem.middleware.bags import foxglove_server" ;;
        report) echo "from golem.figures import blank_figure; blank_figure(90.0, 90.0); from golem.evaluation.report.svg_figure import styled; styled()" ;;
        hardware) echo "from golem.hardware.drivers.serial_port import SerialPort; SerialPort('/dev/none', 9600)" ;;
        realsense) echo "from golem.hardware.drivers.realsense_camera import library; library()" ;;
        vision) echo "from pathlib import Path; from golem.capabilities.perception.open_words import load_model; load_model(Path('none'), 'clip', 'CLIPModel', 'CLIPProcessor')" ;;
        data) echo "from golem.datasets.episode_writer import DatasetWriter; from golem.datasets.schema import Recipe; from pathlib import Path; DatasetWriter(Path('none'), Recipe()).close()" ;;
        gym) echo "import golem.datasets.gym_env" ;;
        policy) echo "from golem.registry import create; create('grasp_method', 'policy', {})" ;;
        graspgen) echo "from golem.registry import create; create('grasp_method', 'graspgen', {})" ;;
        agent) echo "import zmq; from golem.agent.mcp_server import modules; modules()" ;;
        cluster) echo "from golem.evaluation.harness.trial_executor import DaskExecutor; DaskExecutor('no scheduler')" ;;
        lidar) echo "from golem.registry import create; create('odometry', 'kiss_icp', {}); create('odometry', 'rko_lio', {})" ;;
        view) echo "from golem.dashboard.server import serve; serve('127.0.0.1', 0).stop()" ;;
        physx) echo "from golem.robots.physx.physx_robot import load_sapien; load_sapien()" ;;
        *) echo "There is no extra '$1' to try." >&2; exit 2 ;;
    esac
}

# ask PYTHON EXTRA: prints "ok", "missing: SENTENCE" or what else came.
ask() {
    "$1" - "$(probe "$2")" << 'PYTHON'
import sys
from golem.errors import GolemError, MissingExtra
try:
    exec(sys.argv[1])
    print("ok")
except MissingExtra as error:
    print(f"missing: {error}")
except GolemError as error:
    print(f"ok ({error})")
except SystemExit as end:
    print("ok" if not end.code else f"exit code {end.code}")
except Exception as error:
    print(f"{type(error).__name__}: {error}")
PYTHON
}

# environment FOLDER LOCK
environment() {
    uv venv --quiet --clear --python "$python" "$1"
    uv pip install --quiet --python "$1/bin/python" --no-deps --require-hashes -r "requirements/$2.txt"
    uv pip install --quiet --python "$1/bin/python" --no-deps --editable .
}

empty=$(mktemp -d)
trap 'rm -rf "$empty"' EXIT
python=$(.venv/bin/python -c 'import sys; print(sys._base_executable)')
environment "$empty/core" core
failed=0
for extra in "${@:-pink dds train record foxglove report hardware realsense vision graspgen agent data gym policy cluster view lidar physx}"; do
    for one in $extra; do
        lock=$one
        [ "$one" = foxglove ] && lock=record
        without=$(ask "$empty/core/bin/python" "$one" 2>&1 | tail -n 1)
        environment "$empty/$one" "$lock"
        with=$(ask "$empty/$one/bin/python" "$one" 2>&1 | tail -n 1)
        rm -rf "${empty:?}/$one"
        printf '%-10s without: %s\n%-10s with: %s\n' "$one" "$without" "" "$with"
        case $without in "missing: "*"golem-humanoid[$one]'"*) ;; *) failed=1; echo "           ^ wants the sentence of '$one'" ;; esac
        case $with in ok*) ;; *) failed=1; echo "           ^ does not work" ;; esac
    done
done
exit $failed
