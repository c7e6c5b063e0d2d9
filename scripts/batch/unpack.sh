#!/usr/bin/env bash
# Usage: scripts/batch/unpack.sh PIECES [VENV]
#
# Makes VENV (default .venv-batch) of the pieces in the folder PIECES, this checkout's code, and what the machine's own
# python3 has: no network, no pip. Pieces may come one by one: the environment is made once all of them are there,
# which PIECES/count says where there is such a file. Does nothing where it was made of the same pieces.
set -euo pipefail
PIECES=$(realpath "${1:?folder of the pieces}") VENV=$(realpath -m "${2:-.venv-batch}")
cd "$(dirname "$0")/../.."

pieces=("$PIECES"/packages.tgz.*)
[ -e "${pieces[0]}" ] || { echo "golem: there are no pieces in $PIECES" >&2; exit 2; }
wanted=$(cat "$PIECES/count" 2> /dev/null || echo "${#pieces[@]}")
if [ "${#pieces[@]}" -lt "$wanted" ]; then
    echo "golem: ${#pieces[@]} of $wanted pieces are here"
    exit 0
fi
sum=$(cat "${pieces[@]}" | cksum)
[ "$sum" != "$(cat "$VENV/.pieces" 2> /dev/null)" ] || exit 0

rm -rf "$VENV"
python3 -m venv --without-pip --symlinks "$VENV"
site=$("$VENV/bin/python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))')
cat "${pieces[@]}" | tar -C "$site" -xz
# Behind ours: the code of this checkout, and the machine's own packages, also where its python3 is an environment.
{ echo "$PWD/src"; python3 -c 'import sysconfig; print(sysconfig.get_path("purelib"))'; } > "$site/zz_batch.pth"
printf '#!/bin/sh\nexec "%s" -m golem "$@"\n' "$VENV/bin/python" > "$VENV/bin/golem"
chmod +x "$VENV/bin/golem"
"$VENV/bin/python" -c 'import golem.runtime.lockstep, mujoco; print("golem: ready, MuJoCo", mujoco.__version__)'
echo "$sum" > "$VENV/.pieces"
