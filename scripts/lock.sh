#!/usr/bin/env bash
# Writes requirements/*.txt: for every group a complete, hashed lock for all platforms and Python versions we support.
# All groups are resolved together first, so that any two locks can be installed side by side.
set -euo pipefail
cd "$(dirname "$0")/.."

uv() { if [ -x .uv/bin/uv ]; then .uv/bin/uv "$@"; else command uv "$@"; fi; }
compile() {
    uv pip compile --quiet --no-config --universal --python-version 3.11 --generate-hashes \
        --override requirements/overrides.in --no-annotate --custom-compile-command "make lock" "$@"
}

together=$(mktemp)
trap 'rm -f "$together"' EXIT
cat requirements/*.txt 2>/dev/null | grep -E '^[A-Za-z0-9_.-]+==' | sed 's/ *\\$//' | sort -u > "$together" || true
compile pyproject.toml --all-extras --no-header --output-file "$together" "$@"

compile pyproject.toml --constraints "$together" --output-file requirements/core.txt "$@"
compile pyproject.toml --constraints "$together" --extra pink --output-file requirements/pink.txt "$@"
compile pyproject.toml --constraints "$together" --extra dds --output-file requirements/dds.txt "$@"
compile pyproject.toml --constraints "$together" --extra record --extra foxglove --output-file requirements/record.txt "$@"
compile pyproject.toml --constraints "$together" --extra report --output-file requirements/report.txt "$@"
compile pyproject.toml --constraints "$together" --extra hardware --output-file requirements/hardware.txt "$@"
compile pyproject.toml --constraints "$together" --extra realsense --output-file requirements/realsense.txt "$@"
compile pyproject.toml --constraints "$together" --extra graspgen --output-file requirements/graspgen.txt "$@"
compile pyproject.toml --constraints "$together" --extra agent --output-file requirements/agent.txt "$@"
compile pyproject.toml --constraints "$together" --extra data --output-file requirements/data.txt "$@"
compile pyproject.toml --constraints "$together" --extra gym --output-file requirements/gym.txt "$@"
compile pyproject.toml --constraints "$together" --extra policy --output-file requirements/policy.txt "$@"
compile pyproject.toml --constraints "$together" --extra cluster --output-file requirements/cluster.txt "$@"
compile pyproject.toml --constraints "$together" --extra view --output-file requirements/view.txt "$@"
compile pyproject.toml --constraints "$together" --extra lidar --output-file requirements/lidar.txt "$@"
compile pyproject.toml --constraints "$together" --extra physx --output-file requirements/physx.txt "$@"
compile pyproject.toml --constraints "$together" --extra train --output-file requirements/train.txt "$@"
compile pyproject.toml --constraints "$together" --extra vision --output-file requirements/vision.txt "$@"
compile pyproject.toml --constraints "$together" --extra docs --output-file requirements/docs.txt "$@"
compile pyproject.toml --constraints "$together" --extra dev --extra pink --extra dds --extra record --extra foxglove \
    --extra report --extra view --extra agent --extra cluster --extra graspgen --extra lidar --extra hardware --extra realsense --extra physx \
    --extra data --extra gym --extra policy \
    --output-file requirements/dev.txt "$@"
echo "uv>=0.13,<0.14" | compile - --output-file requirements/uv.txt "$@"
# Isaac Lab runs apart, under Python 3.12 on Linux: its lock need not fit the others.
uv pip compile --quiet --no-config --python-version 3.12 --python-platform x86_64-manylinux_2_35 --generate-hashes \
    --no-annotate --custom-compile-command "make lock" requirements/isaaclab.in --output-file requirements/isaaclab.lock "$@"
