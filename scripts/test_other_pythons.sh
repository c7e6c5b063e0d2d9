#!/usr/bin/env bash
# Usage: scripts/test_other_pythons.sh [VERSION...]     default: 3.13 3.12 3.11
#
# Runs the fast tests of what another Python may do otherwise with every VERSION but that of .venv, each in an
# environment of its own, .venv-3.13 for one; says which are not on this machine. With ALL=1: all fast tests.
set -euo pipefail
cd "$(dirname "$0")/.."

# Dataclasses, type hints, enumerations and options; bytes, text and files; processes, threads, signals and asyncio;
# command lines. `golem doctor --compile` compiles the kernels from this Python's bytecode and tries them. Left out is
# what only calculates: the same wheels of NumPy, MuJoCo and Pinocchio do that, whatever the Python.
portable=(
    tests/capabilities/memory tests/dashboard/test_server.py tests/dashboard/test_status.py
    tests/evaluation/harness tests/evaluation/metrics tests/evaluation/report tests/evaluation/test_base.py
    tests/hardware/drivers tests/hardware/estop
    tests/hardware/safety/test_gate.py tests/hardware/safety/test_kernel.py
    tests/interfaces tests/middleware tests/robots/replay
    tests/runtime/live tests/runtime/bringup tests/runtime/test_call_times.py tests/runtime/test_checked.py
    tests/runtime/test_contract_check.py tests/runtime/test_executor.py tests/runtime/test_goal_parser.py
    tests/runtime/test_skill_table.py
    tests/skills/test_context.py tests/skills/test_kept_file.py tests/skills/test_runner.py tests/skills/test_spec.py
    tests/test_cli.py tests/test_doctor.py tests/test_domains.py tests/test_errors.py tests/test_option_list.py
    tests/test_options.py tests/test_provenance.py tests/test_registry.py tests/test_run.py tests/test_show_trial.py
    tests/test_stack.py tests/test_true_runs.py
)
[ -z "${ALL:-}" ] || portable=(tests)

own=$(.venv/bin/python -c 'import sys; print("%d.%d" % sys.version_info[:2])')
[ $# -gt 0 ] || set -- 3.13 3.12 3.11
for version in "$@"; do
    [ "$version" != "$own" ] || continue
    # Where pyenv keeps the interpreters, one answers only to who asks for its version.
    if ! python=$(PYENV_VERSION=$version "python$version" -c 'import sys; print(sys.executable)' 2> /dev/null); then
        echo "golem: no python$version on this machine: not tested with it"
        continue
    fi
    echo "golem: the portable tests with Python $version"
    PYTHON=$python VENV=.venv-$version scripts/bootstrap.sh dev
    ".venv-$version/bin/golem" doctor --compile
    ".venv-$version/bin/pytest" -n 2 -m "not slow" "${portable[@]}"
done
