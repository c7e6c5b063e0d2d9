"""Read a bag: how much does a knee move while the robot hangs for half a second? Needs the extra record."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from golem.middleware.bags.reader import Bag
from golem.middleware.wire.convert import decode_low_state
from golem.robots.model.table import JOINT_NAMES
from golem.runtime.live.broadcast import broadcast
from golem.runtime.lockstep import build
from golem.stack import load_stack


def record(folder: Path) -> None:
    """Write what half a second of the twin says on its topics."""
    running, robot = build(load_stack("tether"), seed=0)
    with broadcast(running, robot, folder) as show:
        running.executor.run(0.5, lambda: bool(show()))
    robot.close()


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        record(Path(folder) / "bag")
        bag = Bag(Path(folder) / "bag")
        states = [decode_low_state(message.payload) for message in bag.messages(["/lowstate"])]
        q = np.array([state.q for state in states])
        knee = JOINT_NAMES.index("left_knee_joint")
        print(f"{len(states)} states of {len(bag.topics)} topics; knee moves {np.ptp(q[:, knee]):.4f} rad")


if __name__ == "__main__":
    main()
