"""`golem identify`: what one robot is like, from a bag of its motion in the hoist."""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from tyro.conf import Positional

from golem.capabilities.identification.fit import identify
from golem.capabilities.identification.outcome import REPORT, report_text, save, stack_lines, tracking_error
from golem.capabilities.identification.recording import COMMAND, STATE, read_motion
from golem.errors import ConfigError
from golem.interfaces import topics
from golem.interfaces.recorded import public_topics
from golem.middleware.bags.base import BagMessage
from golem.middleware.bags.writer import BagWriter
from golem.middleware.bus import News
from golem.middleware.ros.message import NANO
from golem.middleware.wire.convert import encode_low_command, encode_low_state
from golem.runtime.lockstep import build
from golem.stack import Stack, load_stack

SWEEP = "golem.capabilities.identification.sweep"
"""Module of the legs and arms that swing every joint."""
KEPT = 0.75
"""Share of the motion that is identified from; the rest is held out."""


@dataclass(frozen=True)
class IdentifyConfig:
    """Find a robot's masses, payloads, armature, friction, delay, encoder zeros and torque gains.

    The bag has /lowstate and /lowcmd of a robot in the hoist whose joints all swing. --motion writes such a bag of a
    twin. Body file, profile and report go into a folder.
    """

    bag: Positional[Path]
    """Folder of a bag, or an MCAP file; with --motion the folder to create."""
    out: Path = Path("runs/identified")
    """Folder of what is written."""
    weight: float | None = None
    """The robot's mass on a scale between hook and robot, hands and payload included [kg]: the motion does not tell
    that of the trunk."""
    motion: bool = False
    """Identify nothing: let a twin in the hoist swing its joints, and write that into the bag."""
    stack: str = "tether"
    """Of --motion: path of a stack file, or the name of a shipped one; its robot swings, in the open."""
    profile: str = "field"
    """Of --motion: realism profile, or its file."""
    seed: int = 0
    """Of --motion: seed of the episode."""
    seconds: float = 60.0
    """Of --motion: how long."""


def sweep_stack(stack: Stack) -> Stack:
    """Return `stack` with legs and arms that swing, in an open world."""
    legs, arms = stack.with_choice("lower_body", f"{SWEEP}:LegSweep"), f"{SWEEP}:ArmSweep"
    return legs.with_choice("upper_body", arms).with_options("robot", world="open")


def record_motion(stack: Stack, seed: int, bag: Path, seconds: float) -> None:
    """Record the states and commands of the robot of `stack`, episode `seed`, while it swings its joints.

    Raises:
        ConfigError, ModuleFault: see `build`; the gate has stopped the robot.
        OutputError: the bag cannot be written.
    """
    running, robot = build(stack, seed)
    bus = running.bus
    rows = [
        (News(bus, topics.LOW_STATE), encode_low_state, public_topics((STATE,))[0]),
        (News(bus, topics.LOW_CMD), lambda command: encode_low_command(command, 0), public_topics((COMMAND,))[0]),
    ]
    with closing(robot), closing(BagWriter(bag)) as writer:

        def write() -> bool:
            for news, encode, topic in rows:
                if (value := news.read()) is not None:
                    at = round(running.executor.t * NANO)
                    writer.write(BagMessage(topic, at, at, encode(value)))
            return running.safety is not None and running.safety.why != ""

        running.executor.run(seconds, write)
        print(f"{writer}.")
    if running.executor.t < seconds - 1.0:
        why = "" if running.safety is None else running.safety.why
        raise ConfigError(f"The safety gate stopped the motion after {running.executor.t:.1f} s: {why}.")


def run_identify(config: IdentifyConfig) -> None:
    """Identify the robot in a bag, and print what was found; or record one.

    Raises:
        BagError: there is no bag, or it is damaged.
        IdentificationError: the bag does not tell enough, and of which joints.
        OutputError: a file cannot be written.
        ConfigError, ModuleFault: an option of --motion is wrong; see `record_motion`.
    """
    if config.motion:
        stack = load_stack(config.stack, profile=config.profile)
        record_motion(sweep_stack(stack), config.seed, config.bag, config.seconds)
        return
    motion = read_motion(config.bag)
    kept = int(KEPT * len(motion.q))
    found = identify(motion.part(slice(kept)), config.weight)
    before, after = tracking_error(found, motion.part(slice(kept, None)))
    save(found, config.out, report_text(found, before, after))
    print(
        f"Joints of the last {100 * (1 - KEPT):.0f} % of the motion, which played no part: missed by "
        f"{before * 1e3:.1f} mrad before, by {after * 1e3:.1f} mrad now."
    )
    for name, why in found.unknown.items():
        print(f"Not told by this motion: {name} {why}.")
    print(f"{config.out / REPORT} says the rest; in a stack file:\n{stack_lines(found, config.out)}")
