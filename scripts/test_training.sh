#!/usr/bin/env bash
# Runs the tests that need the extra `train`, in an environment of its own, .venv-train: torch is large, and nothing else needs it.
set -euo pipefail
cd "$(dirname "$0")/.."

VENV=.venv-train scripts/bootstrap.sh dev train
# A test that is skipped for want of the extra would pass unseen, so no skip for that reason may remain.
.venv-train/bin/pytest -n 2 tests/training tests/capabilities/legs/test_network.py tests/capabilities/legs/test_policy.py \
    tests/capabilities/perception/test_onnx_detector.py | tee .venv-train/tests.log
if grep -E "SKIPPED.*(torch|onnx|extra 'train')" .venv-train/tests.log; then
    echo "golem: the tests above were skipped although the extra 'train' is installed" >&2
    exit 1
fi
