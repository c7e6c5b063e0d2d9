"""Training of the part detector: seeded by step, resumable, one CPU thread."""

from __future__ import annotations

import copy
import csv
import json
import math
import time
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import onnx
import torch
from onnx import numpy_helper
from torch import Tensor, nn
from torch.nn import functional

from golem.capabilities.perception.peaks import STRIDE, find_peaks, normalise
from golem.errors import ConfigError
from golem.robots.sensors.streams import stream
from golem.training.detector import augment
from golem.training.detector.augment import CROP, MEAN, STD
from golem.training.detector.dataset import Labelled, load
from golem.training.detector.evaluate import THRESHOLD, Detector, evaluate
from golem.training.detector.labels import CLASSES
from golem.training.detector.part_net import MULTIPLE, PartNet
from golem.types import Array


def load_onnx(model: PartNet, path: Path, classes: Sequence[str]) -> None:
    """Give `model` the weights of an ONNX file that `export_onnx` wrote.

    The normalisation is folded into the convolutions there: here it begins with mean 0 and variance 1. Classes that the
    file does not know keep their random weights; its classes that the network lacks are left out. Raises ValueError:
    the file is no such detector.
    """
    network = onnx.load(str(path))
    known = json.loads(next(p.value for p in network.metadata_props if p.key == "classes"))
    weights = {w.name: torch.from_numpy(numpy_helper.to_array(w).copy()) for w in network.graph.initializer}
    folded = [[weights[name] for name in n.input[1:]] for n in network.graph.node if n.op_type == "Conv"]
    layers = [m for m in model.modules() if isinstance(m, nn.Conv2d)]
    norms = {id(b[0]): b[1] for b in model.modules() if isinstance(b, nn.Sequential) and isinstance(b[0], nn.Conv2d)}
    if len(folded) != len(layers):
        raise ValueError(f"{path} has {len(folded)} convolutions; a part detector has {len(layers)}.")
    for layer, (weight, _) in zip(layers, folded, strict=True):
        if layer is not model.heat and layer.weight.shape != weight.shape:
            raise ValueError(
                f"{path} has a convolution of {tuple(weight.shape)}; a part detector has {tuple(layer.weight.shape)}."
            )
    with torch.no_grad():
        for layer, (weight, bias) in zip(layers, folded, strict=True):
            if layer is model.heat:
                for row, label in enumerate(known):
                    if label in classes:
                        layer.weight[classes.index(label)] = weight[row]
                        model.heat.bias[classes.index(label)] = bias[row]
                continue
            layer.weight.copy_(weight)
            norm = norms.get(id(layer))
            (layer if norm is None else norm).bias.copy_(bias)


LARGE = 15
"""Shorter side from which a part counts as large [cells]."""
NEIGHBOURS = 2.4
"""Weight of the cells around a centre in all, where the centre's cell has 1."""


