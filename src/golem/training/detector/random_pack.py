"""Random packs: a work place with its tray, loose screws in and out of their bores, and clutter."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from golem.robots.sensors.cameras import CAMERAS, T_MUJOCO_OPTICAL
from golem.robots.worlds import hall
from golem.robots.worlds.conditions import Conditions, draw_conditions
from golem.robots.worlds.hall import surfaces
from golem.robots.worlds.layout import PackLayout
from golem.robots.worlds.pack import add_pack
from golem.robots.worlds.pack_part import add_clutter
from golem.robots.worlds.screws import ScrewDraw, ScrewRanges, draw_screws
from golem.training.detector import random_scene
from golem.training.detector.random_scene import Bore, RandomScene
from golem.types import Array, CameraInfo, Side

WIDE = ScrewRanges(protrusion=(0.004, 0.013))
"""Loosened screws of the training images: those of the worlds, and some that stand less proud."""
TINTED = (0.25, 0.35)
"""Spread of brightness and of colour of the randomised materials (log scale)."""
CLUTTER = 6
"""Most things that lie on the cover beside the distractors."""


class RandomPack(RandomScene):
    """A compiled random pack."""

    def __init__(self, rng: np.random.Generator) -> None:
        """Compile a world with random layout, screws and distractors."""
        spec, plain = random_scene.begin(rng)
        layout = PackLayout(
            near_edge=float(rng.uniform(0.2, 0.45)),
            top_z=float(rng.uniform(0.85, 1.1)),
            window_x=(float(rng.uniform(0.09, 0.2)), float(rng.uniform(0.5, 0.75))),
            window_y=(float(rng.uniform(-0.5, -0.3)), float(rng.uniform(0.3, 0.55))),
            window_depth=float(rng.uniform(0.03, 0.06)),
            empty_holes=tuple(int(i) for i in rng.choice(68, size=int(rng.integers(10, 22)), replace=False)),
            tray_size=(float(rng.uniform(0.16, 0.30)), float(rng.uniform(0.2, 0.34)), float(rng.uniform(0.03, 0.08))),
        )
        lifted = float(rng.choice([0.0, rng.uniform(0.02, 0.12)]))
        layout = replace(layout, tray_z=layout.top_z + lifted, tray_xy=(layout.near_edge + 0.1, -0.3))
        free = [i for i in range(68) if i not in layout.empty_holes]
        draws = draw_screws(rng, WIDE, [int(i) for i in rng.choice(free, size=14, replace=False)])
        names = add_pack(spec, layout, draws)
        add_clutter(spec, layout, int(rng.integers(CLUTTER + 1)), rng)
        pairs = zip(draws, names.mouths, strict=True)
        bores = tuple(Bore(mouth, draw.bore_radius, draw.name) for draw, mouth in pairs)
        tops = {draw.name: draw.head_height for draw in draws}
        super().__init__(spec, plain, rng, names.parts, bores, tops)
        self.layout, self.draws = layout, draws

    def randomise_looks(self, rng: np.random.Generator) -> Conditions:
        """Draw finishes, colours of materials, robot and distractors, and the lights; see `RandomScene`."""
        model = self.model
        wild = rng.random() < 0.6  # the others keep the colours of a work place, up to light and small tints
        conditions = draw_conditions("varied", {}, rng)
        looks = {name: (rgba[:3], *shine[:2]) for name, (rgba, *shine) in hall.MATERIALS.items()}
        for name, (colour, specular, shininess) in (looks | surfaces(conditions)).items():
            mat = model.material(name).id
            base = np.array(colour)
            if (
                wild
                and name in ("cover_coat", "cover_bead", "wall_paint", "wall_band", "stand_blue")
                and rng.random() < 0.5
            ):
                base = rng.uniform(0.05, 0.9) * np.exp(0.25 * rng.standard_normal(3))
            if wild and name == "tray_teal" and rng.random() < 0.6:
                base = rng.uniform(0.02, 1.0, 3)
            brightness, colour = TINTED if wild else (0.1, 0.1)
            tint = np.exp(brightness * rng.standard_normal()) * np.exp(0.25 * colour * rng.standard_normal(3))
            model.mat_rgba[mat, :3] = np.clip(base * tint, 0.0, 1.0)
            model.mat_specular[mat] = np.clip(specular * rng.uniform(0.3, 1.5), 0, 1)
            model.mat_shininess[mat] = np.clip(shininess * rng.uniform(0.5, 1.5), 0, 1)
        self.randomise_robot(wild, rng)
        self.randomise_lights(rng)
        return conditions

    def randomise_objects(self, rng: np.random.Generator) -> None:
        """Move the tray, scatter distractors, take some screws out of their bores (tray, cover, or just raised)."""
        model, data, layout = self.model, self.data, self.layout
        mujoco.mj_resetData(model, data)
        tray = model.body("tray").id
        side = rng.choice([-1.0, 1.0])
        tray_at = np.array([layout.near_edge + rng.uniform(-0.02, 0.5), side * rng.uniform(0.15, 0.65), layout.tray_z])
        model.body_pos[tray] = tray_at
        turn = rng.uniform(-np.pi, np.pi) if rng.random() < 0.3 else rng.normal(0.0, 0.05)
        model.body_quat[tray] = [np.cos(turn / 2), 0.0, 0.0, np.sin(turn / 2)]
        low = np.array([layout.near_edge, -0.7, layout.top_z])
        self.scatter(low, low + (0.8, 1.4, 0.012), rng)
        for draw in self.draws:
            at = model.joint(draw.name).qposadr[0]
            choice = rng.random()
            if choice < 0.15:
                data.qpos[at : at + 3] += rng.uniform(0.0, 0.02) * draw.axis()
            elif choice < 0.45:
                if choice < 0.3:
                    spot = tray_at[:2] + rng.uniform(-0.35, 0.35, 2) * min(layout.tray_size[:2])
                    z = layout.tray_z + 0.004
                else:
                    spot = np.array([layout.near_edge + rng.uniform(0.0, 0.7), rng.uniform(-0.6, 0.6)])
                    z = layout.top_z
                data.qpos[at : at + 3] = [*spot, z + draw.head_diameter / 2]
                lying = Rotation.from_euler("zy", [rng.uniform(-np.pi, np.pi), np.pi / 2 + rng.uniform(0.0, 0.3)])
                data.qpos[at + 3 : at + 7] = lying.as_quat(scalar_first=True)
        self.pose_arms(rng)

    def place_head(self, rng: np.random.Generator) -> CameraInfo:
        """Stand the robot in front of the pack with its head camera looking down at it; returns the camera."""
        at = np.array([rng.uniform(-0.2, 0.15), rng.uniform(-0.4, 0.4), rng.uniform(0.9, 1.15)])
        return self.stand(at, rng)

    def place_palm(self, rng: np.random.Generator) -> CameraInfo:
        """Carry a palm camera to where it looks down at a random part, sometimes with a screw in the fingers."""
        self.refresh()
        side = random_scene.random_side(rng)
        info = CAMERAS[f"{side}_hand"]
        part = random_scene.random_part(self.parts, rng)
        target = self.data.xpos[self.model.body(part.body).id].copy() if part.label == "tray" else part.position
        height = float(np.exp(rng.uniform(np.log(0.10), np.log(0.50))))
        turn = Rotation.from_euler("ZYX", [rng.uniform(-np.pi, np.pi), rng.normal(0, 0.12), rng.normal(0, 0.12)])
        view = turn.as_matrix() @ T_MUJOCO_OPTICAL[:3, :3]
        T_world_optical = random_scene.aim(info, target, view, height, rng)
        held = None
        if part.label == "screw" and rng.random() < 0.3:
            held = self.draws[int(rng.integers(len(self.draws)))]
            self.set_gap(side, held.head_diameter)
        self.carry(info, T_world_optical)
        if held is not None:
            self._hold(held, side, rng)
        return info

    def _hold(self, held: ScrewDraw, side: Side, rng: np.random.Generator) -> None:
        model, data = self.model, self.data
        site = model.site(f"{side}_gripper").id
        R_grip: Array = data.site_xmat[site].reshape(3, 3)
        tilt = Rotation.from_rotvec(0.15 * rng.standard_normal(3)).as_matrix()
        at = model.joint(held.name).qposadr[0]
        data.qpos[at : at + 3] = data.site_xpos[site] - R_grip[:, 2] * rng.uniform(0.0, 0.01)
        upright = R_grip @ T_MUJOCO_OPTICAL[:3, :3] @ tilt
        data.qpos[at + 3 : at + 7] = Rotation.from_matrix(upright).as_quat(scalar_first=True)
        self.refresh()
