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

rung() { "$GOLEM" ladder --rung "$1" -j "$JOBS" --out "$OUT/$name" --seed 0 "${@:2}"; }

peers=(wbc mpc vendor)
public=()
[ -z "$ALMI" ] || public+=("policy:almi_open:$ALMI")
[ -z "$RL_GYM" ] || public+=("policy:unitree_rl_gym:$RL_GYM")

# Standing, and walking: side by side with others.
shoves() { rung push-limit --phase standing --first 40 --method almi "${peers[@]}" "${public[@]}"; }
own_terms() { rung push-limit --terms own --phase standing walking --first 40 --method almi wbc "${public[@]}"; }
gate_share() { rung push-limit --terms stack unstopped ungated own --phase walking --walk 0.3 0.6 0.3,0,0.4 --first 40 \
    --method almi "${public[@]}"; }
rods() { rung push-limit --kind rod --phase standing --first 150 --last 150; }
quiet() { rung stand-quiet; }
arms() { rung stand-arms -n 100; }
push_rung() { rung push -n 300; }
ramp() { rung push-ramp --method almi wbc -n 40; }
# Walking.
swings() { rung push-limit --phase left_swing right_swing --first 30 --method almi vendor "${public[@]}"; }
tracking() { rung walk-twist; }
stopping() { rung walk-stop -n 200; }
line() { rung navigate-line; }
endurance() { rung walk-endurance -n 120; }
rough() { rung walk-rough; }
tour() { rung tour --engine mujoco physx --method almi vendor wbc "${public[@]}"; }
plans() { JOBS=1 rung mpc-rate; }
# On another plant.
box_feet() { rung push-limit --phase standing --first 60 --robot feet=box cone=elliptic; }
vendor_model() { [ -z "$MJCF" ] || rung push-limit --phase standing --first 60 --robot "mjcf=$MJCF"; }
estimators() { rung base-estimation; }
# The work.
tether() { rung tether -n 100; }
stand() { rung stand -n 100; }
mcnemar() { "$GOLEM" compare "$OUT/tether" "$OUT/stand"; }

ALL=(shoves own_terms rods quiet tracking stopping push_rung ramp rough swings gate_share line arms endurance tour stand
    tether mcnemar box_feet vendor_model plans estimators)
[ $# -gt 0 ] || set -- "${ALL[@]}"
mkdir -p "$OUT"
for name; do
    [[ " ${ALL[*]} " == *" $name "* ]] || { echo "Unknown measurement '$name'; choose from: ${ALL[*]}." >&2; exit 2; }
done
for name; do
    echo "== $name =="
    "$name" | tee "$OUT/$name.txt"
done
# What docs/results.md shows, from the run folders.
folders=()
for name; do [ ! -f "$OUT/$name/trials.jsonl" ] || folders+=("$OUT/$name"); done
[ "${#folders[@]}" -eq 0 ] || "$GOLEM" results "${folders[@]}" --out "$OUT/tables.md"
