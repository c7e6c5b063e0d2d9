#!/usr/bin/env bash
# Usage: scripts/test_installs.sh [VERSION...]     default: 3.11 3.12 3.13
#
# Installs the wheel as a stranger would, into an empty HOME without caches and without our locks: by `pip install` with
# every VERSION of Python, and by `uvx` with the first. Each takes one screw with `golem demo`. Prints a table: packages,
# MB, seconds by the clock of the installation and of the demo. `uvx` needs uv, which is taken from where make put it.
set -euo pipefail
cd "$(dirname "$0")/.."
root=$PWD
[ $# -gt 0 ] || set -- 3.11 3.12 3.13

PATH=$PATH:$root/.uv/bin
empty=$(mktemp -d)
trap 'rm -rf "$empty"' EXIT
export UV_PYTHON_DOWNLOADS=never UV_NO_PROGRESS=1
uv build --quiet --wheel --python "$root/.venv/bin/python" --out-dir "$empty/dist"
wheel=$(ls "$empty"/dist/*.whl)
demo=(demo --stack tether --screws 1 --headless --out demo)

# fresh NAME: an empty HOME of that name, which is the working folder from now on.
fresh() {
    mkdir "$empty/$1"
    cd "$empty/$1"
    export HOME=$PWD XDG_CACHE_HOME=$PWD/.cache UV_CACHE_DIR=$PWD/.cache/uv PIP_CACHE_DIR=$PWD/.cache/pip
}

# row NAME FOLDER INSTALLED DEMO: a row of the table; FOLDER holds the packages.
row() {
    local packages
    packages=$(find "$2" -maxdepth 1 -name '*.dist-info' | wc -l)
    ls demo/demo.json demo/*.webp > /dev/null  # no report: that is an extra
    echo "| $1 | $packages | $(du -sm "$2" | cut -f1) | $3 | $4 |"
}

echo "| installed by | packages | MB | installing [s] | demo [s] |"
echo "|---|---|---|---|---|"
for version in "$@"; do
    if ! python=$(PYENV_VERSION=$version "python$version" -c 'import sys; print(sys.executable)' 2> /dev/null); then
        echo "golem: no python$version on this machine: not tried with it" >&2
        continue
    fi
    (
        fresh "pip-$version"
        SECONDS=0
        "$python" -m venv venv
        venv/bin/pip install --quiet --disable-pip-version-check "$wheel"
        installed=$SECONDS SECONDS=0
        venv/bin/golem "${demo[@]}" > demo.log 2>&1 || { cat demo.log >&2; exit 1; }
        row "pip, Python $version" "$(echo "$PWD"/venv/lib/python*/site-packages)" "$installed" "$SECONDS"
    )
    rm -rf "$empty/pip-$version"
    first=${first:-$python}
done
(
    fresh uvx
    SECONDS=0
    uvx --quiet --python "$first" --from "$wheel" golem --version > /dev/null
    installed=$SECONDS SECONDS=0
    uvx --quiet --python "$first" --from "$wheel" golem "${demo[@]}" > demo.log 2>&1 || { cat demo.log >&2; exit 1; }
    folder=$(find "$UV_CACHE_DIR" -path '*/site-packages/golem_humanoid-*.dist-info' -prune | head -n 1)
    row "uvx" "${folder%/*}" "$installed" "$SECONDS"
)
