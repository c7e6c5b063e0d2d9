"""`golem train grasps`: labels by simulated grasps, the scorer's network, its curve and held-out figures."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro
from numpy.typing import NDArray
from scipy.stats import mannwhitneyu

from golem.capabilities.grasping.hand_view import FACTS, SEEN, mirrored
from golem.capabilities.grasping.scorer import GraspNet, load_net
from golem.errors import ConfigError, MissingExtra
from golem.figures import blank_figure
from golem.robots.sensors.streams import stream
from golem.robots.worlds.tableware import KINDS
from golem.training.grasps.grasp_labels import GraspLabels, label

SIZE = (800, 380)
"""Width and height [px]."""
LINES = {
    "auc_held_out": ("held-out wares", "#4477aa", "-"),
    "auc_train": ("training wares", "#4477aa", ":"),
    "auc_proposer": ("antipodal's own score, held-out", "#ee6677", "--"),
}
"""Columns of the curve, and how they are drawn."""


def draw_curve(curve: Path, out: Path) -> None:
    """Draw the area under the ROC curve over epochs. Raises MissingExtra: matplotlib is not installed."""
    figure = blank_figure(*SIZE)
    rows = np.genfromtxt(curve, delimiter=",", names=True)
    axes = figure.subplots()
    for column, (name, colour, dashes) in LINES.items():
        axes.plot(rows["epoch"], rows[column], dashes, color=colour, label=name)
    axes.set(ylim=(0.5, 1.0), xlabel="epoch", ylabel="AUC")
    axes.set_title("Held or not: area under the ROC curve", fontsize=10, loc="left")
    axes.grid(color="#dddddd")
    axes.legend(loc="lower right", frameon=False)
    figure.savefig(out)


HIDDEN = (64, 32)
"""Sizes of the hidden layers."""
SCORE = 1
"""Which of the facts is the score that the proposals came with."""
Floats = NDArray[np.floating]
Pass = list[Floats]


@dataclass(frozen=True, slots=True)
class TrainScorerConfig:
    """How to train.

    Attributes:
        seed: of first weights, batches and dropped inputs.
        epochs: passes over the labels.
        batch: labels in one step.
        rate: of Adam; it falls to zero over the epochs.
        decay: of the weights, each step, times the rate.
        dropped: share of the inputs and of the hidden values that a step leaves out.
    """

    seed: int = 0
    epochs: int = 40
    batch: int = 32
    rate: float = 1e-3
    decay: float = 0.05
    dropped: float = 0.2


def auc(scores: NDArray[np.floating], held: NDArray[np.bool_]) -> float:
    """Return the area under the ROC curve: how probably what held scores above what did not (Mann-Whitney); or nan."""
    good, bad = int(held.sum()), int((~held).sum())
    if not good or not bad:
        return float("nan")
    return float(mannwhitneyu(scores[held], scores[~held]).statistic / (good * bad))


def first_held(scores: NDArray[np.floating], labels: GraspLabels) -> float:
    """Return the share of wares whose best grasp by `scores` (n,) was held."""
    wares = np.unique(labels.ware)
    best = [np.flatnonzero(labels.ware == w)[scores[labels.ware == w].argmax()] for w in wares]
    return float(labels.held[best].mean())


def train(labels: GraspLabels, held_out: GraspLabels, config: TrainScorerConfig, curve: Path) -> GraspNet:
    """Return the network; `curve` gets one row per epoch (CSV).

    The last epoch's network is returned: nothing is chosen by the held-out labels.
    """
    rng = stream(config.seed, "grasps/train")
    sizes = (SEEN + FACTS, *HIDDEN, 1)
    weights: Pass = [
        (rng.standard_normal(shape) * np.sqrt(2.0 / shape[0])).astype(np.float32)
        for shape in zip(sizes[:-1], sizes[1:], strict=True)
    ]
    weights[-1] *= 0.1
    values: Pass = [*weights, *(np.zeros(size, np.float32) for size in sizes[1:])]
    first, second = ([np.zeros_like(v) for v in values] for _ in range(2))
    steps, step = config.epochs * max(1, len(labels.held) // config.batch), 0
    curve.parent.mkdir(parents=True, exist_ok=True)
    with curve.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["epoch", "labels", "loss", "auc_train", "auc_held_out", "auc_proposer", "first_held"])
        for epoch in range(1, config.epochs + 1):
            order, losses = rng.permutation(len(labels.held)), list[float]()
            for start in range(0, len(order) - config.batch + 1, config.batch):
                some = order[start : start + config.batch]
                cells, facts = labels.cells[some], labels.facts[some]
                for axis in (0, 1):
                    if rng.random() < 0.5:
                        cells, facts = mirrored(cells, facts, axis)
                x = np.concatenate([cells.astype(np.float32), facts], axis=1)
                loss, slopes = _slopes(values, x, labels.held[some], config.dropped, rng)
                losses.append(loss)
                step += 1
                rate = config.rate * 0.5 * (1.0 + np.cos(np.pi * step / steps))
                for k, slope in enumerate(slopes):
                    first[k] += 0.1 * (slope - first[k])
                    second[k] += 0.001 * (slope**2 - second[k])
                    way = first[k] / (1.0 - 0.9**step) / (np.sqrt(second[k] / (1.0 - 0.999**step)) + 1e-8)
                    shrink = config.decay * values[k] if values[k].ndim == 2 else 0.0
                    values[k] -= (rate * (way + shrink)).astype(np.float32)
            net = _net(values)
            scores = net.logits(held_out.cells, held_out.facts)
            figures = (
                np.mean(losses),
                auc(net.logits(labels.cells, labels.facts), labels.held),
                auc(scores, held_out.held),
                auc(held_out.facts[:, SCORE], held_out.held),
                first_held(scores, held_out),
            )
            rows.writerow([epoch, len(labels.held), *(f"{value:.4f}" for value in figures)])
    return _net(values)


def _net(values: Pass) -> GraspNet:
    half = len(values) // 2
    copies = tuple(v.astype(np.float32) for v in values)
    return GraspNet(copies[:half], copies[half:])


def _slopes(
    values: Pass, x: Floats, held: NDArray[np.bool_], dropped: float, rng: np.random.Generator
) -> tuple[float, Pass]:
    """Return the mean cross entropy of a batch, and its slopes by the weights, then the biases."""
    half = len(values) // 2
    inputs: Pass = []
    for k in range(half):
        kept = (rng.random(x.shape) >= dropped).astype(np.float32) / np.float32(1.0 - dropped)
        inputs.append(x * kept)
        x = inputs[-1] @ values[k] + values[half + k]
        x = np.maximum(x, 0.0) if k < half - 1 else x
    chance = 1.0 / (1.0 + np.exp(-x[:, 0]))
    loss = float(-np.mean(np.log(np.where(held, chance, 1.0 - chance) + 1e-7)))
    back = ((chance - held) / len(held))[:, None].astype(np.float32)
    slopes: Pass = [np.zeros(0, np.float32)] * len(values)
    for k in range(half - 1, -1, -1):
        slopes[k], slopes[half + k] = inputs[k].T @ back, back.sum(axis=0)
        # Zero where the unit was off or dropped; what was kept counts as much more as it did forwards.
        back = (back @ values[k].T) * (inputs[k] != 0.0) / np.float32(1.0 - dropped) if k else back
    return loss, slopes


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


def main(words: list[str]) -> None:
    """Run the command `golem train grasps` with the `words` that follow it."""
    tyro.cli(train_grasps, prog="golem train grasps", args=words)
