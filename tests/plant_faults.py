"""Plant faults in a copy of the sources, one at a time, and see whether the tests find them.

`python -m tests.plant_faults` tries all with the tests of CI; names of faults choose some. `--tree` takes another
checkout, `--select` other marks: so it is seen what a change of the tests loses. A fault whose line is gone is an
error: give it its new line.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

REPOSITORY = Path(__file__).resolve().parent.parent
CI = "not long"
"""Marks of the tests that CI runs."""


class PlantedFault(NamedTuple):
    """A line of a file below `src/golem` that becomes another one, and the tests that shall notice."""

    file: str
    line: str
    becomes: str
    tests: tuple[str, ...]


FAULTS = {
    "gate-torque-steps": PlantedFault(
        "hardware/safety/kernel.py",
        "tau = min(max(tau, last_tau - step), last_tau + step)",
        "tau = min(max(tau, last_tau - 3.0 * step), last_tau + 3.0 * step)",
        ("tests/hardware/safety/test_limiter.py", "tests/hardware/safety/test_kernel.py"),
    ),
    "gate-old-estop": PlantedFault(
        "hardware/safety/gate.py",
        "if t - old.t > limits.estop_age:",
        "if t - old.t > 10.0 * limits.estop_age:",
        ("tests/hardware/safety/test_gate.py",),
    ),
    "gate-late-braking": PlantedFault(
        "hardware/safety/monitor.py",
        "return q + dq * np.abs(dq) / (deceleration + deceleration)",
        "return q + dq * np.abs(dq) / (4.0 * deceleration)",
        ("tests/hardware/safety/test_monitor.py", "tests/hardware/safety/test_kernel.py"),
    ),
    "estimator-turns-backwards": PlantedFault(
        "hardware/estimator/random_walk_kf.py",
        "moving[0] = omega[1] * z - omega[2] * y + feet.rates[k, 0]",
        "moving[0] = omega[2] * y - omega[1] * z + feet.rates[k, 0]",
        ("tests/hardware/estimator/test_base_estimators.py",),
    ),
    "estimator-half-bias": PlantedFault(
        "hardware/estimator/attitude.py",
        "m.value[0] += share * (gyro[0] - twice",
        "m.value[0] += share * (gyro[0] - 0.5 * twice",
        ("tests/hardware/estimator/test_attitude.py",),
    ),
    "servo-no-ramp": PlantedFault(
        "hardware/servo/servo.py", "kp *= m.elapsed / m.ramp", "kp *= 1.0", ("tests/hardware/servo",)
    ),
    "servo-bias-unbounded": PlantedFault(
        "hardware/servo/servo.py",
        "m.bias[i] = min(max(m.bias[i] + m.gains[2, i] * r.dt * error, -bound), bound)",
        "m.bias[i] = m.bias[i] + m.gains[2, i] * r.dt * error",
        ("tests/hardware/servo",),
    ),
    "codec-no-padding": PlantedFault(
        "middleware/ros/codec.py",
        "buffer = self._scratch.zeros(size + -size % 4)",
        "buffer = self._scratch.zeros(size)",
        ("tests/middleware/ros/test_codec.py", "tests/middleware/ros/test_vendor_messages.py"),
    ),
    "planner-too-fast": PlantedFault(
        "capabilities/planning/path_planner.py",
        "cap = (SLACK * limits.speed / both).min(axis=1)",
        "cap = (1.2 * limits.speed / both).min(axis=1)",
        ("tests/capabilities/planning/test_rrt_connect.py",),
    ),
    "memory-rivals-itself": PlantedFault(
        "capabilities/memory/object_map.py",
        "for k in chosen if records.label(k) != label",
        "for k in chosen if records.label(k) == label",
        ("tests/capabilities/memory/test_object_map.py",),
    ),
    "skill-feels-late": PlantedFault(
        "skills/force_guard.py",
        "self.stuck = force > limit and",
        "self.stuck = force > 3.0 * limit and",
        ("tests/skills/test_force_guard.py",),
    ),
    "skill-follows-links": PlantedFault(
        "skills/kept_file.py",
        "if path.is_symlink():",
        "if path.is_symlink() and path.is_dir():",
        ("tests/skills/test_kept_file.py",),
    ),
    "way-ignores-costs": PlantedFault(
        "capabilities/navigation/astar.py",
        "through = spent[cell] + length + beta * cost[r, c]",
        "through = spent[cell] + length + 0.0 * beta",
        ("tests/capabilities/navigation/test_astar.py",),
    ),
    "walkers-go-back": PlantedFault(
        "capabilities/navigation/movers.py",
        "return self.middle + (t - self.places[-1][0]) * self.velocity",
        "return self.middle - (t - self.places[-1][0]) * self.velocity",
        ("tests/capabilities/navigation/test_movers.py",),
    ),
    "collision-clears-the-rest": PlantedFault(
        "capabilities/collision/obstacles.py",
        'near |= np.einsum("ij,ij->i", off, off) < reach * reach',
        'near |= np.einsum("ij,ij->i", off, off) > reach * reach',
        ("tests/capabilities/collision/test_scene_cloud.py",),
    ),
    "odometry-begins-moving": PlantedFault(
        "capabilities/odometry/still_start.py",
        "if moving or np.abs(bias).max() > LARGEST_BIAS:",
        "if np.abs(bias).max() > 10.0 * LARGEST_BIAS:",
        ("tests/capabilities/odometry/test_lio.py",),
    ),
    "bag-repair-forgets": PlantedFault(
        "middleware/bags/reader.py",
        "os.replace(part, file.path)",
        "part.unlink()",
        ("tests/middleware/bags/test_bag.py",),
    ),
    "options-take-nan": PlantedFault(
        "options.py",
        "elif value != value:",
        "elif value is Ellipsis:",
        ("tests/test_options.py", "tests/test_stack.py", "tests/test_registry.py"),
    ),
    "cli-refusal-is-failure": PlantedFault(
        "cli.py", "BAD_INPUT = 2\n", "BAD_INPUT = 1\n", ("tests/test_cli.py", "tests/test_run.py")
    ),
    "skill-sees-the-truth": PlantedFault(
        "skills/walk.py",
        "from golem.options import require\n",
        "from golem.evaluation.base import DONE as DONE\nfrom golem.options import require\n",
        ("tests/test_layers.py", "tests/test_no_truth.py"),
    ),
}


def copied(tree: Path, folder: Path) -> Path:
    """Return a copy of the checkout `tree` in `folder`, with the kernels that it has compiled."""
    target = folder / "tree"
    listed = subprocess.run(["git", "-C", str(tree), "ls-files", "-z"], check=True, capture_output=True, text=True)
    kernels = [str(path.relative_to(tree)) for path in tree.glob("src/**/__pycache__/*.nb[ic]")]
    for name in [*filter(None, listed.stdout.split("\0")), *kernels]:
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(tree / name, target / name, follow_symlinks=False)
    shared = tree.parent / "shared"
    if shared.is_dir():
        (folder / "shared").symlink_to(shared.resolve())
    return target


def noticed(tree: Path, fault: PlantedFault, select: str) -> str | None:
    """Return the first test that fails with the fault in the copy `tree`, None if none does.

    Raises:
        SystemExit: the line is not there once, or the tests could not be run.
    """
    path = tree / "src" / "golem" / fault.file
    whole = path.read_text(encoding="utf-8")
    if whole.count(fault.line) != 1:
        raise SystemExit(f"{fault.file} holds {whole.count(fault.line)} times: {fault.line}")
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "--timeout", "900"]
    try:
        path.write_text(whole.replace(fault.line, fault.becomes), encoding="utf-8")
        done = subprocess.run(
            [*command, "-m", select, *fault.tests],
            cwd=tree,
            env=os.environ | {"PYTHONPATH": str(tree / "src")},
            capture_output=True,
            text=True,
            check=False,
        )
    finally:
        path.write_text(whole, encoding="utf-8")
    if done.returncode not in (0, 1):
        raise SystemExit(done.stdout + done.stderr)
    failed = re.search(r"^(?:FAILED|ERROR) (\S+)", done.stdout, re.M)
    return None if done.returncode == 0 else failed[1] if failed else done.stdout


def main() -> int:
    """Try the faults; return 1 if one is not found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help="faults to plant; default: all")
    parser.add_argument("--tree", type=Path, default=REPOSITORY, help="checkout whose sources and tests are taken")
    parser.add_argument("--select", default=CI, help="marks of the tests, as pytest's -m takes them")
    given = parser.parse_args()
    if unknown := set(given.names) - set(FAULTS):
        parser.error(f"unknown faults {sorted(unknown)}; there are {list(FAULTS)}")
    lost: list[str] = []
    with tempfile.TemporaryDirectory() as folder:
        tree = copied(given.tree.resolve(), Path(folder))
        for name in given.names or FAULTS:
            by = noticed(tree, FAULTS[name], given.select)
            print(f"{name:26} {f'found by {by}' if by else 'NOT FOUND'}", flush=True)
            if by is None:
                lost.append(name)
    print(f"{len(given.names or FAULTS) - len(lost)} of {len(given.names or FAULTS)} faults found")
    return 1 if lost else 0


if __name__ == "__main__":
    sys.exit(main())
