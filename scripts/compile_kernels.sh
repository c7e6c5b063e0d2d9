#!/usr/bin/env bash
# Usage: scripts/compile_kernels.sh [VENV]     default: .venv
#
# Compiles the numba kernels before the tests: once each, in one process, and outside of the time limit of a test. They
# are kept in src/golem/**/__pycache__ (or $NUMBA_CACHE_DIR), where the workers of a test run and all environments of
# one version of Python find them. It does nothing where no kernel has changed since.
set -euo pipefail
cd "$(dirname "$0")/.."

bin=${1:-.venv}/bin
stamp=.cache/kernels-$("$bin/python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
sum=$(grep -rl --include='*.py' '^@njit' src | sort | xargs cat | cat - requirements/dev.txt "$0" | cksum)
[ "$sum" != "$(cat "$stamp" 2> /dev/null)" ] || exit 0
"$bin/golem" doctor --compile
mkdir -p .cache
echo "$sum" > "$stamp"
