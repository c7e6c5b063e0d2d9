#!/usr/bin/env bash
# Usage: scripts/batch/ladder.sh LIMIT OUT RUNG [OPTION...] [, RUNG [OPTION...]]...
#
# Runs these ladders one after the other with $JOBS processes (default: one per processor) and $N trials a method
# (default 200), for LIMIT seconds of wall clock all in all; the run folders come as pieces into OUT. The same command
# goes on where it was, also on another machine where IN names the folder with the pieces. For example:
#     scripts/batch/ladder.sh 570 out push --method almi , tether , stand --layout varied
set -euo pipefail
LIMIT=${1:?how long, in seconds} OUT=$(realpath -m "${2:?where the results go}") N=${N:-200}
WORK=$(realpath -m "${WORK:-runs/batch}")/ladders
shift 2
# shellcheck source=scripts/batch/common.sh
. "$(dirname "$0")/common.sh"
resume

# run RUNG OPTION...: the folder is named by both.
run() {
    local name
    name=$(echo "$*" | tr -cs 'A-Za-z0-9\n' '_')
    # One process compiles the kernels; the others find them.
    [ -e "$WORK/$name" ] || within $(($(left) / 3)) "$GOLEM" ladder --rung "$@" -n 1 --out "$(mktemp -d)" > /dev/null
    within "$(left)" "$GOLEM" ladder --rung "$@" -n "$N" -j "$JOBS" --out "$WORK/$name"
}

words=()
status=0
for word in "$@" ,; do
    if [ "$word" != , ]; then
        words+=("$word")
    elif [ "${#words[@]}" -gt 0 ]; then
        run "${words[@]}" || status=$?
        words=()
    fi
done
save .
exit "$status"
