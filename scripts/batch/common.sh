# What ladder.sh, detector.sh and legs.sh share; read by them. They have set LIMIT [s], OUT and WORK.
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
BEGAN=$SECONDS
MARGIN=${MARGIN:-25}
JOBS=${JOBS:-$(nproc)}
GOLEM=${GOLEM:-$([ -x .venv-batch/bin/golem ] && echo .venv-batch/bin/golem || echo .venv/bin/golem)}
export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 PYTHONUNBUFFERED=1
[ -n "${MUJOCO_GL:-}" ] || ! ls /dev/nvidia[0-9]* > /dev/null 2>&1 || export MUJOCO_GL=egl

# left: seconds until the results are to be saved.
left() { echo $((LIMIT - MARGIN - (SECONDS - BEGAN))); }

# within SECONDS COMMAND...: runs it, and interrupts it as Ctrl-C does when its time is over, which is no error.
within() {
    local status=0
    [ "$1" -gt 0 ] || return 0
    timeout --signal=INT --kill-after=15 "$@" || status=$?
    case $status in 0 | 124 | 130 | 137) ;; *) return "$status" ;; esac
}

# resume: what an earlier call saved in IN, a folder, is gone on with.
resume() {
    mkdir -p "$WORK" "$OUT"
    local pieces=("${IN:-$OUT}"/results.tgz.*)
    [ ! -e "${pieces[0]}" ] || [ -n "$(ls -A "$WORK")" ] || cat "${pieces[@]}" | tar -C "$WORK" -xz
}

# save PATH...: packs these parts of WORK into OUT/results.tgz.00, .01, ... of at most 15 MiB.
save() {
    local part=$OUT/.part
    rm -rf "$part" && mkdir "$part"
    tar -C "$WORK" -cz "$@" | split -d -b 15M - "$part/results.tgz."
    rm -f "$OUT"/results.tgz.* && mv "$part"/* "$OUT" && rmdir "$part"
    echo "golem: saved after $((SECONDS - BEGAN)) s: $(du -ch "$OUT"/results.tgz.* | tail -n 1 | cut -f 1)"
}
