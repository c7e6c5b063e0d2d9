#!/usr/bin/env bash
# Usage: scripts/batch/pack.sh OUT [PYTHON [PRESENT]]
#
# Writes OUT/packages.tgz.00, .01, ...: the locked core for Linux on x86-64 and the interpreter PYTHON (default 3.12),
# in pieces of at most $PIECE (default 40 MiB). PRESENT is what `python3 -m pip list --format=freeze` prints on the
# machine they go to: what it has is left out, in whichever version. Without it everything comes from the lock, except
# torch.
set -euo pipefail
OUT=$(realpath -m "${1:?where the pieces go}") PYTHON=${2:-3.12} PRESENT=${3:+$(realpath "$3")}
cd "$(dirname "$0")/../.."

uv() { if [ -x .uv/bin/uv ]; then .uv/bin/uv "$@"; else command uv "$@"; fi; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# An entry of the lock is a line that names a package and the indented lines of its hashes.
present=$([ -z "$PRESENT" ] || sed -E 's/==.*//; s/[-_.]+/-/g' "$PRESENT" | tr 'A-Z\n' 'a-z ')
awk -v present=" $present " '
    /^[A-Za-z0-9]/ { split($1, part, "=="); keep = index(present, " " part[1] " ") == 0 }
    keep' requirements/core.txt > "$work/lock.txt"

into=(--quiet --target "$work/site" --python-version "$PYTHON" --python-platform x86_64-manylinux_2_28 --no-deps)
uv pip install "${into[@]}" --only-binary :all: --require-hashes -r "$work/lock.txt"
# Of this package only what says that it is installed: its code is the checkout's.
uv pip install "${into[@]}" .
rm -rf "$work/site/golem"
python3 scripts/slim.py "$work/site"

mkdir -p "$OUT"
rm -f "$OUT"/packages.tgz.* "$OUT/count"
tar -C "$work/site" --exclude __pycache__ -cz . |
    split -d -b "${PIECE:-40M}" - "$OUT/packages.tgz."
find "$OUT" -name 'packages.tgz.*' | wc -l > "$OUT/count"
du -h "$OUT"/packages.tgz.*
