#!/usr/bin/env bash
# Writes requirements-*.txt: complete, hashed locks of ROS 2 from wheels of the package index, for CPython 3.12 on Linux.
# They are apart from the locks of the product, which never needs them.   UPGRADE: tests/interop/lock.sh --upgrade
set -euo pipefail
cd "$(dirname "$0")"
uv() { if [ -x ../../.uv/bin/uv ]; then ../../.uv/bin/uv "$@"; else command uv "$@"; fi; }
for distro in jazzy kilted; do
    uv pip compile --quiet --no-config --python-version 3.12 --generate-hashes --no-annotate \
        --custom-compile-command tests/interop/lock.sh "requirements-$distro.in" --output-file "requirements-$distro.txt" "$@"
done
