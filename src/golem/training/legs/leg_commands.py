"""`golem train legs run|export|average|curve|shove`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console
from rich.table import Table
from tyro.conf import arg

from golem.training.legs.checkpoint import CHECKPOINT
from golem.training.legs.learning_curve import draw_curves
from golem.training.legs.train_legs import TrainLegsConfig
from golem.training.legs.train_legs import train as run_training

RUNS = Path("runs/legs")


def run(config: Annotated[TrainLegsConfig, arg(name="")]) -> None:
    """Train a leg policy, or go on where a run was stopped."""
    print(run_training(config))


def export(checkpoint: Path = RUNS / "seed0" / CHECKPOINT, folder: Path = RUNS / "export") -> None:
    """Write a checkpoint as a network and its description, for `lower_body: {use: policy, file: ...}`.

    Args:
        checkpoint: of `run`.
        folder: where to write almi_TASK.onnx and .yaml.
    """
    from golem.training.legs.export_policy import export as write

    print(*write(checkpoint, folder), sep="\n")


def average(
    networks: tyro.conf.Positional[tuple[Path, ...]],
    weights: tuple[float, ...],
    out: Path = RUNS / "export" / "average.onnx",
) -> None:
    """Write the weighted mean of networks that were trained on from one; often it is better than each of them.

    Args:
        networks: files of `export`, of the same task; its description fits the mean as well.
        weights: one per network, 0 or more; only their ratios count.
        out: the network to write.
    """
    from golem.training.legs.export_policy import average as write

    write(networks, weights, out)
    print(out)


def curve(runs: tyro.conf.Positional[tuple[Path, ...]], out: Path = RUNS / "curve.png") -> None:
    """Draw the learning curves of several runs beside each other, and tabulate every fifth update.

    Args:
        runs: folders of `run`.
        out: the picture; the table is the CSV file beside it.
    """
    draw_curves(runs, out)


def shove(
    network: Path = RUNS / "seed0" / CHECKPOINT,
    impulse: float = 80.0,
    n: Annotated[int, arg(aliases=("-n",))] = 20,
    seed: int = 0,
    threads: int = 2,
    speed: float = 0.0,
) -> None:
    """Shove robots in the training's own world, eight directions: which of two networks stands more, in seconds.

    Args:
        network: checkpoint of `run`, or a network of `export`, such as those in `golem/capabilities/legs/policies`.
        impulse: of each shove of 0.2 s on the torso [N s].
        n: robots per direction.
        seed: of the robots.
        threads: of the physics.
        speed: at which the robots walk ahead [m/s]; 0 stands.
    """
    from golem.training.legs.shove_networks import shove_all

    rows = shove_all(network, impulse, n, seed, threads, speed)
    table = Table(
        "direction", "survived", "stopped by the gate", "fell", title=f"{impulse:g} N s at {speed:g} m/s, n = {n} each"
    )
    for row in rows:
        table.add_row(row.direction.replace("_", " "), str(row.survived), str(row.stopped), str(row.fell))
    table.add_row("all", *(str(sum(getattr(row, what) for row in rows)) for what in ("survived", "stopped", "fell")))
    Console().print(table)


def main(words: list[str]) -> None:
    """Run one of the commands."""
    commands = {"run": run, "export": export, "average": average, "curve": curve, "shove": shove}
    says = "Train the leg policy."
    tyro.extras.subcommand_cli_from_dict(commands, prog="golem train legs", args=words, description=says)
