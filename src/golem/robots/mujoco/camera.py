"""Renders the robot's cameras: colour and true depth of one exposure from one rendering pass."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import AbstractContextManager

import mujoco
import numpy as np
from numpy.typing import NDArray

from golem.robots.mujoco.gl import GlContext, shared_context
from golem.types import CameraInfo

CLIP = (0.01, 60.0)
"""Near and far clipping plane [m]: nearer than the fingers are to the palm camera, farther than a hall is long."""
SHOWN_GROUPS = (0, 1, 2)
"""Geom groups a camera sees: world and visuals. Group 3, the collision shapes, stays hidden."""
FANCY_SAMPLES = 4
FANCY_FLAGS = (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION)
SEGMENT_FLAGS = (mujoco.mjtRndFlag.mjRND_SEGMENT, mujoco.mjtRndFlag.mjRND_IDCOLOR)


class CameraRig(AbstractContextManager["CameraRig", None]):
    """Cameras of one compiled model, rendered on demand in the calling thread.

    Without `fancy` there are no shadows, reflections and multisampling, which on a CPU cost eight times the rest.
    Every rig of a process shares one OpenGL context; a spawned worker gets its own with its first rig.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        infos: Iterable[CameraInfo],
        *,
        fancy: bool = False,
        views: Mapping[str, mujoco.MjvCamera] | None = None,
    ) -> None:
        """Prepare to render the cameras `infos` of `model`.

        Args:
            model: has a fixed camera of every info's name that `views` lacks; its field of view is not used, the
                info's intrinsics are.
            fancy: for figures and films: shadows, reflections and smooth edges.
            views: a spectator's cameras, by the name of their info: the model need not have these.

        Raises:
            KeyError: neither the model nor `views` has a camera of that name.
            ConfigError: `MUJOCO_GL` names a backend that cannot render off-screen.
            MissingSystemLibrary: OpenGL or its driver is absent.
        """
        self._model = model
        self._infos = {info.name: info for info in infos}
        self._views: dict[str, mujoco.MjvCamera] = dict(views or {})
        for name in self._infos.keys() - self._views.keys():
            view = mujoco.MjvCamera()
            view.type = mujoco.mjtCamera.mjCAMERA_FIXED
            view.fixedcamid = model.camera(name).id
            self._views[name] = view
        self._option = mujoco.MjvOption()
        self._option.geomgroup[:] = 0
        self._option.geomgroup[list(SHOWN_GROUPS)] = 1
        self._option.sitegroup[:] = 0
        self._scene = mujoco.MjvScene(model, maxgeom=2 * model.ngeom + 100)
        for flag in FANCY_FLAGS:
            self._scene.flags[flag] = fancy
        self._gl: GlContext = shared_context()
        self._context: mujoco.MjrContext | None = self._make_context(fancy)

    def _make_context(self, fancy: bool) -> mujoco.MjrContext:
        """Upload the model with a framebuffer of the largest image; the model's own settings stay as they are."""
        vis = self._model.vis
        kept = vis.global_.offwidth, vis.global_.offheight, vis.quality.offsamples, vis.quality.shadowsize
        vis.global_.offwidth = max(info.width for info in self._infos.values())
        vis.global_.offheight = max(info.height for info in self._infos.values())
        vis.quality.offsamples = FANCY_SAMPLES if fancy else 0
        if not fancy:
            vis.quality.shadowsize = 0
        try:
            context = mujoco.MjrContext(self._model, mujoco.mjtFontScale.mjFONTSCALE_100)
        finally:
            vis.global_.offwidth, vis.global_.offheight, vis.quality.offsamples, vis.quality.shadowsize = kept
        context.readDepthMap = mujoco.mjtDepthMap.mjDEPTH_ZEROFAR
        return context

    def render(self, data: mujoco.MjData, name: str) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """Expose one camera.

        Args:
            data: state to render; its kinematics must be up to date.
            name: one of the rig's cameras.

        Returns:
            rgb: (height, width, 3) uint8.
            depth: (height, width) float32 true distance along the optical axis [m]; the far plane where nothing is.
        """
        rect = self._draw(data, name)
        rgb = np.empty((rect.height, rect.width, 3), np.uint8)
        buffer = np.empty((rect.height, rect.width), np.float32)
        mujoco.mjr_readPixels(rgb, buffer, rect, self._context)
        near, far = CLIP
        # The buffer holds 1 at the near plane and 0 at the far one, linear in 1 / z; OpenGL's first row is the bottom.
        inverse = buffer[::-1] * np.float32(1 / near - 1 / far)
        inverse += np.float32(1 / far)
        return np.ascontiguousarray(rgb[::-1]), np.divide(np.float32(1), inverse, out=inverse)

    def segment(self, data: mujoco.MjData, name: str) -> NDArray[np.int32]:
        """Return (height, width) the id of the geom seen at every pixel, -1 where there is none; same arguments."""
        for flag in SEGMENT_FLAGS:
            self._scene.flags[flag] = True
        rect = self._draw(data, name)
        for flag in SEGMENT_FLAGS:
            self._scene.flags[flag] = False
        rgb = np.empty((rect.height, rect.width, 3), np.uint8)
        mujoco.mjr_readPixels(rgb, None, rect, self._context)
        ids = rgb[::-1].astype(np.int32) @ np.array([1, 1 << 8, 1 << 16], np.int32)
        geom = np.full(self._scene.ngeom + 1, -1, np.int32)
        for g in self._scene.geoms[: self._scene.ngeom]:
            if g.segid >= 0 and g.objtype == mujoco.mjtObj.mjOBJ_GEOM:
                geom[g.segid + 1] = g.objid
        return geom[ids]

    def _draw(self, data: mujoco.MjData, name: str) -> mujoco.MjrRect:
        if self._context is None:
            raise RuntimeError("the camera rig is closed")
        info = self._infos[name]
        self._gl.make_current()
        mujoco.mjv_updateScene(
            self._model, data, self._option, None, self._views[name], mujoco.mjtCatBit.mjCAT_ALL, self._scene
        )
        self._set_intrinsics(info)
        # Another rig of this process may have bound its framebuffer in the shared context.
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        rect = mujoco.MjrRect(0, 0, info.width, info.height)
        mujoco.mjr_render(rect, self._scene, self._context)
        return rect

    def _set_intrinsics(self, info: CameraInfo) -> None:
        """Give the scene's frustum the camera's intrinsics: pixel centres are integers, so edges are at halves."""
        near, far = CLIP
        left, right = (-0.5 - info.cx) / info.fx, (info.width - 0.5 - info.cx) / info.fx
        for eye in self._scene.camera:
            eye.frustum_near, eye.frustum_far = near, far
            eye.frustum_center = near * (left + right) / 2
            eye.frustum_width = near * (right - left) / 2
            eye.frustum_top = near * (info.cy + 0.5) / info.fy
            eye.frustum_bottom = -near * (info.height - 0.5 - info.cy) / info.fy

    def close(self) -> None:
        """Release the graphics memory; the rig cannot render afterwards. Closing twice does nothing."""
        if self._context is not None:
            self._gl.make_current()
            self._context.free()
            self._context = None

    def __exit__(self, *_: object) -> None:
        self.close()
