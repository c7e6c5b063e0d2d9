#!/usr/bin/env bash
# Usage: scripts/bootstrap.sh GROUP...     GROUP is the name of a lock in requirements/: agent, cluster, core, data, dds, dev, docs, graspgen, gym, hardware, lidar, physx, pink, policy, realsense, record, report, train, view, vision
#
# Creates .venv, or $VENV, with the locked packages of every GROUP and this package itself, and sees to it that they find
# their system libraries. Needs Python 3.11-3.13 and a network to the package index; brings everything else: uv goes to
# .uv/ unless it is installed, and what the operating system lacks is installed where that is allowed (root on Debian or
# Ubuntu) or named with the line to type. Does nothing when the environment already is what the locks say.
set -euo pipefail
cd "$(dirname "$0")/.."
venv=${VENV:-.venv}

die() {
    printf 'golem: %s\n' "$@" >&2
    exit 2
}

# apt REASON PACKAGE...: installs Debian packages where that is allowed, or stops with the line that does.
apt() {
    local reason=$1
    shift
    command -v apt-get > /dev/null || die "$reason; install what your system calls these Debian packages: $*"
    [ "$(id -u)" = 0 ] || die "$reason; type: sudo apt-get install -y $*"
    echo "golem: $reason; installing $*" >&2
    export DEBIAN_FRONTEND=noninteractive
    apt-get -qq update && apt-get -qq install -y --no-install-recommends "$@" > /dev/null 2>&1 < /dev/null ||
        die "that failed; to see why, type: apt-get update && apt-get install -y $*"
}

find_python() {
    local candidate
    for candidate in ${PYTHON:-python3 python3.13 python3.12 python3.11}; do
        if "$candidate" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 14))' 2> /dev/null; then
            command -v "$candidate"
            return
        fi
    done
    die "${PYTHON:-python3} is not Python 3.11, 3.12 or 3.13; name one that is: make PYTHON=/path/to/python3.12 ..."
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
        apt "this Python can neither make a virtual environment nor run pip" python3-venv
        "$python" -m venv .uv
        .uv/bin/python -m pip install --quiet --require-hashes -r requirements/uv.txt
    fi
}

# Asks golem itself whether native code loads and MuJoCo can draw; its answer names the line to type.
see_to_system() {
    local doctor="$venv/bin/python -m golem.doctor"
    $doctor 2> /dev/null && return
    if [ "$(id -u)" = 0 ] && command -v apt-get > /dev/null; then
        # shellcheck disable=SC2046
        apt "system libraries are missing" $("$venv/bin/python" -c "import golem.doctor as d; print(*d.DEBIAN_PACKAGES)")
    fi
    $doctor || exit 2
}

python=$(find_python)
export UV_PYTHON_DOWNLOADS=never
quiet=
[ -t 2 ] || quiet=--quiet UV_NO_PROGRESS=1
export UV_NO_PROGRESS
locks=()
for group in "$@"; do
    [ -f "requirements/$group.txt" ] || die "no lock requirements/$group.txt; groups: $(cd requirements && echo *.txt | sed 's/\.txt//g')"
    stamp="$venv/.golem-$group"
    sum=$(cat "requirements/$group.txt" pyproject.toml | cksum)
    if [ ! -x "$venv/bin/golem" ] || [ "$sum" != "$(cat "$stamp" 2> /dev/null)" ]; then
        locks+=("$group")
    fi
done
[ "${#locks[@]}" -gt 0 ] || exit 0

find_uv "$python"
if ! "$venv/bin/python" -c 'import sys' 2> /dev/null; then
    "$uv" venv --quiet --clear --python "$python" "$venv"
fi
echo "golem: installing the locked packages (${locks[*]}) into $venv; core alone takes 0.8 GB of disk and some minutes" >&2
for group in "${locks[@]}"; do
    "$uv" pip install $quiet --python "$venv/bin/python" --no-deps --require-hashes -r "requirements/$group.txt"
done
"$uv" pip install --quiet --python "$venv/bin/python" --no-deps --editable .
echo "golem: trying what it needs of this machine" >&2
"$venv/bin/python" scripts/slim.py "$("$venv/bin/python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))')"
see_to_system
for group in "${locks[@]}"; do
    cat "requirements/$group.txt" pyproject.toml | cksum > "$venv/.golem-$group"
done
