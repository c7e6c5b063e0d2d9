#!/usr/bin/env bash
# Usage: scripts/bootstrap.sh GROUP...     GROUP is the name of a lock in requirements/: core, dev, docs, pink, train
#
# Creates .venv with the locked packages of every GROUP and this package itself, and sees to it that MuJoCo can
# render. Needs Python 3.11-3.13 and a network to the package index; brings everything else: uv goes to .uv/ unless it
# is installed, and what the operating system lacks is installed where that is allowed (root on Debian or Ubuntu) or
# named with the line to type. Does nothing when .venv already is what the locks say.
set -euo pipefail
cd "$(dirname "$0")/.."

die() {
    printf 'golem: %s\n' "$@" >&2
    exit 2
}

# system_packages REASON PACKAGE...: installs Debian packages, or says which line does.
system_packages() {
    local reason=$1 sudo=""
    shift
    [ "$(id -u)" = 0 ] || sudo="sudo "
    if ! command -v apt-get > /dev/null; then
        die "$reason; install what your system calls these Debian packages, then run make again: $*"
    fi
    if [ -n "$sudo" ]; then
        die "$reason; type this line, then run make again:" "    ${sudo}apt-get update && ${sudo}apt-get install -y $*"
    fi
    echo "golem: $reason; installing $*" >&2
    export DEBIAN_FRONTEND=noninteractive
    apt-get -qq update && apt-get -qq install -y --no-install-recommends "$@" > /dev/null < /dev/null ||
        die "apt-get could not install them; type this line to see why: apt-get install -y $*"
}

find_python() {
    local candidate
    for candidate in "${PYTHON:-python3}" python3 python3.13 python3.12 python3.11; do
        if "$candidate" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 14))' 2> /dev/null; then
            command -v "$candidate"
            return
        fi
    done
    die "Python 3.11, 3.12 or 3.13 is needed; install one, or name it: make PYTHON=/path/to/python3.12 ..."
}

# Sets `uv` to an installed uv, or to one fetched into .uv/ with whichever of venv and pip this Python has.
find_uv() {
    local python=$1
    if command -v uv > /dev/null && uv --version > /dev/null 2>&1; then
        uv=uv
        return
    fi
    uv=.uv/bin/uv
    "$uv" --version > /dev/null 2>&1 && return
    echo "golem: fetching uv into .uv/" >&2
    rm -rf .uv
    if "$python" -c 'import ensurepip, venv' 2> /dev/null; then
        "$python" -m venv .uv
        .uv/bin/python -m pip install --quiet --require-hashes -r requirements/uv.txt
    elif "$python" -m pip --version > /dev/null 2>&1; then
        "$python" -m pip install --quiet --require-hashes --target .uv -r requirements/uv.txt
    else
        system_packages "this Python can neither make a virtual environment nor run pip" python3-venv
        "$python" -m venv .uv
        .uv/bin/python -m pip install --quiet --require-hashes -r requirements/uv.txt
    fi
}

# Asks golem itself whether MuJoCo can draw; only Linux needs a system library for it.
see_to_graphics() {
    local line
    [ "$(uname -s)" = Linux ] || return 0
    .venv/bin/python -m golem.doctor --graphics > /dev/null 2>&1 && return
    system_packages "MuJoCo cannot render without a display here: libEGL and a software driver are missing" \
        $(.venv/bin/python -m golem.doctor --packages)
    .venv/bin/python -m golem.doctor --graphics
}

python=$(find_python)
export UV_PYTHON_DOWNLOADS=never UV_NO_PROGRESS=1
locks=()
for group in "$@"; do
    [ -f "requirements/$group.txt" ] || die "no lock requirements/$group.txt; groups: core, dev, docs, pink, train"
    stamp=".venv/.golem-$group"
    sum=$(cat "requirements/$group.txt" pyproject.toml | cksum)
    if [ ! -x .venv/bin/golem ] || [ "$sum" != "$(cat "$stamp" 2> /dev/null)" ]; then
        locks+=("$group")
    fi
done
[ "${#locks[@]}" -gt 0 ] || exit 0

find_uv "$python"
if ! .venv/bin/python -c 'import sys' 2> /dev/null; then
    "$uv" venv --quiet --python "$python" .venv
fi
echo "golem: installing the locked packages (${locks[*]}) into .venv" >&2
for group in "${locks[@]}"; do
    "$uv" pip install --quiet --python .venv/bin/python --require-hashes -r "requirements/$group.txt"
done
"$uv" pip install --quiet --python .venv/bin/python --no-deps --editable .
see_to_graphics
for group in "${locks[@]}"; do
    cat "requirements/$group.txt" pyproject.toml | cksum > ".venv/.golem-$group"
done
