"""The part of the panel that moves the arms: a slider for every joint, and a gizmo at each hand.

Nothing moves while they are dragged: the way there is planned around the robot itself, and gone when the button is
pressed. To lead the hands as one drags, there is `golem teleop`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from golem.capabilities.planning.joint_space import PlanningRobot
from golem.dashboard.server import WORLD, gizmo_pose, place_gizmo
from golem.robots.model.table import JOINT_NAMES
from golem.skills.base import SkillResult
from golem.skills.context import Context
from golem.skills.planned_motion import PlannedMotion
from golem.types import SIDES, UPPER, Array, Side

if TYPE_CHECKING:
    import viser

HAND_SPEED = 0.25
"""How fast the hands may move [m/s]."""
STEP = 0.01
"""Step of a slider, and change of a joint that it follows [rad]."""


class MoveArms:
    """A routine that brings the arms to joints, or hands to poses; see `golem.skills.base.Routine`."""

    def __init__(self, q: Array | None, palms: Mapping[Side, Array]) -> None:
        """Go to `q` (15,) [rad], or to the `palms` (4, 4) in odom where that is None."""
        self._q, self._palms = q, palms

    async def run(self, context: Context, goal: object) -> SkillResult:
        """Plan and go."""
        context.say("move", "The arms go where the panel says.")
        motion = PlannedMotion(context)
        if self._q is not None:
            await motion.to_joints(self._q, SIDES, HAND_SPEED)
        else:
            await motion.to(self._palms, HAND_SPEED)
        return SkillResult(True, "done", None, "The arms are where the panel says.")


class ArmPanel:
    """Sliders and gizmos of one server; `move` is listened to. Those that nobody has touched follow the robot."""

    def __init__(self, server: viser.ViserServer, from_odom: Callable[[Array], Array]) -> None:
        """Add them; `from_odom` brings a point (3,) of odom into the world that is shown, whose axes are the same."""
        from viser import Icon

        gui, robot = server.gui, PlanningRobot()
        self._origin = from_odom(np.zeros(3))
        self._touched: dict[Side, Array] = {}
        self._turned = False
        with gui.add_folder("Arms", expand_by_default=False):
            self._shown = gui.add_checkbox("gizmos at the hands", False)
            with gui.add_folder("joints [rad]", expand_by_default=False):
                self._sliders = [
                    gui.add_slider(name.removesuffix("_joint"), float(low), float(high), STEP, float(low))
                    for name, low, high in zip(np.array(JOINT_NAMES)[UPPER], robot.lower, robot.upper, strict=True)
                ]
            self.move = gui.add_button("Move there", icon=Icon.ARROW_MOVE_RIGHT)
            self._back = gui.add_button("Forget it", color="gray")
        self._gizmos: dict[Side, Any] = {}
        for side in SIDES:
            gizmo = server.scene.add_transform_controls(f"{WORLD}/{side}_pose", scale=0.15, visible=False)
            gizmo.on_update(lambda event, side=side: self._dragged(event, side))
            self._gizmos[side] = gizmo
        for slider in self._sliders:
            slider.on_update(self._turn)
        self._back.on_click(lambda _: self.forget())

    @property
    def chosen(self) -> MoveArms | None:
        """What was asked for: the sliders, or the gizmos where those were touched last; None where nothing was."""
        if self._touched:
            return MoveArms(None, dict(self._touched))
        return MoveArms(np.array([slider.value for slider in self._sliders]), {}) if self._turned else None

    def forget(self) -> None:
        """Let sliders and gizmos follow the robot again."""
        self._touched.clear()
        self._turned = False

    def show(self, q: Array, palms: Mapping[Side, Array]) -> None:
        """Show the joints `q` (15,) [rad] and the `palms` (4, 4) in odom at what nobody has touched."""
        if not self._turned:
            for slider, value in zip(self._sliders, q, strict=True):
                kept = float(np.clip(value, slider.min, slider.max))
                if abs(slider.value - kept) > STEP:
                    slider.value = kept
        for side, gizmo in self._gizmos.items():
            if gizmo.visible != self._shown.value:
                gizmo.visible = self._shown.value
            if side not in self._touched:
                place_gizmo(gizmo, palms[side], self._origin)

    def _turn(self, event: Any) -> None:
        if event.client is not None:  # not by `show`
            self._turned = True
            self._touched.clear()

    def _dragged(self, event: Any, side: Side) -> None:
        """Take a movement of the mouse, in a thread of the server."""
        self._touched[side], self._turned = gizmo_pose(self._gizmos[side], self._origin), False
