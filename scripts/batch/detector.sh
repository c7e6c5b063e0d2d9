#!/usr/bin/env bash
# Usage: scripts/batch/detector.sh LIMIT OUT [OPTION...]
#
# Renders images (at most $RENDER seconds, default 150) and trains the detector on the GPU from the last checkpoint, for
# LIMIT seconds of wall clock all in all. Checkpoints and curve come as pieces into OUT; IN names the folder with those
# of an earlier call. The images stay: a fresh machine renders them again. OPTIONs are those of `golem train detector
# train`; DEVICE=cpu where there is no GPU, WORLDS, KITCHENS and HELD (550, 200, 30) say how many are rendered.
set -euo pipefail
LIMIT=${1:?how long, in seconds} OUT=$(realpath -m "${2:?where the results go}")
WORK=$(realpath -m "${WORK:-runs/batch}")/detector
shift 2
# shellcheck source=scripts/batch/common.sh
. "$(dirname "$0")/common.sh"
resume

images=$WORK/images run=$WORK/run render=${RENDER:-150}
[ "$render" -le "$(left)" ] || render=$(left)
within "$render" "$GOLEM" train detector render --folder "$images" --worlds "${WORLDS:-550}" \
    --kitchens "${KITCHENS:-200}" --held-out-worlds "${HELD:-30}" --held-out-kitchens $((${HELD:-30} / 2)) \
    --jobs "$JOBS" ${PER_CAMERA:+--per-camera "$PER_CAMERA"}
mkdir -p "$run"
within "$(left)" "$GOLEM" train detector train --data "$images" --out "$run" --steps 7242 --batch 192 --rate 0.003 \
    --check-every 200 --device "${DEVICE:-cuda}" "$@" | tee -a "$run/log.txt" || status=$?
save run
exit "${status:-0}"
