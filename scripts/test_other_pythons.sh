#!/usr/bin/env bash
# Usage: scripts/test_other_pythons.sh [VERSION...]     default: 3.13 3.12 3.11
#
# Runs the fast tests with every VERSION of Python but that of .venv, each in an environment of its own, .venv-3.13 for
# one; says which are not on this machine.
set -euo pipefail
cd "$(dirname "$0")/.."

own=$(.venv/bin/python -c 'import sys; print("%d.%d" % sys.version_info[:2])')
[ $# -gt 0 ] || set -- 3.13 3.12 3.11
for version in "$@"; do
    [ "$version" != "$own" ] || continue
    # Where pyenv keeps the interpreters, one answers only to who asks for its version.
    if ! python=$(PYENV_VERSION=$version "python$version" -c 'import sys; print(sys.executable)' 2> /dev/null); then
        echo "golem: no python$version on this machine: not tested with it"
        continue
    fi
    echo "golem: the fast tests with Python $version"
    PYTHON=$python VENV=.venv-$version scripts/bootstrap.sh dev
    ".venv-$version/bin/pytest" -n 2 -m "not slow"
done
