"""The panel beside the live view: what the robot says, what its cameras show, and the operator's buttons."""

from __future__ import annotations

import queue
from collections.abc import Mapping
from enum import StrEnum
from html import escape
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from golem.dashboard.legs_panel import LegsPanel, legs_html
from golem.dashboard.skill_panel import SkillPanel
from golem.dashboard.status import Status
from golem.interfaces.payloads import GateState
from golem.skills.spec import SkillSpec

if TYPE_CHECKING:
    import viser

STAGE_COLOURS = ("#3b7ea1", "#5a9367", "#e0933f", "#c2503a", "#7d5ba6", "#2b9c92", "#8a6d3b")
SAFETY_COLOURS = {
    GateState.ACTIVE: "#2e9e63",
    GateState.ARMED: "#d99a22",
    GateState.INIT: "#7c8594",
    GateState.STOP2: "#d0432f",
    GateState.STOP1: "#d0432f",
    GateState.STOP0: "#d0432f",
}
RECENT = 9
"""Stages listed in the timeline."""


MEANING: dict[GateState, str] = {
    GateState.INIT: "safety gate: something is missing",
    GateState.ARMED: "safety gate: the motors damp, until it is activated",
    GateState.ACTIVE: "safety gate: commands pass, limited",
    GateState.STOP2: "stopped: the legs stand, the arms damp",
    GateState.STOP1: "stopped: the motors damp",
    GateState.STOP0: "stopped: the motors are limp",
}
"""What the states of the gate mean."""


class Button(StrEnum):
    """What the operator asked for."""

    PRESS = "press the e-stop"
    RELEASE = "release the e-stop"
    REVIVE = "reset and activate"
    START = "start the skill"
    CANCEL = "cancel the skill"
    PAUSE = "pause"
    RESTART = "start over"
    STAND = "stop walking"
    PUSH = "push the robot"


class Panel:
    """The panel of one server. Buttons are pressed in the server's threads; `pressed` hands them over.

    Attributes:
        skill: the skill and its goal.
        legs: the controls of a robot on its feet; None for one that hangs.
    """

    def __init__(
        self, server: viser.ViserServer, skills: Mapping[str, SkillSpec], first: str, *, standing: bool, restarts: bool
    ) -> None:
        """Build the panel of `server`.

        Args:
            server: of the view.
            skills: what there is to start.
            first: the skill that is chosen at first.
            standing: whether the robot stands on its feet.
            restarts: whether the operator may start over.
        """
        from viser import Icon

        self._asked: queue.SimpleQueue[Button] = queue.SimpleQueue()
        gui = server.gui
        gui.configure_theme(
            control_width="medium", brand_color=(207, 116, 32),
            show_logo=False, show_share_button=False,
        )  # fmt: skip
        gui.main_panel.dock_right()
        gui.set_panel_label("GOLEM")
        self._status = gui.add_html("")
        with gui.add_folder("Operator"):
            told = "The motors damp, and a robot on its feet sinks down. Start over sets it up again."
            self._stop = gui.add_button("Emergency stop", color="red", icon=Icon.HAND_STOP, hint=told)
            self._release = gui.add_button("Release emergency stop", visible=False)
            self._revive = gui.add_button("Reset and activate", visible=False)
            self._pause = gui.add_button("Pause", color="gray")
            self._restart = gui.add_button("Start over", color="gray", visible=restarts)
        self.skill = SkillPanel(gui, skills, first)
        self.legs = LegsPanel(gui) if standing else None
        buttons = [
            (self._stop, Button.PRESS),
            (self._release, Button.RELEASE),
            (self._revive, Button.REVIVE),
            (self.skill.start, Button.START),
            (self.skill.cancel, Button.CANCEL),
            (self._pause, Button.PAUSE),
            (self._restart, Button.RESTART),
        ]
        if self.legs is not None:
            buttons += [(self.legs.stop_button, Button.STAND), (self.legs.push_button, Button.PUSH)]
        for handle, button in buttons:
            handle.on_click(lambda _, button=button: self._asked.put(button))
        self._pictures: dict[str, viser.GuiImageHandle] = {}
        self._gui = gui
        self._html = ""

    def press(self, button: Button) -> None:
        """Press a button as a click does, from any thread."""
        self._asked.put(button)

    def pressed(self) -> list[Button]:
        """Return what was pressed since the last call, in order."""
        buttons = []
        while not self._asked.empty():
            buttons.append(self._asked.get_nowait())
        return buttons

    def show_picture(self, label: str, picture: NDArray[np.uint8]) -> None:
        """Show (height, width, 3) RGB, of a camera or a chart."""
        handle = self._pictures.get(label)
        if handle is None:
            self._pictures[label] = self._gui.add_image(picture, label=label, format="jpeg", jpeg_quality=80)
        else:
            handle.image = picture

    def show_status(
        self, status: Status, stages: list[tuple[str, float]], factor: float, note: str, *, pressed: bool,
        paused: bool, busy: bool,
    ) -> None:  # fmt: skip
        """Show one moment.

        Args:
            status: what the stack says.
            stages: stages with their durations [s], in order.
            factor: robot time per wall time.
            note: a line for the operator; may be empty.
            pressed: whether the e-stop is pressed.
            paused: whether time stands still.
            busy: whether a skill runs.
        """
        html = _status_html(status, stages, factor, note, paused, self.legs is not None)
        if html != self._html:
            self._html = html
            self._status.content = html
        stopped = status.safety.stopped
        for handle, visible in (
            (self._stop, not pressed),
            (self._release, pressed),
            (self._revive, stopped and not pressed),
        ):
            if handle.visible != visible:
                handle.visible = visible
        idle = not busy and status.safety is GateState.ACTIVE
        for handle, enabled in ((self.skill.start, idle), (self.skill.cancel, busy), (self._restart, not busy)):
            if handle.disabled == enabled:
                handle.disabled = not enabled
        word = "Resume" if paused else "Pause"
        if self._pause.label != word:
            self._pause.label = word


