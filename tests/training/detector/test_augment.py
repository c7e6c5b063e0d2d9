"""Crops and targets keep labels on their pixels."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="training needs the extra 'train'")

from golem.capabilities.perception.peaks import STRIDE, find_peaks  # noqa: E402
from golem.training.detector import augment  # noqa: E402
from golem.training.detector.labels import CLASSES  # noqa: E402
from golem.training.detector.train_detector import targets  # noqa: E402


def test_the_labelled_spot_is_in_the_crop_where_the_label_says() -> None:
    v, u = np.mgrid[:480, :640]
    rows, columns = np.mgrid[:256, :320]
    found = 0
    for seed in range(30):
        rng = np.random.default_rng(seed)
        x, y = rng.uniform((60, 60), (580, 420))
        spot = (255 * np.exp(-((u - x) ** 2 + (v - y) ** 2) / 50.0)).astype(np.uint8)
        image = np.repeat(spot[..., None], 3, axis=2)
        larger = np.zeros((500, 700, 3), np.uint8)  # so that the image is padded
        label = np.array([[0.0, x, y, x - 9, y - 7, x + 5, y + 6, 0.0]])
        images = augment.Images([larger, image], "cpu")
        scale, shift = augment.place_crop(label, images.sizes[1], rng)
        out = augment.moved_labels(label, images.sizes[1], scale, shift)
        if len(out) == 0:
            continue
        found += 1
        piece = images.cut([1], scale[None], shift[None], torch.Generator().manual_seed(seed))[0, 0].numpy()
        cx, cy = out[0, 1:3]
        near = piece * (np.hypot(rows - cy, columns - cx) < 12)
        if 12 < cx < 308 and 12 < cy < 244:
            middle = np.array([(near * columns).sum(), (near * rows).sum()]) / near.sum()
            np.testing.assert_allclose(middle, [cx, cy], atol=0.35)
        assert (out[0, 3:5] <= out[0, 1:3]).all() and (out[0, 1:3] <= out[0, 5:7]).all()
    assert found > 15


def test_what_is_outside_of_an_image_is_one_colour_or_its_edge() -> None:
    images = augment.Images([np.full((100, 120, 3), 200, np.uint8), np.zeros((300, 400, 3), np.uint8)], "cpu")
    many = 40
    crops = images.cut([0] * many, np.ones((many, 2)), np.full((many, 2), 60.0), torch.Generator().manual_seed(0))
    assert torch.allclose(crops[:, :, 60:160, 60:180], torch.tensor(200 / 255))
    outside = crops[:, :, :50, :50]
    assert (outside == outside[:, :, :1, :1]).all() and 4 < len({round(float(o[0, 0, 0]), 4) for o in outside}) < 40


def test_decoding_the_targets_gives_the_labels_back() -> None:
    rng = np.random.default_rng(0)
    labels = []
    for k in range(6):
        x, y = 30 + 45 * k + rng.uniform(-2, 2), rng.uniform(40, 200)
        labels.append([k % len(CLASSES), x, y, *(np.array([x, y]) - rng.uniform(3, 15, 2)), x + 6, y + 7, 0])
    labels = np.array(labels)
    parts = targets([np.zeros((0, 8)), labels], len(CLASSES), "cpu")
    assert all(float(part[0].max()) <= 1.0 for part in parts) and float(parts[0][0].max()) == 0.0
    heat, weight, regression = (part[1].numpy() for part in parts)
    logits = np.log(np.clip(heat, 1e-4, 1 - 1e-4) / (1 - np.clip(heat, 1e-4, 1 - 1e-4)))
    found = find_peaks(np.concatenate([logits, regression[:6]]), CLASSES, set(CLASSES), 0.99, augment.CROP)
    assert len(found) == len(labels) and (weight == 1).all()
    for row in labels:
        best = min(found, key=lambda d: float(np.linalg.norm(d.center - row[1:3])))
        assert best.label == CLASSES[int(row[0])]
        np.testing.assert_allclose(best.center, row[1:3], atol=1e-4)
        np.testing.assert_allclose(best.box, row[3:7], atol=1e-3)


def test_of_two_parts_the_smaller_keeps_its_cells_and_a_neighbour_weighs_less() -> None:
    tray = [4.0, 160.0, 128.0, 20.0, 20.0, 300.0, 236.0, 0.0]
    screw = [0.0, 166.0, 128.0, 160.0, 122.0, 172.0, 134.0, 0.0]
    _, _, (regression,) = targets([np.array([screw, tray])], len(CLASSES), "cpu")
    weights = regression[6].numpy()
    at = round((128 - 1.5) / STRIDE), round((166 - 1.5) / STRIDE)
    assert weights[at] == 1.0 and (weights == 1.0).sum() == 2
    assert np.isclose(weights[at[0] - 1, at[1] + 1], 0.3)  # the screw's neighbour, not one of the tray's many
    assert np.isclose(regression[2, at[0] - 1, at[1] + 1].exp(), 6.0)
    spread = (weights > 0.0).sum()
    assert spread > 50 and weights[at[0] + 5, at[1]] < 0.05


def test_an_ignored_part_neither_counts_as_there_nor_as_absent() -> None:
    row = np.array([[2.0, 100.0, 80.0, 92.0, 72.0, 108.0, 88.0, 1.0]])
    (heat,), (weight,), (regression,) = targets([row], len(CLASSES), "cpu")
    assert heat.max() == 0 and regression.abs().max() == 0
    assert weight[2, 80 // STRIDE, 100 // STRIDE] == 0 and weight[[0, 1, 3, 4]].min() == 1


def test_corruption_keeps_shape_and_range() -> None:
    crops = torch.rand((8, 3, 256, 320), generator=torch.Generator().manual_seed(0))
    x = augment.corrupt(crops, torch.Generator().manual_seed(1))
    assert x.shape == crops.shape and x.dtype == torch.float32 and bool(torch.isfinite(x).all())
    assert x.min() >= -1.81 and x.max() <= 2.21


def test_blurs_keep_the_brightness_and_where_things_are() -> None:
    image = torch.zeros((3, 1, 31, 31))
    image[:, :, 15, 15] = 1.0
    kernels = torch.cat(
        [augment.gaussians(torch.tensor([1.0, 1.2])), augment.strokes(torch.tensor([4.0]), torch.tensor([0.0]))]
    )
    out = augment.filtered(image, kernels, torch.tensor([False, True, True]))[:, 0]
    assert torch.allclose(out.sum(dim=(1, 2)), torch.ones(3), atol=1e-5)
    assert out[0, 15, 15] == 1.0 and 0.05 < out[1, 15, 15] < 0.2
    rows, columns = (out[2].sum(dim=d) for d in (1, 0))
    assert rows[15] > 0.99 and columns[15] < 0.4 and torch.allclose(columns, columns.flip(0), atol=1e-5)
