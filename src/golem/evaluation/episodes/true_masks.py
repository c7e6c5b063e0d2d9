"""Eyes that see what is really there, for judges: what of a failure is the localizer's, and what the grasp's.

Masks and boxes are the simulator's at the moment of the exposure. Depths, and the pose that the robot believes the
camera had, stay as bad as they are.
"""

from __future__ import annotations

import weakref
from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from golem.capabilities.perception.lift import LiftConfig, lift, unproject
from golem.evaluation.blame.altered_twin import AlteredTwin
from golem.robots.mujoco.camera import CameraRig
from golem.types import Array, CameraInfo, Detection, LocalizedObject, Mask, RgbdImage

LEAST = 12
"""Pixels of a thing that is seen."""
AWAY = 0.04
"""Distance of a screw from its bore at which that is a hole [m]."""
PACK = ("screw", "nut", "bus_bar", "tray", "screw_hole")
"""What is lifted from a box, as the detector's objects are; everything else from its mask."""


class TrueMasks:
    """Every part that is seen of what the twin's world names; a `Localizer`."""

    latency = 0.02

    def __init__(self) -> None:
        self._robot = AlteredTwin.newest()
        self._model = self._robot.scene.model
        self._data = mujoco.MjData(self._model)
        self._rig: CameraRig | None = None
        self._lift = LiftConfig()

    def locate(self, frame: RgbdImage, labels: Sequence[str]) -> list[LocalizedObject]:
        state = min(self._robot.exposures, key=lambda kept: abs(kept[0] - frame.t), default=None)
        if state is None or not labels:
            return []
        _, self._data.qpos[:], self._data.mocap_pos[:], self._data.mocap_quat[:] = state
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_camlight(self._model, self._data)
        if self._rig is None:
            self._rig = CameraRig(self._model, self._robot.cameras.values())
            weakref.finalize(self, self._rig.close)
        geoms = self._rig.segment(self._data, frame.info.name)
        found: list[LocalizedObject | None] = []
        for part in self._robot.scene.names.parts:
            if part.label in labels and part.geoms:
                ids = [self._model.geom(name).id for name in part.geoms if not name.endswith("_thread")]
                found.append(self._thing(frame, part.label, np.isin(geoms, ids)))
        if "screw_hole" in labels:
            found += [self._hole(frame, geoms, mouth, radius) for mouth, radius in self._holes()]
        return [one for one in found if one is not None]

    def _thing(self, frame: RgbdImage, label: str, seen: NDArray[np.bool_]) -> LocalizedObject | None:
        rows, columns = np.nonzero(seen)
        if len(rows) < LEAST:
            return None
        x0, y0, x1, y1 = columns.min(), rows.min(), columns.max() + 1, rows.max() + 1
        box = np.array([x0, y0, x1 - 1, y1 - 1], float)
        detection = Detection(label, 1.0, box, 0.5 * (box[:2] + box[2:]))
        if label in PACK:
            return lift(frame, detection, self._lift)
        depth = frame.depth[y0:y1, x0:x1]
        mask = Mask(seen[y0:y1, x0:x1] & np.isfinite(depth) & (depth > 0.0), int(x0), int(y0))
        cloud = unproject(frame, mask)
        if len(cloud) < LEAST:
            return None
        nearest = cloud[((cloud - np.median(cloud, axis=0)) ** 2).sum(axis=1).argmin()]
        return LocalizedObject(detection, frame.t, nearest.copy(), cloud, mask)

    def _holes(self) -> list[tuple[Array, float]]:
        """Return mouth (3,) in the world and radius [m] of every bore without a screw."""
        scene, data = self._robot.scene, self._data
        holes = [(p.position, 0.5 * float(p.size[0])) for p in scene.names.parts if p.label == "screw_hole"]
        for name, mouth, draw in zip(scene.names.screws, scene.names.mouths, scene.draws, strict=True):
            if draw.kind != "nut" and np.linalg.norm(data.body(name).xpos - mouth) > AWAY:
                holes.append((mouth, draw.bore_radius))
        return holes

    def _hole(self, frame: RgbdImage, geoms: NDArray[np.int32], mouth: Array, radius: float) -> LocalizedObject | None:
        """Return a bore whose place in the image the pack itself shows."""
        at = _pixel(self._data, frame.info, mouth)
        if at is None:
            return None
        (x, y), z = at
        geom = int(geoms[round(y), round(x)])
        if geom < 0 or self._model.geom_bodyid[geom] != self._model.body("pack").id:
            return None
        half = radius * frame.info.fx / z
        box = np.array([x - half, y - half, x + half, y + half])
        return lift(frame, Detection("screw_hole", 1.0, box, np.array([x, y])), self._lift)


def _pixel(data: mujoco.MjData, info: CameraInfo, point: Array) -> tuple[tuple[float, float], float] | None:
    """Return where a point (3,) of the world is in a camera's true image [px], and its depth [m]; None outside."""
    camera = data.camera(info.name)
    # MuJoCo's cameras look along -z, with y up.
    local = camera.xmat.reshape(3, 3).T @ (point - camera.xpos) * (1.0, -1.0, -1.0)
    if local[2] < 0.02:
        return None
    x, y = info.cx + info.fx * local[0] / local[2], info.cy + info.fy * local[1] / local[2]
    if not (0.0 <= x <= info.width - 1 and 0.0 <= y <= info.height - 1):
        return None
    return (float(x), float(y)), float(local[2])
