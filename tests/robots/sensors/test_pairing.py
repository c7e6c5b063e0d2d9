"""Colour and depth of one exposure find each other."""

from __future__ import annotations

import numpy as np

from golem.interfaces import images
from golem.interfaces.images import Pairing
from golem.middleware.ros.msgs.sensor_msgs import Image


def color(t: float) -> Image:
    """Return a colour image."""
    return images.color_image(t, np.zeros((2, 2, 3), np.uint8), "camera")


def depth(t: float) -> Image:
    """Return a depth image."""
    return images.depth_image(t, np.zeros((2, 2), np.float32), "camera")


def test_images_of_one_exposure_are_paired_in_either_order_and_others_dropped() -> None:
    pairs: list[tuple[Image, Image]] = []
    pairing = Pairing(lambda *pair: pairs.append(pair))
    pairing.color(color(1.0))
    pairing.depth(depth(1.0))
    pairing.depth(depth(2.0))
    pairing.color(color(2.0))
    pairing.color(color(3.0))  # its depth was lost
    pairing.depth(depth(4.0))
    pairing.color(color(4.0))
    pairing.color(color(5.0))
    pairing.clear()
    pairing.depth(depth(5.0))
    assert [(c.header.stamp.sec, d.header.stamp.sec) for c, d in pairs] == [(1, 1), (2, 2), (4, 4)]
    assert [c.encoding for c, _ in pairs] == ["rgb8"] * 3
