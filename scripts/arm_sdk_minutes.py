"""Drives the arms of a standing twin as a headset's program does: `python scripts/arm_sdk_minutes.py [SECONDS] [SEED]`.

A program asks for the arms over /arm_sdk at 50 Hz, as xr_teleoperate's does, with its gains, and torques of gravity:
weight 0 to 1, then joints that move both wrists to and fro as an operator does (sums of sines of 0.05 to 0.5 Hz, drawn
from the seed), then weight 1 to 0. Twin, gate and stack are three members of a domain in one process, in simulated
time. Prints whether the robot stands, how far the wrists are by the reported joints from where they were asked to be,
with and without what the arms lag, and the largest step of the arms' commands while the weight goes.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
import pinocchio as pin

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
from tests.runtime.live.conftest import BLIND, Live
from tests.runtime.live.test_arm_sdk import message

from golem.capabilities.arms.arm_kinematics import UpperKinematics
from golem.capabilities.arms.postures import POSTURES
from golem.middleware.dds.base import Qos
from golem.middleware.wire import convert, hg
from golem.stack import load_stack
from golem.types import ARMS, SIDES, UPPER, Array

PERIOD = 0.02
"""Time between two messages of the program [s]."""
AMPLITUDE: Array = np.tile([0.25, 0.12, 0.25, 0.35, 0.3, 0.2, 0.3], 2)
"""Largest way of each joint from the posture `ready` [rad]."""
LAGS = np.arange(0, 16)
"""Delays that are tried [periods]."""
KP, KD = np.tile([140.0] * 4 + [50.0] * 3, 2), np.tile([3.0] * 4 + [2.0] * 3, 2)
"""Of the arms' joints [N m/rad], [N m s/rad]: xr_teleoperate 1.1, H1_2_ArmController."""


def standing(folder: Path) -> Live:
    """Return a twin on its feet, whose gate is open."""
    (folder / "blind.py").write_text(BLIND)
    stack = load_stack("stand", profile="field").with_choice("localizer", f"{folder / 'blind.py'}:Blind")
    live = Live(stack.with_options("robot", world="open"))
    live.start_twin()
    live.start_gate()
    live.start_up()
    live.activate()
    live.run(5.0)
    return live


def main(seconds: float, seed: int) -> None:
    """Drive, and print."""
    rng, count = np.random.default_rng(seed), 4
    rates, phases = rng.uniform(0.05, 0.5, (count, 14)), rng.uniform(0.0, 2.0 * np.pi, (count, 14))
    shares = rng.dirichlet(np.ones(count), 14).T
    arm, ready = UpperKinematics(), POSTURES["ready"]

    def asked(t: float) -> Array:
        waves = (shares * np.sin(2.0 * np.pi * rates * t + phases)).sum(axis=0)
        return np.clip(ready[1:] + min(1.0, t / 5.0) * AMPLITUDE * waves, arm.lower[1:] + 0.02, arm.upper[1:] - 0.02)

    with tempfile.TemporaryDirectory() as folder:
        live = standing(Path(folder))
        participant, _ = live.member("program")
        writer = participant.writer("rt/arm_sdk", hg.LOW_CMD.type_name, Qos(depth=1))
        reader = participant.reader("rt/lowcmd", hg.LOW_CMD.type_name, Qos(depth=100))
        states = participant.reader("rt/lowstate", hg.LOW_STATE.type_name, Qos(depth=100))
        rows: list[tuple[Array, Array]] = []
        measured: list[Array] = []
        steps: list[float] = []

        def send(weight: float, q: Array) -> None:
            gravity = pin.computeGeneralizedGravity(arm.model, arm.data, np.append(0.0, q))
            writer.write(message(weight, q, tau=gravity[1:], kp=KP, kd=KD))
            live.run(PERIOD)
            measured.extend(convert.decode_low_state(s.payload).q[UPPER] for s in states.take() if s.alive)
            sent = np.array([convert.decode_low_command(s.payload, 0.0).q[ARMS] for s in reader.take() if s.alive])
            if len(sent) > 1:
                steps.append(float(np.abs(np.diff(sent, axis=0)).max()))

        for k in range(round(4.0 / PERIOD)):
            send(min(1.0, k * PERIOD / 3.0), ready[1:])
        rise, steps[:] = max(steps), []
        for k in range(round(seconds / PERIOD)):
            q = asked(k * PERIOD)
            send(1.0, q)
            rows.append((q, measured[-1]))
            if live.state.value != "active":
                break
        steps[:] = []
        for k in range(round(4.0 / PERIOD)):
            send(max(0.0, 1.0 - k * PERIOD / 3.0), rows[-1][0])
        height, state = float(live.robot.data.qpos[2]), live.state.value
        live.close()
    wrists = np.array(
        [
            [[arm.pose(side, upper)[:3, 3] for side in SIDES] for upper in (np.concatenate([q[:1], a]), q)]
            for a, q in rows
        ]
    )
    away = [
        np.sqrt((np.linalg.norm(wrists[lag:, 1] - wrists[: len(wrists) - lag, 0], axis=-1) ** 2).mean()) for lag in LAGS
    ]
    best = int(np.argmin(away))
    speed = np.linalg.norm(np.diff(wrists[:, 0], axis=0), axis=-1) / PERIOD
    print(f"{len(rows) * PERIOD:.0f} s of robot time, gate {state}, pelvis at {height:.2f} m")
    print(f"wrists are asked to move at {speed.mean():.2f} m/s (mean), {np.percentile(speed, 99):.2f} m/s (99 %)")
    print(f"off by {1e3 * away[0]:.1f} mm RMS; {1e3 * away[best]:.1f} mm after a lag of {1e3 * best * PERIOD:.0f} ms")
    print(f"largest step of an arm's joint per tick: weight 0 to 1 {rise:.4f} rad, 1 to 0 {max(steps):.4f} rad")


if __name__ == "__main__":
    main(float((sys.argv[1:2] or ["60"])[0]), int((sys.argv[2:3] or ["0"])[0]))
