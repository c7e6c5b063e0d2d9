"""The shipped detector finds the parts in rendered frames and lifts them to where they are."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from golem.capabilities.perception.base import Localizer
from golem.capabilities.perception.onnx_detector import OnnxDetector, OnnxDetectorConfig
from golem.errors import ConfigError
from golem.robots.mujoco.camera import CameraRig
from golem.robots.sensors.cameras import CAMERAS, T_MUJOCO_OPTICAL
from golem.robots.worlds.layout import PackLayout
from golem.robots.worlds.pack import PackNames, add_pack
from golem.robots.worlds.screws import ScrewRanges, draw_screws
from golem.training.detector.labels import CLASSES
from golem.types import Array, CameraInfo, RgbdImage


@dataclass
class Stage:
    """A pack with two free cameras."""

    model: mujoco.MjModel
    data: mujoco.MjData
    names: PackNames
    rig: CameraRig

    def frame(self, info: CameraInfo, eye: Array, pitch: float) -> RgbdImage:
        """Return what a camera at `eye` sees that looks down by `pitch` [rad], the top of the image away from us."""
        forward, right = np.array([np.cos(pitch), 0.0, -np.sin(pitch)]), np.array([0.0, -1.0, 0.0])
        R = np.column_stack([right, np.cross(forward, right), forward])
        mount = self.model.body_mocapid[self.model.body(info.name).id]
        self.data.mocap_pos[mount] = eye
        mujoco.mju_mat2Quat(self.data.mocap_quat[mount], (R @ T_MUJOCO_OPTICAL[:3, :3]).ravel())
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)
        rgb, depth = self.rig.render(self.data, info.name)
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = R, eye
        return RgbdImage(0.0, info, rgb, depth, T)


@pytest.fixture(scope="module")
def stage() -> Stage:
    """Return the default pack with its reachable screws loosened."""
    spec = mujoco.MjSpec()
    layout = PackLayout()
    slots = [slot for slot in layout.reachable(0.35)[2:] if slot not in layout.empty_holes]
    names = add_pack(spec, layout, draw_screws(np.random.default_rng(3), ScrewRanges(), slots))
    infos = [CAMERAS["head"], CAMERAS["right_hand"]]
    for info in infos:
        spec.worldbody.add_body(name=info.name, mocap=True).add_camera(name=info.name)
    model = spec.compile()
    return Stage(model, mujoco.MjData(model), names, CameraRig(model, infos))


@pytest.fixture(scope="module")
def detector() -> OnnxDetector:
    """Return the shipped detector."""
    return OnnxDetector()


@pytest.fixture(scope="module")
def head(stage: Stage) -> RgbdImage:
    """Return a view of the working area from where the head is."""
    return stage.frame(CAMERAS["head"], np.array([0.10, -0.15, 1.75]), np.deg2rad(55.0))


@pytest.fixture(scope="module")
def palm(stage: Stage) -> RgbdImage:
    """Return a view straight down on one screw from 0.2 m."""
    eye = stage.names.mouths[1] + [-0.02, 0.01, 0.20]
    return stage.frame(CAMERAS["right_hand"], eye, np.deg2rad(90.0))


def tops(stage: Stage, label: str) -> Array:
    """Return the true positions of the parts with a label."""
    return np.array([part.position for part in stage.names.parts if part.label == label])


def in_view(frame: RgbdImage, points: Array, margin: float = 12.0) -> NDArray[np.bool_]:
    """Return which of the points are inside the image."""
    T = np.linalg.inv(frame.T_odom_optical)
    optical = points @ T[:3, :3].T + T[:3, 3]
    u = optical[:, 0] / optical[:, 2] * frame.info.fx + frame.info.cx
    v = optical[:, 1] / optical[:, 2] * frame.info.fy + frame.info.cy
    w, h = frame.info.width, frame.info.height
    return (optical[:, 2] > 0) & (u > margin) & (u < w - margin) & (v > margin) & (v < h - margin)


def nearest(truth: Array, found: Array) -> Array:
    """Return the distance from every true point to the nearest found one."""
    return np.linalg.norm(truth[:, None] - found[None], axis=2).min(axis=1)


def test_it_is_a_localizer_with_the_documented_classes(detector: OnnxDetector) -> None:
    assert isinstance(detector, Localizer)
    assert detector.classes == CLASSES and detector.latency > 0


@pytest.mark.parametrize(("label", "tolerance"), [("screw", 0.005), ("nut", 0.006), ("bus_bar", 0.012)])
def test_the_head_sees_the_parts_where_they_are(
    detector: OnnxDetector, stage: Stage, head: RgbdImage, label: str, tolerance: float
) -> None:
    truth = tops(stage, label)
    beside_tray = truth[:, 1] > -0.18
    truth = truth[
        beside_tray & in_view(head, truth) & (np.linalg.norm(truth - head.T_odom_optical[:3, 3], axis=1) < 1.1)
    ]
    found = np.array([o.position for o in detector.locate(head, [label])])
    missed = nearest(truth, found) > tolerance
    assert len(truth) >= 4 and missed.mean() <= 0.15


def test_the_head_sees_the_tray(detector: OnnxDetector, stage: Stage, head: RgbdImage) -> None:
    found = max(detector.locate(head, ["tray"]), key=lambda o: o.detection.score)
    assert np.linalg.norm(found.position - tops(stage, "tray")[0]) < 0.03


def test_the_palm_sees_screws_to_a_quarter_of_the_smallest_head(detector: OnnxDetector, stage: Stage) -> None:
    errors: list[float] = []
    for mouth, body in zip(stage.names.mouths, stage.names.screws, strict=True):
        truth = next(p.position for p in stage.names.parts if p.body == body)
        for offset in ((0.0, 0.0), (-0.02, 0.01), (0.02, -0.01)):
            frame = stage.frame(CAMERAS["right_hand"], mouth + [*offset, 0.20], np.deg2rad(90.0))
            found = detector.locate(frame, ["screw"])
            errors.append(min(float(np.linalg.norm(o.position - truth)) for o in found))
    smallest = ScrewRanges().head_diameter[0]
    assert np.median(errors) < smallest / 4 and max(errors) < smallest / 2


def test_the_same_frame_gives_the_same_objects_bit_for_bit(detector: OnnxDetector, palm: RgbdImage) -> None:
    first, again = (d.locate(palm, CLASSES) for d in (detector, OnnxDetector()))
    assert len(first) == len(again) > 0
    for a, b in zip(first, again, strict=True):
        assert a.label == b.label and a.detection.score == b.detection.score
        assert (a.position == b.position).all() and (a.detection.box == b.detection.box).all()


def test_only_what_was_asked_for_is_returned_best_first(detector: OnnxDetector, head: RgbdImage) -> None:
    found = detector.locate(head, ["nut", "tray"])
    assert {o.label for o in found} == {"nut", "tray"}
    scores = [o.detection.score for o in found]
    assert scores == sorted(scores, reverse=True)
    assert detector.locate(head, []) == []


def test_an_unknown_label_is_answered_with_the_known_ones(detector: OnnxDetector, palm: RgbdImage) -> None:
    known = "bottle, bowl, bus_bar, can, handle, mug, nut, screw, screw_hole, tray"
    with pytest.raises(ConfigError, match=f"'scrw'.*{known}.*'screw'"):
        detector.locate(palm, ["scrw"])


def test_bad_weights_and_thresholds_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="cannot be read"):
        OnnxDetector(OnnxDetectorConfig(weights=str(tmp_path / "none.onnx")))
    broken = tmp_path / "broken.onnx"
    broken.write_bytes(b"not a network")
    with pytest.raises(ConfigError, match="not an ONNX network"):
        OnnxDetector(OnnxDetectorConfig(weights=str(broken)))
    with pytest.raises(ConfigError, match="between 0 and 1"):
        OnnxDetector(OnnxDetectorConfig(threshold=1.0))


def test_a_network_of_another_kind_is_refused(tmp_path: Path) -> None:
    onnx = pytest.importorskip("onnx", reason="making another network needs the extra 'train'")
    other = tmp_path / "other.onnx"
    value = onnx.helper.make_tensor_value_info("x", onnx.TensorProto.FLOAT, [1])
    graph = onnx.helper.make_graph([onnx.helper.make_node("Identity", ["x"], ["y"])], "g", [value], [
        onnx.helper.make_tensor_value_info("y", onnx.TensorProto.FLOAT, [1])])  # fmt: skip
    onnx.save(onnx.helper.make_model(graph, opset_imports=[onnx.helper.make_opsetid("", 17)], ir_version=8), other)
    with pytest.raises(ConfigError, match="no 'classes'"):
        OnnxDetector(OnnxDetectorConfig(weights=str(other)))
