#!/usr/bin/env bash
# Picks one screw over DDS with twin, gate and stack as processes of `golem launch tether`, N times, seeds 0 to N - 1, on
# domains from 30 on; says what became of each, in robot time and by the wall clock. Wants a machine with no other work.
# Usage: scripts/measure_live.sh N
set -euo pipefail

N=${1:?how many picks}
cd "$(dirname "$0")/.."
GOLEM=${GOLEM:-.venv/bin/golem}
folder=$(mktemp -d)
trap 'rm -r "$folder"' EXIT

succeeded=0
for ((seed = 0; seed < N; seed++)); do
    domain=$((30 + seed))
    "$GOLEM" launch tether --domain "$domain" --seed "$seed" > "$folder/launch" 2>&1 &
    launcher=$!
    for _ in $(seq 120); do
        ! grep -q "Safety gate: active" "$folder/launch" || break
        sleep 0.5
    done
    began=$(date +%s%N)
    if timeout 300 "$GOLEM" skill pick screw --arm right --domain "$domain" > "$folder/skill" 2>&1; then
        succeeded=$((succeeded + 1))
    fi
    echo "seed $seed: $(tail -n 1 "$folder/skill") of robot time, $((($(date +%s%N) - began) / 1000000)) ms by the clock"
    kill -INT "$launcher"
    wait "$launcher" || true
done
echo "$succeeded of $N picks succeeded."
