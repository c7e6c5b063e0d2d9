#!/usr/bin/env bash
# Usage: scripts/batch/legs.sh LIMIT OUT NAME [OPTION...]
#
# Trains legs from the last checkpoint for LIMIT seconds of wall clock, on the GPU if there is one. The first call probes
# for $PROBE seconds (20) whether as many processes as processors ($JOBS) or half of them are faster, and without --steps
# chooses as many as the time allows; later calls keep that choice. Checkpoint, curve and exported network of the run
# NAME come as pieces into OUT; IN names the folder with those of an earlier call. OPTIONs are those of
# `golem train legs run`, the same in every call. For example:
#     scripts/batch/legs.sh 570 out walk0 --task walk --seed 0 --start src/golem/capabilities/legs/policies/almi_walk.onnx
set -euo pipefail
LIMIT=${1:?how long, in seconds} OUT=$(realpath -m "${2:?where the results go}") NAME=${3:?name of the run}
WORK=$(realpath -m "${WORK:-runs/batch}")/legs
shift 3
# shellcheck source=scripts/batch/common.sh
. "$(dirname "$0")/common.sh"
resume
RUN=$WORK/$NAME PROBE=${PROBE:-20}
starts=15 # seconds until a run's processes are there

# rate SHARDS OPTION...: steps per second of wall clock of a run with so many processes.
rate() {
    local shards=$1 probe
    shift
    probe=$(mktemp -d)
    "$GOLEM" train legs run --out "$probe" "$@" --steps 1e12 --shards "$shards" --robots "$(robots "$shards")" \
        --seconds $((PROBE / 2)) > /dev/null
    awk -F, 'NR == 1 { for (i = 1; i <= NF; i++) column[$i] = i } END { printf "%d", $column["steps"] / $column["wall_s"] }' \
        "$probe/curve.csv"
    rm -r "$probe"
}
robots() { echo $(($1 < 4 ? 512 / $1 * $1 : 128 * $1)); }

if [ ! -e "$RUN/choice" ]; then
    best=0 chosen=1
    for shards in $( (echo $((JOBS / 2)); echo "$JOBS") | grep -v '^0$' | sort -un); do
        before=$SECONDS
        found=$(rate "$shards" "$@")
        starts=$((SECONDS - before - PROBE / 2 + 5))
        echo "golem: $shards processes make $found steps a second"
        [ "$found" -le "$best" ] || best=$found chosen=$shards
    done
fi
seconds=$(($(left) - starts))
[ "$seconds" -gt 0 ] || { echo "golem: nothing is left of $LIMIT s to train in" >&2; exit 2; }
if [ ! -e "$RUN/choice" ]; then
    mkdir -p "$RUN"
    echo "--shards $chosen --robots $(robots "$chosen") --steps $((best * seconds))" > "$RUN/choice"
fi
read -ra choice < "$RUN/choice"
within "$(left)" "$GOLEM" train legs run --out "$RUN" "${choice[@]}" "$@" --seconds "$seconds" || status=$?
[ ! -e "$RUN/checkpoint.pt" ] || "$GOLEM" train legs export --checkpoint "$RUN/checkpoint.pt" --folder "$RUN/export"
save .
exit "${status:-0}"
