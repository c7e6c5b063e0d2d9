#!/usr/bin/env bash
# Kills a writer of data sets 100 times with SIGKILL, half of them with pictures: no finished episode is lost, and none
# is there by half. Takes minutes; the tests do it 12 times.
set -euo pipefail
cd "$(dirname "$0")/.."
GOLEM_DATASET_KILLS=${1:-50} .venv/bin/pytest -q -m slow --timeout 0 tests/datasets/test_killed.py