def targets(labels: Sequence[Array], classes: int, device: str) -> tuple[Tensor, Tensor, Tensor]:
    """Return the targets of n crops.

    Args:
        labels: of each crop (parts, 8), columns as in `labels.COLUMNS`.
        classes: how many heatmaps there are.
        device: where the targets should be.

    Returns:
        heat: (n, classes, h, w) 1 at a part's cell, falling around it.
        weight: (n, classes, h, w) 0 where a part neither counts as there nor as absent.
        regression: (n, 7, h, w) `part_net.REGRESSION`, and how much a cell's counts.
    """
    n, most = len(labels), max([len(some) for some in labels] + [1])
    table = np.zeros((n, most, 8), np.float32)
    there = np.zeros((n, most), bool)
    for k, some in enumerate(labels):
        # The largest first: of two centres in a cell the smaller part's is kept.
        order = np.argsort(-(some[:, 5:7] - some[:, 3:5]).prod(axis=1))
        table[k, : len(some)], there[k, : len(some)] = some[order], True
    rows = torch.from_numpy(table).to(device)
    real = torch.from_numpy(there).to(device)
    w, h = CROP[0] // STRIDE, CROP[1] // STRIDE
    column = torch.arange(w, device=device).float()
    line = torch.arange(h, device=device).float()
    kind, x, y, x0, y0, x1, y1, ignore = rows.unbind(dim=2)
    counted, ignored = real & (ignore == 0), real & (ignore != 0)

    middle = (STRIDE - 1) / 2
    gx, gy = (x - middle) / STRIDE, (y - middle) / STRIDE
    side = torch.minimum(x1 - x0, y1 - y0) / STRIDE
    # Where the middle of a large part is cannot be told to the cell: a broad peak, and offsets from all over it.
    large = side >= LARGE
    sigma = torch.where(large, (0.18 * side).clamp(2.0, 8.0), (0.13 * side).clamp(0.7, 2.0))
    reach = torch.where(large, torch.floor(0.8 * sigma), 1.0)
    j, i = (torch.round(g).clamp(0, last) for g, last in ((gx, w - 1), (gy, h - 1)))

    def along(cells: Tensor, at: Tensor) -> Tensor:
        return cells - at[:, :, None]

    blob = torch.exp(-(along(line, gy) ** 2) / (2 * sigma[:, :, None] ** 2))[:, :, :, None]
    blob = blob * torch.exp(-(along(column, gx) ** 2) / (2 * sigma[:, :, None] ** 2))[:, :, None, :]
    far = torch.maximum(along(line, i).abs()[:, :, :, None], along(column, j).abs()[:, :, None, :])
    blob = torch.where(far == 0, 1.0, blob)
    hidden = [
        (cells >= torch.floor(low / STRIDE)[:, :, None] - 1) & (cells < torch.ceil(high / STRIDE)[:, :, None] + 2)
        for cells, low, high in ((line, y0, y1), (column, x0, x1))
    ]
    covered = hidden[0][:, :, :, None] & hidden[1][:, :, None, :]

    heat = torch.zeros((n, classes, h, w), device=device)
    weight = torch.ones_like(heat)
    for c in range(classes):
        mine = (counted & (kind == c))[:, :, None, None]
        heat[:, c] = (blob * mine).amax(dim=1)
        weight[:, c] -= (covered & (ignored & (kind == c))[:, :, None, None]).float().amax(dim=1)

    share = NEIGHBOURS / ((2 * reach + 1) ** 2 - 1)
    place = torch.arange(most, device=device).float()
    # Centres before neighbours; of centres the smallest part's, of neighbours those that weigh most.
    claim = torch.where(
        far == 0, 2.0 + place[None, :, None, None], share[:, :, None, None] - 1e-5 * place[None, :, None, None]
    )
    claim = torch.where((far <= reach[:, :, None, None]) & counted[:, :, None, None], claim, -1.0)
    best, owner = claim.max(dim=1, keepdim=True)
    sides = torch.log(torch.stack([x - x0, y - y0, x1 - x, y1 - y], dim=2).clamp(min=1.0))
    values = torch.cat([torch.stack([gx, gy, share], dim=2), sides], dim=2)
    taken = torch.gather(values, 1, owner.reshape(n, h * w, 1).expand(-1, -1, 7))
    own_x, own_y, own_share, *own_sides = taken.reshape(n, h, w, 7).unbind(dim=3)
    regression = torch.stack(
        [own_x - column, own_y - line[:, None], *own_sides, torch.where(best[:, 0] >= 2.0, 1.0, own_share)], dim=1
    )
    return heat, weight, torch.where(best >= 0.0, regression, 0.0)


RUNS = Path("runs/detector")


@dataclass(frozen=True, slots=True)
class TrainDetectorConfig:
    """How to train.

    Attributes:
        data: folder with the split `train`, of which some images are set apart to choose the checkpoint by.
        out: folder for `last.pt`, `best.pt` and `curve.csv`; a `last.pt` there is resumed.
        seed: of weights and crops.
        steps: gradient steps; the learning rate falls to zero over them.
        batch: crops per step.
        rate: peak learning rate of AdamW.
        check_every: steps between evaluations on what is set apart.
        check_images: how many images that is at most; never more than a tenth.
        start: ONNX file of an earlier detector to begin with; random weights if absent.
        classes: of the labels, in their order.
        bfloat16: compute the convolutions in this type: 1.7 times faster where the processor has it.
        device: where the network is trained, as PyTorch names it.
    """

    data: Path = RUNS / "data"
    out: Path = RUNS / "run"
    seed: int = 0
    steps: int = 12000
    batch: int = 32
    rate: float = 2.5e-3
    check_every: int = 1000
    check_images: int = 240
    start: Path | None = None
    classes: tuple[str, ...] = CLASSES
    bfloat16: bool = True
    device: str = "cpu"


