"""Labels lie on what they name: the projection agrees with the segmentation image."""

from __future__ import annotations

import numpy as np

from golem.capabilities.perception.classes import CLASSES
from golem.training.detector import dataset, random_scene
from golem.training.detector.labels import COLUMNS, label_image


def test_labelled_centres_lie_on_the_geoms_of_their_part() -> None:
    rng = np.random.default_rng(5)
    world = random_scene.build_world(rng)
    owner = np.full(world.model.ngeom, -1)
    for part in world.names.parts:
        for name in part.geoms:
            owner[world.model.geom(name).id] = CLASSES.index(part.label)
    plain, fancy = random_scene.make_rigs(world)
    total, right, seen = 0, 0, set()
    with plain, fancy:
        for k in range(10):
            random_scene.randomise_looks(world, rng)
            random_scene.randomise_objects(world, rng)
            info = (random_scene.place_head if k % 2 else random_scene.place_palm)(world, rng)
            segmentation = plain.segment(world.data, info.name)
            for kind, x, y, x0, y0, x1, y1, ignore in label_image(world, info, segmentation):
                assert x0 - 1 <= x <= x1 + 1 and y0 - 1 <= y <= y1 + 1
                if ignore or CLASSES[int(kind)] == "screw_hole":
                    continue
                seen.add(CLASSES[int(kind)])
                total += 1
                right += owner[segmentation[round(y), round(x)]] == kind
    assert seen == {"screw", "nut", "bus_bar", "tray"} and total > 60
    assert right / total > 0.93  # the rest is hidden behind a finger or a cable


def test_a_pulled_screw_leaves_a_hole_label() -> None:
    rng = np.random.default_rng(2)
    world = random_scene.build_world(rng)
    plain, fancy = random_scene.make_rigs(world)
    with plain, fancy:
        random_scene.randomise_objects(world, rng)
        for body in world.distractors:
            world.model.body_pos[body] = random_scene.AWAY
        info = random_scene.place_head(world, rng)
        counts = []
        for out in (False, True):
            for draw, mouth in zip(world.draws, world.names.mouths, strict=True):
                at = world.model.joint(random_scene.screw_name(draw.slot)).qposadr[0]
                world.data.qpos[at : at + 3] = mouth + draw.protrusion * draw.axis()
                world.data.qpos[at + 3 : at + 7] = draw.quat()
                world.data.qpos[at + 2] -= 3.0 * out
            random_scene.refresh(world)
            labels = label_image(world, info, plain.segment(world.data, info.name))
            counts.append(
                [int((labels[:, 0] == CLASSES.index(name)).sum()) for name in ("screw", "screw_hole")]
            )
    (screws, holes), (screws_out, holes_out) = counts
    assert screws_out < screws and holes_out > holes


def test_a_world_depends_on_its_seed_alone() -> None:
    pairs = [list(dataset.render(3, 0, "train", 1)) for _ in range(2)]
    assert len(pairs[0]) == 2
    for (image, labels, camera, place), (image_2, labels_2, camera_2, place_2) in zip(*pairs, strict=True):
        assert (
            (camera, place) == (camera_2, place_2) and (image == image_2).all() and (labels == labels_2).all()
        )
        assert labels.shape[1] == len(COLUMNS)
    held_out = next(iter(dataset.render(3, 0, "held_out", 1)))
    assert (held_out[0] != pairs[0][0][0]).any()
