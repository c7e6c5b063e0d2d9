#!/usr/bin/env bash
# Usage: scripts/compile_kernels.sh [VENV]     default: .venv
#
# Compiles the numba kernels before the tests: once each, in one process, and outside of the time limit of a test. They
# are kept in src/golem/**/__pycache__ (or $NUMBA_CACHE_DIR), where the workers of a test run and all environments of
# one version of Python find them. It does so by running a few tests that together call
# the kernels, and does nothing where no kernel has changed since.
set -euo pipefail
cd "$(dirname "$0")/.."

bin=${1:-.venv}/bin
stamp=.cache/kernels-$("$bin/python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
sum=$(grep -rl --include='*.py' '^@njit' src | sort | xargs cat | cat - requirements/dev.txt "$0" | cksum)
[ "$sum" != "$(cat "$stamp" 2> /dev/null)" ] || exit 0
"$bin/pytest" -n 2 --dist loadfile --timeout 0 -q -p no:cacheprovider \
    tests/capabilities/arms/test_quick_ik.py \
    tests/capabilities/collision/test_collision_model.py \
    tests/capabilities/mapping/test_scan_kernel.py \
    tests/capabilities/mapping/test_voxel_grid.py::test_a_map_from_before_is_found_from_a_rough_guess \
    tests/capabilities/navigation/test_astar.py::test_400_by_400_is_fast \
    tests/capabilities/navigation/test_rollout.py \
    tests/capabilities/odometry/test_lio.py::test_it_follows_within_two_centimetres_and_starts_level \
    tests/capabilities/planning/test_rrt_connect.py::test_around_what_is_in_the_way \
    tests/hardware/estimator/test_invariant.py \
    tests/robots/mujoco/test_ray_kernel.py \
    tests/robots/sensors/test_mid360.py \
    tests/robots/mujoco/test_lidar_sensor.py::test_the_points_of_a_moving_robot_are_smeared_by_its_motion \
    tests/runtime/test_stale_base.py \
    "tests/test_no_truth.py::test_no_module_of_a_standing_robot_does[wbc]" \
    tests/test_determinism.py::test_another_seed_gives_another_run
mkdir -p .cache
echo "$sum" > "$stamp"
