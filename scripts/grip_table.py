"""Which grip slips and which crushes: `python scripts/grip_table.py -n 200`.

Things are drawn about what they are sold as, and the hand's controllers close on them as on a spring between two pads.
A thing slips where 2 mu F < m (g + a), with the lift's a = 2.5 m/s2 (Xie et al., DeliGrasp, CoRL 2024), and is crushed
where a finger ever pressed harder than it bears. What it prints is the table of docs/how-to/grasp.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import tyro

from golem.capabilities.properties.base import holding_force
from golem.capabilities.properties.property_table import PropertyTable, PropertyTableConfig
from golem.evaluation.metrics.statistics import wilson
from golem.evaluation.metrics.text_table import TextTable
from golem.hardware.hands.base import HandController
from golem.hardware.hands.deligrasp import DeliGrasp
from golem.hardware.hands.magpie import MagpieHand
from golem.robots.model.magpie_model import ARM, MAX_SPEED
from golem.robots.mujoco.hand_servos import SERVO_KP
from golem.skills.take_config import TakeThingConfig
from golem.types import GRAVITY, HandState

LIFT = 2.5
"""Acceleration of the lift [m/s2]."""
DT, SECONDS = 0.01, 3.0
"""Period of a hand's controller, and how long it closes [s]."""
SERVO = SERVO_KP / ARM**2
"""Stiffness of a finger [N/m]."""
NEVER = (100.0, 100.0)
"""Bears more than a finger presses with [N]."""


@dataclass(frozen=True)
class Thing:
    """Uniform ranges of what a thing is truly like.

    Attributes:
        mass: [kg].
        bears: force of a finger that crushes it [N].
        width: between the pads [m].
        believed: mass, friction and stiffness that the hand is told; None asks the shipped table.
    """

    mass: tuple[float, float]
    bears: tuple[float, float]
    width: float
    believed: tuple[float, float, float] | None = None


# Forces: PR2's gripper (pr2_gripper_sensor_msgs/PR2GripperForceServoCommand) says that 10 N can crack an egg or crush a
# soda can; an egg between boards broke at 36.6 N (Mayfield, Determining the force required to break an egg). A tomato's
# skin is pierced at 9.2 N green and 4.5 N ripe (Zheng et al., Agriculture 13, 2023, 2201): pads need no less. A paper
# cup has 390 N/m (DeliGrasp's page) and folds at 5 to 10 mm [assumption]. Ceramics and a closed can bear the hand
# [assumption], a closed bottle of PET 15 to 40 N [assumption]. Masses: eggs of EU's classes M and L; else assumed.
THINGS = {
    "mug": Thing((0.28, 0.42), NEVER, 0.09),
    "can": Thing((0.34, 0.39), NEVER, 0.066),
    "bottle": Thing((0.52, 0.60), (15.0, 40.0), 0.065),
    "egg": Thing((0.053, 0.073), (10.0, 36.6), 0.044),
    "tomato": Thing((0.08, 0.18), (4.5, 9.2), 0.06),
    "paper_cup": Thing((0.01, 0.20), (2.0, 3.9), 0.075),
    "empty_can": Thing((0.012, 0.016), (8.0, 12.0), 0.066, (0.015, 0.4, 3000.0)),
}
FRICTION, STIFFNESS = (0.7, 1.3), (0.5, 2.0)
"""True values per believed ones [assumption]; stiffness in its logarithm."""


def pressed(hand: HandController, force: float, stiffness: float, width: float) -> tuple[float, float]:
    """Return the largest and the last force of a finger [N] that closes with `force` on a spring [N/m] of a `width`."""
    gap = reference = width + 0.02
    t = now = hardest = 0.0
    hand.step(HandState(t, gap, np.full(2, 0.5 * gap), np.zeros(2)), t)
    hand.close(force)
    for _ in range(round(SECONDS / DT)):
        t += DT
        command = hand.step(HandState(t, gap, np.full(2, 0.5 * gap), np.full(2, now)), t)
        reach = 2.0 * MAX_SPEED * ARM * DT
        reference += min(max((command.gap if command.gap > 0.0 else -0.02) - reference, -reach), reach)
        rest = (SERVO * reference + stiffness * width) / (SERVO + stiffness)
        now = min(max(0.5 * stiffness * (width - rest), 0.0), command.force)
        gap = max(width - 2.0 * now / stiffness, 0.0) if now else reference
        hardest = max(hardest, now)
    return hardest, now


@dataclass(frozen=True)
class GripConfig:
    """Hold things adaptively and with fixed forces, and count what slips and what is crushed."""

    n: int = 200
    """Things of each kind."""
    seed: int = 0
    safety: float = 2.0
    """By how much more than the weight a tuned force holds; 2 is what `take` has by default."""
    fixed: tuple[float, ...] = (4.0, 16.0)
    """Fixed forces of each finger [N]; 16 N is what `take` presses with by default."""


def rows(config: GripConfig, label: str, thing: Thing) -> list[tuple[str, ...]]:
    """Return one row per grip of one kind of thing."""
    table = PropertyTable(PropertyTableConfig({} if thing.believed is None else {label: thing.believed}))
    believed, take = table.properties(label), TakeThingConfig()
    rng = np.random.default_rng([config.seed, *label.encode()])
    mass, bears = rng.uniform(*thing.mass, config.n), rng.uniform(*thing.bears, config.n)
    friction = believed.friction * rng.uniform(*FRICTION, config.n)
    stiffness = believed.stiffness * np.exp(rng.uniform(math.log(STIFFNESS[0]), math.log(STIFFNESS[1]), config.n))
    needed = mass * (GRAVITY + LIFT) / (2.0 * friction)
    tuned = float(np.clip(holding_force(believed, config.safety, take.squeeze), take.touch, take.force))
    grips: list[tuple[str, type[MagpieHand], float]]
    grips = [("deligrasp, tuned", DeliGrasp, tuned), ("magpie, tuned", MagpieHand, tuned)]
    grips += [(f"magpie, {force:g} N", MagpieHand, force) for force in config.fixed]
    found: list[tuple[str, ...]] = []
    for name, hand, force in grips:
        most, last = np.array([pressed(hand(), force, k, thing.width) for k in stiffness]).T
        crushed = most > bears
        slipped = ~crushed & (last < needed)
        held = int((~crushed & ~slipped).sum())
        span = wilson(held, config.n)
        bound = "-" if thing.bears == NEVER else f"{np.median(bears):.1f}"
        shares = (f"{100 * slipped.mean():.1f}", f"{100 * crushed.mean():.1f}", f"{100 * held / config.n:.1f}")
        interval = f"[{100 * span.low:.1f}, {100 * span.high:.1f}]"
        found.append((label, name, f"{np.median(last):.1f}", f"{np.median(needed):.1f}", bound, *shares, interval))
    return found


def main(config: GripConfig) -> None:
    """Print the table."""
    heads = ("thing", "grip", "force", "slips below", "crushed above", "slipped", "crushed", "held", "95 %")
    lines = tuple(row for label, thing in THINGS.items() for row in rows(config, label, thing))
    note = f"Forces of a finger in N, medians; shares in %, n = {config.n} a row, seed {config.seed}."
    print(TextTable("", heads, lines, note).markdown())


if __name__ == "__main__":
    main(tyro.cli(GripConfig))
