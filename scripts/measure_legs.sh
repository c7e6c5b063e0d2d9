#!/usr/bin/env bash
# Measures what docs/results.md says of the legs, on the code that this checkout holds: hours on two cores.
# An interrupted run goes on where it was. Usage:
#     scripts/measure_legs.sh OUT PROCESSES [MEASUREMENT...]
# ALMI and RL_GYM name the weights of the public checkpoints, MJCF the vendor's model; what needs one that is not given
# is left out.
set -euo pipefail

OUT=$(realpath -m "${1:?where the results go}") JOBS=${2:?how many processes}
ALMI=${ALMI:+$(realpath "$ALMI")} RL_GYM=${RL_GYM:+$(realpath "$RL_GYM")} MJCF=${MJCF:+$(realpath "$MJCF")}
cd "$(dirname "$0")/.."
GOLEM=${GOLEM:-.venv/bin/golem}
shift 2
export OMP_NUM_THREADS=1

push() { "$GOLEM" bench push -j "$JOBS" --out "$OUT/$name" "$@"; }
legs() { "$GOLEM" bench legs --out "$OUT/$name" -j "$JOBS" "$@"; }
ladder() { "$GOLEM" ladder -j "$JOBS" --out "$OUT/$name" --seed 0 "$@"; }

peers=(wbc mpc vendor)
[ -z "$ALMI" ] || peers+=("policy:almi_open:$ALMI")
[ -z "$RL_GYM" ] || peers+=("policy:unitree_rl_gym:$RL_GYM")

# Standing, and walking: side by side with others.
shoves() { push --phase standing --first 40 --method almi "${peers[@]}"; }
rods() { push --kind rod --phase standing --first 150 --last 150; }
quiet() { legs --test quiet; }
arms() { legs --test arms -n 100; }
push_rung() { ladder --rung push --method almi -n 300; }
ramp() { ladder --rung push-ramp --method almi wbc -n 40; }
# Walking.
swings() { push --phase left_swing right_swing --first 30 --method almi vendor "${peers[@]:3}"; }
tracking() { legs --test tracking -n 30; }
stopping() { legs --test stopping -n 200 --profile field; }
line() { ladder --rung navigate-line --method almi -n 30; }
endurance() { legs --test endurance -n 120; }
rough() { legs --test slope rubble -n 20; }
plans() { legs --test plans -n 5 --method mpc -j 1; }
# On another plant.
box_feet() { push --phase standing --first 60 --robot feet=box cone=elliptic; }
vendor_model() { [ -z "$MJCF" ] || push --phase standing --first 60 --robot "mjcf=$MJCF"; }
estimators() { "$GOLEM" bench estimation; }
# The work.
tether() { ladder --rung tether -n 100; }
stand() { ladder --rung stand -n 100; }
mcnemar() { "$GOLEM" compare "$OUT/tether" "$OUT/stand"; }

ALL=(shoves rods quiet tracking stopping push_rung ramp rough swings line arms endurance stand tether mcnemar
    box_feet vendor_model plans estimators)
[ $# -gt 0 ] || set -- "${ALL[@]}"
mkdir -p "$OUT"
for name; do
    [[ " ${ALL[*]} " == *" $name "* ]] || { echo "Unknown measurement '$name'; choose from: ${ALL[*]}." >&2; exit 2; }
done
for name; do
    echo "== $name =="
    "$name" | tee "$OUT/$name.txt"
done
