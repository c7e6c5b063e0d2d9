"""`golem identify`: what one robot is like, from a bag of its motion in the hoist."""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from tyro.conf import Positional

from golem.capabilities.identification.fit import identify
from golem.capabilities.identification.recording import COMMAND, STATE, RecordedMotion, read_motion
from golem.capabilities.identification.regressor import NOMINAL, PAYLOAD
from golem.errors import ConfigError
from golem.evaluation.identification.outcome import BODY, PROFILE, REPORT, save, tracking_error
from golem.interfaces.recorded import public_topics
from golem.middleware.bags.writer import BagWriter
from golem.runtime.live.broadcast import Broadcast
from golem.runtime.lockstep import build
from golem.stack import Stack, load_stack

SWEEP = "golem.capabilities.identification.sweep"
"""Module of the legs and arms that swing every joint."""
KEPT = 0.75
"""Share of the motion that is identified from; the rest is held out."""


@dataclass(frozen=True)
class IdentifyConfig:
    """Find masses, payloads, armature, friction, delay, encoder zeros and torque gains of a robot.

    The bag has /lowstate and /lowcmd of a robot in the hoist whose joints all swing.
    """

    bag: Positional[Path]
    """Folder of a bag, or an MCAP file; with --motion the folder to create."""
    out: Path = Path("runs/identified")
    """Folder of what is written."""
    weight: float | None = None
    """The whole robot's mass as a scale in the hoist shows it [kg]: the motion does not tell that of the trunk."""
    motion: bool = False
    """Identify nothing: let a twin in the hoist swing its joints for 60 s, and write that into the bag."""
    stack: str = "tether"
    """Of --motion: path of a stack file, or the name of a shipped one; its robot swings, in the open."""
    profile: str = "field"
    """Of --motion: realism profile, or its file."""
    seed: int = 0
    """Of --motion: seed of the episode."""


def record_motion(stack: Stack, seed: int, bag: Path, seconds: float = 60.0) -> None:
    """Record the robot of `stack`, episode `seed`, while it swings its joints in an open world.

    Raises:
        ConfigError, ModuleFault, OutputError: see `build` and `BagWriter`; the gate has stopped the robot.
    """
    swinging = stack.with_choice("lower_body", f"{SWEEP}:LegSweep").with_choice("upper_body", f"{SWEEP}:ArmSweep")
    running, robot = build(swinging.with_options("robot", world="open"), seed)
    topics = public_topics((STATE, COMMAND))
    with closing(robot), closing(BagWriter(bag)) as writer:
        with closing(Broadcast(running, robot, writer, lambda recorder: recorder.add(topics))) as every_tick:

            def stopped() -> bool:
                every_tick()
                return running.safety is not None and running.safety.why != ""

            running.executor.run(seconds, stopped)
    if running.safety is not None and running.safety.why:
        raise ConfigError(f"The gate stopped the motion after {running.executor.t:.1f} s: {running.safety.why}.")
    print(f"{writer}.")


def halves(motion: RecordedMotion) -> tuple[RecordedMotion, RecordedMotion]:
    """Return what is identified from, the first `KEPT` of a motion, and the rest, which is held out."""
    at = int(KEPT * len(motion.q))
    return RecordedMotion(*(rows[:at] for rows in motion)), RecordedMotion(*(rows[at:] for rows in motion))


def run_identify(config: IdentifyConfig) -> None:
    """Identify the robot in a bag, and print what was found; or record one.

    Raises:
        BagError, IdentificationError: there is no bag, it is damaged, or does not tell enough, and of which joints.
        OutputError: a file cannot be written.
        ConfigError, ModuleFault: see `record_motion`.
    """
    if config.motion:
        record_motion(load_stack(config.stack, profile=config.profile), config.seed, config.bag)
        return
    kept, rest = halves(read_motion(config.bag))
    found = identify(kept, config.weight)
    before, after = (tracking_error(x, t, rest) * 1e3 for x, t in ((NOMINAL, 0.0), (found.x, found.delay)))
    said = (
        f"Joints of the last {100 * (1 - KEPT):.0f} % of the motion, which played no part: missed by {before:.1f} mrad "
        f"before, by {after:.1f} mrad now."
    )
    save(found, config.out, said)
    print(said)
    for name, why in found.unknown.items():
        print(f"Not told by this motion: {name} {why}.")
    payload = ", ".join(f"{max(float(mass), 0.0):.2f}" for mass in found.x[PAYLOAD])
    print(f"{config.out / REPORT} says the rest; in a stack file:")
    print(f"robot: {{use: mujoco, mjcf: {config.out / BODY}, payload: [{payload}]}}\nprofile: {config.out / PROFILE}")
