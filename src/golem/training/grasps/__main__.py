"""`golem train grasps`: labels by simulated grasps, the scorer's network, its curve and held-out figures."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import tyro
from numpy.typing import NDArray

from golem.capabilities.grasping.grasp_net import load_net
from golem.errors import ConfigError, MissingExtra
from golem.robots.worlds.tableware import KINDS
from golem.training.grasps.grasp_labels import GraspLabels, label
from golem.training.grasps.train_scorer import SCORE, TrainScorerConfig, auc, draw_curve, first_held, train

LEAST = 100
"""Labels of either outcome with which training begins to make sense."""


def train_grasps(
    out: Path = Path("runs/grasps"), seed: int = 0, wares: int = 400, held_out: int = 100, epochs: int = 40
) -> None:
    """Train the scorer: try proposals on simulated wares, learn which are held; continues where it was stopped.

    Writes `scorer.npz` (for `grasp_method: {use: scorer, weights: ...}`), `curve.csv`, `curve.png` and the labels.

    Args:
        out: folder of labels, weights and curve; labels there are kept.
        seed: of wares, grasps and network.
        wares: wares of the training split, 12 grasps on each, rounded up to 20.
        held_out: wares of the held-out split.
        epochs: passes over the labels.
    """
    if min(wares, held_out, epochs) < 1 or seed < 0:
        raise ConfigError("--wares, --held-out and --epochs must be 1 or more, --seed 0 or more.")
    held = label(out / "labels", seed, "held_out", held_out)
    data = label(out / "labels", seed, "train", wares)
    if min(data.held.sum(), (~data.held).sum()) < LEAST:
        raise ConfigError(f"Training needs {LEAST} grasps that hold and as many that do not; give more --wares.")
    path = out / "scorer.npz"
    train(data, held, TrainScorerConfig(seed, epochs), out / "curve.csv").save(path)
    print(table(held, load_net(path).logits(held.cells, held.facts)))
    print(f"{len(data.held)} labels, {data.held.mean():.0%} held. Weights: {path}")
    try:
        draw_curve(out / "curve.csv", out / "curve.png")
    except MissingExtra as lack:
        print(f"No picture of the curve: {lack}")


def table(held: GraspLabels, scores: NDArray[np.floating]) -> str:
    """Return the held-out figures of the network's `scores` (n,) beside those of the proposer, as Markdown."""
    before = held.facts[:, SCORE]
    lines = [
        "| thing | grasps | held | AUC, scorer | AUC, antipodal | first held, scorer | first held, antipodal |",
        "|---|---|---|---|---|---|---|",
    ]
    for number, kind in [*enumerate(KINDS), (-1, "all")]:
        some = np.flatnonzero((held.kind == number) | (number < 0))
        if not len(some):
            continue
        part = GraspLabels(*(getattr(held, name)[some] for name in ("cells", "facts", "held", "ware", "kind")))
        lines.append(
            f"| {kind} | {len(some)} | {part.held.mean():.0%} | {auc(scores[some], part.held):.3f} "
            f"| {auc(before[some], part.held):.3f} | {first_held(scores[some], part):.0%} "
            f"| {first_held(before[some], part):.0%} |"
        )
    return "\n".join(lines)


def main(words: list[str] | None = None) -> None:
    """Train; `words` are the command line's by default."""
    tyro.cli(train_grasps, prog="golem train grasps", args=sys.argv[1:] if words is None else words)


if __name__ == "__main__":
    main()
