from __future__ import annotations

import subprocess
import sys

HEAVY = {"cv2", "mujoco", "onnxruntime", "pinocchio", "scipy.linalg", "scipy.optimize", "torch"}
"""What a gate that is started again must not wait for; numba, which it needs, loads the root of scipy."""


def test_the_safety_process_imports_nothing_heavy() -> None:
    program = "import sys, golem.runtime.live.safety_main; print(*sys.modules)"
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    loaded = set(run.stdout.split())
    assert "golem.hardware.safety.gate" in loaded
    assert not HEAVY & loaded