class Crops:
    """Random crops of a data set, and what the network should say of them, made on the device that trains."""

    def __init__(self, data: Sequence[Labelled], classes: int, device: str) -> None:
        self._labels, self._classes, self._device = [one.labels for one in data], classes, device
        self._images = augment.Images([one.image for one in data], device)

    def batch(self, rng: np.random.Generator, size: int) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Return images, heatmaps, their weights, and regression maps of `size` crops; see `heat_targets.targets`."""
        device_rng = torch.Generator(self._device).manual_seed(int(rng.integers(1 << 62)))
        chosen = rng.integers(len(self._labels), size=size).tolist()
        placed = [augment.place_crop(self._labels[k], self._images.sizes[k], rng) for k in chosen]
        scales, shifts = (np.stack(parts) for parts in zip(*placed, strict=True))
        labels = [
            augment.moved_labels(self._labels[k], self._images.sizes[k], *place)
            for k, place in zip(chosen, placed, strict=True)
        ]
        crops = augment.corrupt(self._images.cut(chosen, scales, shifts, device_rng), device_rng)
        return crops, *targets(labels, self._classes, self._device)


def loss_terms(output: Tensor, heat: Tensor, weight: Tensor, regression: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Return the focal loss of the heatmaps, the offset loss and the box loss.

    The focal loss is equation (1) of Zhou et al. (2019) with alpha 2 and beta 4, divided by the number of labelled
    parts of each class, so that one tray weighs as much as all screws.
    """
    logits, guess = output[:, : heat.shape[1]], output[:, heat.shape[1] :]
    p = torch.sigmoid(logits).clamp(1e-5, 1 - 1e-5)
    positive = (heat >= 1.0).float()
    count = (positive * weight).sum(dim=(0, 2, 3)).clamp(min=1.0)
    gain = positive * (1 - p) ** 2 * torch.log(p) + (1 - positive) * (1 - heat) ** 4 * p**2 * torch.log(1 - p)
    focal = -((gain * weight).sum(dim=(0, 2, 3)) / count).sum() / 2
    mask = regression[:, 6:7]
    total = mask.sum().clamp(min=1.0)
    offset = (functional.smooth_l1_loss(guess[:, :2], regression[:, :2], reduction="none", beta=0.1) * mask).sum()
    box = (functional.smooth_l1_loss(guess[:, 2:], regression[:, 2:6], reduction="none", beta=0.2) * mask).sum()
    return focal, offset / total, box / total


def detector_of(model: PartNet, classes: tuple[str, ...] = CLASSES) -> Detector:
    """Return the trained network as a function from image to detections."""

    def detect(image: np.ndarray) -> list:
        height, width = image.shape[:2]
        with torch.inference_mode():
            x = torch.from_numpy(normalise(image, np.array(MEAN), np.array(STD), MULTIPLE))
            maps = model(x.to(model.heat.weight.device))[0].cpu().numpy()
        return find_peaks(maps, classes, set(classes), THRESHOLD, (width, height))

    return detect


def train(config: TrainDetectorConfig, stop: int | None = None) -> Path:
    """Train or resume.

    Args:
        stop: leave off at this step (a multiple of `config.check_every`), to be resumed.

    Returns:
        The path of the best checkpoint by mean AP on what was set apart. The held-out split has no part in it.
    """
    return fit(config, load(config.data, "train"), stop)


OTHER = {"classes": "other classes", "images": "other images or labels", "seed": "another seed"}
RUN = 32
"""Images of one world, which are set apart together: pictures of one place are no test for each other."""


