"""Crops and targets keep labels on their pixels."""

from __future__ import annotations

import numpy as np

from golem.capabilities.perception.classes import CLASSES
from golem.capabilities.perception.peaks import STRIDE, find_peaks
from golem.training.detector import augment


def test_the_labelled_spot_is_in_the_crop_where_the_label_says() -> None:
    v, u = np.mgrid[:480, :640]
    found = 0
    for seed in range(30):
        rng = np.random.default_rng(seed)
        x, y = rng.uniform((60, 60), (580, 420))
        image = np.repeat((255 * np.exp(-((u - x) ** 2 + (v - y) ** 2) / 50.0))[..., None], 3, axis=2).astype(
            np.uint8
        )
        label = np.array([[0.0, x, y, x - 9, y - 7, x + 5, y + 6, 0.0]])
        piece, out = augment.crop(image, label, rng)
        if len(out) == 0:
            continue
        found += 1
        cx, cy = out[0, 1:3]
        near = piece[..., 0].astype(float) * (
            np.hypot(*np.mgrid[:256, :320] - np.array([cy, cx])[:, None, None]) < 12
        )
        rows, columns = np.mgrid[:256, :320]
        spot = np.array([(near * columns).sum(), (near * rows).sum()]) / near.sum()
        if 12 < cx < 308 and 12 < cy < 244:
            np.testing.assert_allclose(spot, [cx, cy], atol=0.35)
        assert (out[0, 3:5] <= out[0, 1:3]).all() and (out[0, 1:3] <= out[0, 5:7]).all()
    assert found > 15


def test_decoding_the_targets_gives_the_labels_back() -> None:
    rng = np.random.default_rng(0)
    labels = []
    for k in range(6):
        x, y = 30 + 45 * k + rng.uniform(-2, 2), rng.uniform(40, 200)
        labels.append([k % len(CLASSES), x, y, *(np.array([x, y]) - rng.uniform(3, 15, 2)), x + 6, y + 7, 0])
    labels = np.array(labels)
    heat, weight, regression = augment.targets(labels, len(CLASSES))
    logits = np.log(np.clip(heat, 1e-4, 1 - 1e-4) / (1 - np.clip(heat, 1e-4, 1 - 1e-4)))
    found = find_peaks(np.concatenate([logits, regression[:6]]), CLASSES, set(CLASSES), 0.99, augment.CROP)
    assert len(found) == len(labels) and (weight == 1).all()
    for row in labels:
        best = min(found, key=lambda d: float(np.linalg.norm(d.center - row[1:3])))
        assert best.label == CLASSES[int(row[0])]
        np.testing.assert_allclose(best.center, row[1:3], atol=1e-4)
        np.testing.assert_allclose(best.box, row[3:7], atol=1e-3)


def test_an_ignored_part_neither_counts_as_there_nor_as_absent() -> None:
    heat, weight, regression = augment.targets(
        np.array([[2.0, 100.0, 80.0, 92.0, 72.0, 108.0, 88.0, 1.0]]), len(CLASSES)
    )
    assert heat.max() == 0 and regression.max() == 0
    assert weight[2, 80 // STRIDE, 100 // STRIDE] == 0 and weight[[0, 1, 3, 4]].min() == 1


def test_corruption_keeps_shape_and_range() -> None:
    image = np.random.default_rng(0).integers(0, 256, (256, 320, 3), dtype=np.uint8)
    for seed in range(8):
        x = augment.corrupt(image, np.random.default_rng(seed))
        assert x.shape == (3, 256, 320) and x.dtype == np.float32
        assert x.min() >= -1.81 and x.max() <= 2.21
