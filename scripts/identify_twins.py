"""Draws twins with hidden parameters, lets `golem identify` find them, and says by how much it is off.

    python scripts/identify_twins.py --seeds 0 20 --folder runs/identify_twins

A bag, and what was found, stay in the folder; a twin whose bag is there is not recorded again.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import yaml

from golem.evaluation.identification import regressor as r
from golem.evaluation.identification.fit import Identified, identify
from golem.evaluation.identification.identify_command import halves, record_motion, save, tracking_error
from golem.evaluation.identification.recording import read_motion
from golem.robots.model.table import JOINT_NAMES
from golem.stack import load_stack
from golem.types import NUM_JOINTS, TICK

GAUGE = [JOINT_NAMES.index(n) for n in ("left_hip_yaw_joint", "right_hip_yaw_joint", "torso_joint")]
"""Joints about one vertical axis: a hanging robot tells sums of their zeros only."""
LIMBS = {"left leg": slice(1, 7), "right leg": slice(7, 13), "left arm": slice(14, 21), "right arm": slice(21, 28)}


def draw(seed: int) -> Identified:
    """Return the hidden parameters of one twin."""
    rng = np.random.default_rng([48, seed])
    x = r.NOMINAL.copy()
    x[r.MASS] = rng.uniform(-0.1, 0.1, 28)
    x[r.PAYLOAD] = rng.uniform(0.0, 1.5, 2)
    x[r.ARMATURE] *= rng.uniform(0.7, 1.5, NUM_JOINTS)
    x[r.DAMPING] *= rng.uniform(0.5, 2.0, NUM_JOINTS)
    x[r.FRICTION] = np.r_[rng.uniform(0.3, 2.0, 12), rng.uniform(0.1, 0.8, 15)]
    x[r.ZERO] = np.r_[0.010 * rng.standard_normal(12), 0.0306 * rng.standard_normal(15)]
    delay, gain = TICK * float(rng.integers(0, 8)), 1.0 + 0.03 * rng.standard_normal(NUM_JOINTS)
    return Identified(x, np.zeros_like(x), delay, gain, {})


def record(seed: int, folder: Path, seconds: float) -> None:
    """Write the twin's body and profile, and the bag of its motion."""
    hidden = draw(seed)
    save(hidden, folder / "hidden", "")
    payload = [float(mass) for mass in hidden.x[r.PAYLOAD]]
    stack = replace(load_stack("tether"), profile=str(folder / "hidden" / "profile.yaml"))
    stack = stack.with_options("robot", mjcf=str(folder / "hidden" / "body.xml"), payload=payload)
    record_motion(stack, seed, folder / "bag", seconds)


def judge(seed: int, folder: Path) -> dict[str, object]:
    """Identify one twin and return the errors."""
    hidden, begun = draw(seed), time.process_time()
    kept, rest = halves(read_motion(folder / "bag"))
    weight = r.BARE + float(r.MASSES @ hidden.x[:30])
    found, weighed = (identify(kept, w) for w in (None, weight))
    before, after = (tracking_error(x, t, rest) for x, t in ((r.NOMINAL, 0.0), (found.x, found.delay)))
    save(found, folder / "found", "")
    off, mass = found.x - hidden.x, r.MASSES[:28]
    zeros = off[r.ZERO] * 1e3
    others = np.delete(zeros, GAUGE)
    return {
        "seed": seed,
        "cpu [s]": round(time.process_time() - begun, 1),
        "limbs [%]": {
            n: round(100.0 * float(off[:28][s] @ mass[s] / ((1 + hidden.x[:28][s]) @ mass[s])), 2)
            for n, s in LIMBS.items()
        },
        "mass [%]": round(100.0 * float(off[:30] @ r.MASSES / weight), 2),
        "mass, weighed [%]": round(100.0 * float((weighed.x - hidden.x)[:30] @ r.MASSES / weight), 2),
        "payload [kg]": [round(float(v), 3) for v in off[r.PAYLOAD]],
        "delay [ms]": round(1e3 * float(found.delay - hidden.delay), 2),
        "friction, worst [%]": round(100.0 * float(np.abs(off[r.FRICTION] / hidden.x[r.FRICTION]).max()), 1),
        "damping, worst [%]": round(100.0 * float(np.abs(off[r.DAMPING] / hidden.x[r.DAMPING]).max()), 1),
        "armature, worst but waist [%]": round(
            100.0 * float(np.delete(np.abs(off[r.ARMATURE] / hidden.x[r.ARMATURE]), 12).max()), 1
        ),
        "gain, worst [%]": round(100.0 * float(np.abs(found.gain - hidden.gain).max()), 2),
        "zeros, worst of 24 [mrad]": round(float(np.abs(others).max()), 2),
        "zeros, rms of 24 [mrad]": round(float(np.sqrt((others**2).mean())), 2),
        "zeros of hip yaws and waist [mrad]": [round(float(v), 1) for v in zeros[GAUGE]],
        "tracking before, after [mrad]": [round(1e3 * before, 2), round(1e3 * after, 2)],
        "zeros in units of sigma": round(float(np.sqrt(np.mean((off / found.sigma)[r.ZERO] ** 2))), 2),
    }


def main() -> None:
    """Record and judge twins, and print a row for each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs=2, default=(0, 5), help="first seed, and the one after the last")
    parser.add_argument("--folder", type=Path, default=Path("runs/identify_twins"))
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--record-only", action="store_true")
    args = parser.parse_args()
    for seed in range(*args.seeds):
        folder = args.folder / str(seed)
        if not (folder / "bag").is_dir():
            record(seed, folder, args.seconds)
        if args.record_only:
            continue
        row = judge(seed, folder)
        (folder / "errors.json").write_text(json.dumps(row, indent=1) + "\n", encoding="utf-8")
        print(yaml.safe_dump(row, sort_keys=False, width=200), flush=True)


if __name__ == "__main__":
    main()