def set_apart(data: Sequence[Labelled], most: int) -> tuple[list[Labelled], list[Labelled]]:
    """Return the images to train on, and a tenth, at most `most`, in runs of neighbours; of one image it is that."""
    n = len(data)
    run = max(1, min(RUN, n // 10))
    runs = np.linspace(0, (n - 1) // run, max(1, min(most, n // 10) // run)).astype(int)
    chosen = {run * int(k) + i for k in runs for i in range(run) if run * int(k) + i < n}
    rest = [one for k, one in enumerate(data) if k not in chosen]
    return rest or [data[0]], [data[k] for k in sorted(chosen)]


def fit(config: TrainDetectorConfig, data: Sequence[Labelled], stop: int | None = None) -> Path:
    """Train or resume on images in memory; see `train`. Raises ConfigError: a run of something else is there."""
    torch.set_num_threads(1)
    torch.manual_seed(config.seed)
    config.out.mkdir(parents=True, exist_ok=True)
    shown = 0
    for one in data:
        shown = zlib.crc32(one.labels.tobytes(), zlib.crc32(one.image.tobytes(), shown))
    ran = {"classes": list(config.classes), "images": shown, "seed": config.seed}
    data, choice = set_apart(data, config.check_images)
    keys = [(camera, label) for camera in sorted({one.camera for one in choice}) for label in config.classes]
    model = PartNet(len(config.classes))
    if config.start is not None:
        load_onnx(model, config.start, config.classes)
    model = model.to(config.device, memory_format=torch.channels_last)
    average = copy.deepcopy(model).eval()
    optimiser = torch.optim.AdamW(model.parameters(), lr=config.rate, weight_decay=1e-3)
    step, best = 0, -1.0
    last_path, best_path, curve_path = (config.out / n for n in ("last.pt", "best.pt", "curve.csv"))
    if last_path.exists():
        state = torch.load(last_path, map_location=config.device, weights_only=True)
        for what, mine in ran.items():
            if state.get(what, mine) != mine:
                raise ConfigError(f"The run in {config.out} is of {OTHER[what]}; name another folder with --out.")
        model.load_state_dict(state["model"])
        average.load_state_dict(state["average"])
        optimiser.load_state_dict(state["optimiser"])
        step, best = state["step"], state["best"]
    else:
        with curve_path.open("w") as file:
            names = [f"ap_{camera}_{label}" for camera, label in keys]
            csv.writer(file).writerow(["step", "images", "cpu_s", "loss_heat", "loss_offset", "loss_box", *names])
    last = config.steps if stop is None else stop
    crops = Crops(data, len(config.classes), config.device)
    del data  # the images are on the device now: once is enough
    sums = torch.zeros(3, device=config.device)
    started = time.process_time()
    while step < last:
        image, heat, weight, regression = crops.batch(stream(config.seed, f"detector/batch/{step}"), config.batch)
        rate = config.rate * min(1.0, (step + 1) / 300) * 0.5 * (1 + math.cos(math.pi * step / config.steps))
        for group in optimiser.param_groups:
            group["lr"] = rate
        model.train()
        with torch.autocast(image.device.type, torch.bfloat16, enabled=config.bfloat16):
            output = model(image.to(memory_format=torch.channels_last))
        focal, offset, box = loss_terms(output, heat, weight, regression)
        optimiser.zero_grad(set_to_none=True)
        (focal + offset + 0.3 * box).backward()
        torch.nn.utils.clip_grad_norm_(model.parameters(), 5.0)
        optimiser.step()
        step += 1
        _blend(average, model, min(0.998, (1 + step) / (10 + step)))
        sums += torch.stack([focal, offset, box]).detach()
        if step % config.check_every == 0 or step == config.steps:
            scores = evaluate(choice, detector_of(average, config.classes), classes=config.classes)
            means = sums.cpu().numpy() / config.check_every
            sums.zero_()
            with curve_path.open("a") as file:
                row = [step, step * config.batch, round(time.process_time() - started, 1), *np.round(means, 4)]
                by_key = [scores[key].ap for key in keys]
                csv.writer(file).writerow([*row, *np.round(by_key, 4)])
            quality = float(np.mean(by_key))
            print(f"step {step}: loss {means.round(3)}, mean AP {quality:.3f}", flush=True)
            better, best = quality > best, max(best, quality)
            kept: dict[str, object] = {"average": average.state_dict(), "step": step, "best": best, **ran}
            if better:
                _save(best_path, kept)
            _save(last_path, {**kept, "model": model.state_dict(), "optimiser": optimiser.state_dict()})
    return best_path


def _blend(average: PartNet, model: PartNet, decay: float) -> None:
    with torch.no_grad():
        for mean, value in zip(average.state_dict().values(), model.state_dict().values(), strict=True):
            if mean.is_floating_point():
                mean.lerp_(value, 1.0 - decay)
            else:
                mean.copy_(value)


def _save(path: Path, state: dict[str, object]) -> None:
    part = path.with_suffix(".part")
    torch.save(state, part)
    part.replace(path)