def _status_html(
    status: Status, stages: list[tuple[str, float]], factor: float, note: str, paused: bool, standing: bool
) -> str:
    colour = SAFETY_COLOURS[status.safety]
    small = "font-size:12px;opacity:.75"
    parts = [
        '<div style="padding:4px 14px 8px;font-size:14px;line-height:1.4;font-variant-numeric:tabular-nums">',
        f'<div style="{small};display:flex;justify-content:space-between"><span>robot time {status.t:.1f} s</span>'
        f"<span>{'paused' if paused else f'{factor:.2f} x real time'}</span></div>",
        f'<div style="margin:6px 0;padding:4px 10px;border-radius:6px;background:{colour};color:#fff">'
        f"<b>{escape(MEANING[status.safety])}</b>"
        f'<div style="font-size:12px">{escape(f"{status.safety} {status.reason}".rstrip())}</div></div>',
    ]
    if status.safety.stopped and not note:
        note = "Release the emergency stop, then reset and activate; a robot that fell needs Start over."
    if note:
        parts.append(f'<div style="margin:6px 0;color:#c25a10"><b>{escape(note)}</b></div>')
    if stages:
        parts.append(f'<div><b style="font-size:16px">{escape(status.stage)}</b> {escape(status.text)}</div>')
        parts.append(_timeline_html(stages[-RECENT:]))
    parts.append(legs_html(status) if standing else "")
    parts.append("</div>")
    return "".join(parts)


def _timeline_html(stages: list[tuple[str, float]]) -> str:
    """Return the stages as one bar with a part per stage as long as it took, and a legend."""
    names = list(dict.fromkeys(name for name, _ in stages))
    total = sum(seconds for _, seconds in stages) or 1.0

    def colour(name: str) -> str:
        return STAGE_COLOURS[names.index(name) % len(STAGE_COLOURS)]

    bar = "".join(
        f'<div style="width:{100 * seconds / total:.1f}%;background:{colour(name)}"></div>' for name, seconds in stages
    )
    legend = "".join(
        f'<span style="white-space:nowrap"><span style="color:{colour(name)}">&#9632;</span> '
        f"{escape(name)} {seconds:.1f}&thinsp;s</span> "
        for name, seconds in stages
    )
    return (
        '<div style="display:flex;height:8px;border-radius:4px;overflow:hidden;margin:6px 0 4px">'
        f'{bar}</div><div style="font-size:12px;display:flex;flex-wrap:wrap;gap:0 10px">{legend}</div>'
    )
