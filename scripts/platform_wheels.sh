#!/usr/bin/env bash
# Usage: scripts/platform_wheels.sh
#
# Resolves the locked requirements of the default environment for systems that this machine is not, wheels alone, and
# prints how many packages each gets or what is missing. Nothing is installed. macOS: 14 or later, as onnxruntime's wheels.
set -euo pipefail
cd "$(dirname "$0")/.."
uv=$(command -v uv || echo .uv/bin/uv)
export MACOSX_DEPLOYMENT_TARGET=14.0
for platform in aarch64-apple-darwin x86_64-manylinux_2_28 aarch64-manylinux_2_28; do
    for python in 3.11 3.12 3.13; do
        target=$(mktemp -d)
        if said=$("$uv" pip install --dry-run --python-version "$python" --python-platform "$platform" --only-binary :all: \
            --target "$target" -r requirements/core.txt -r requirements/view.txt -r requirements/report.txt 2>&1); then
            echo "$platform $python: $(grep -c '^ + ' <<< "$said") packages, all as wheels"
        else
            echo "$platform $python: $(grep -m1 -E 'no wheels|unsatisfiable' <<< "$said")"
        fi
        rm -rf "$target"
    done
done
