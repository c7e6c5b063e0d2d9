#!/usr/bin/env bash
# Usage: scripts/batch/legs.sh LIMIT OUT NAME [OPTION...]
#
# Trains legs with $JOBS threads of physics (default: one per processor) from the last checkpoint, for LIMIT seconds of
# wall clock. Checkpoint and curve of the run NAME come as pieces into OUT; IN names the folder with those of an earlier
# call. OPTIONs are those of `golem train legs run`, the same in every call. For example:
#     IN=out scripts/batch/legs.sh 570 out walk0 --task walk --seed 0 --steps 24e6
set -euo pipefail
LIMIT=${1:?how long, in seconds} OUT=$(realpath -m "${2:?where the results go}") NAME=${3:?name of the run}
WORK=$(realpath -m "${WORK:-runs/batch}")/legs
shift 3
# shellcheck source=scripts/batch/common.sh
. "$(dirname "$0")/common.sh"
resume

within "$(left)" "$GOLEM" train legs run --out "$WORK/$NAME" --threads "$JOBS" "$@" || status=$?
save .
exit "${status:-0}"
