"""The panel beside the live view: what the robot says, what its cameras show, and the operator's buttons."""

from __future__ import annotations

import json
import queue
from collections.abc import Callable, Mapping
from enum import StrEnum
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from golem.dashboard.arm_panel import ArmPanel
from golem.dashboard.legs_panel import LegsPanel, legs_html
from golem.dashboard.status import GATE_STATES, Status
from golem.dashboard.view_panel import ViewPanel
from golem.interfaces.payloads import GateState
from golem.skills.spec import Schema, SkillSpec
from golem.types import Array

if TYPE_CHECKING:
    import viser

    Input = viser.GuiInputHandle[Any]


class SkillPanel:
    """Form and buttons of one server; `start` and `cancel` are listened to."""

    def __init__(self, gui: viser.GuiApi, skills: Mapping[str, SkillSpec], first: str) -> None:
        """Add the controls to `gui`, with the skill called `first` chosen if there is one."""
        from viser import Icon

        self._gui, self._skills = gui, skills
        names = sorted(skills)
        self._folder = gui.add_folder("Skill")
        with self._folder:
            self._name = gui.add_dropdown("skill", names, initial_value=first if first in skills else names[0])
            self._form = gui.add_folder("goal")
            self.start = gui.add_button("Start", icon=Icon.PLAYER_PLAY)
            self.cancel = gui.add_button("Cancel", color="gray", icon=Icon.PLAYER_STOP, disabled=True)
        self._shown: tuple[str, dict[str, Input]] = "", {}
        self._name.on_update(lambda _: self._show())
        self._show()

    @property
    def chosen(self) -> tuple[str, dict[str, Any]]:
        """The skill that is chosen, and the fields of the goal that the form says."""
        name, fields = self._shown  # at once: a thread of the server may be about to show another
        schema = self._skills[name].goal["properties"]
        return name, {key: _read(schema[key], field.value) for key, field in fields.items()}

    def hide(self) -> None:
        """Take the controls away, where somebody else starts the skills."""
        self._folder.visible = False

    def _show(self) -> None:
        """Build the form of the skill that is chosen."""
        name, before = self._name.value, self._shown[1]
        schema = self._skills[name].goal
        with self._form:
            fields = {key: self._add(key, of) for key, of in schema["properties"].items()}
        self._shown = name, fields
        for field in before.values():
            field.remove()

    def _add(self, name: str, of: Schema) -> Input:
        """Add the input of one field; what is neither a number nor a word is written as JSON."""
        hint, value = of.get("description"), of.get("default")
        if "enum" in of:
            names = [str(each) for each in of["enum"]]
            first = str(value) if "default" in of else names[0]
            return self._gui.add_dropdown(name, names, initial_value=first, hint=hint)
        match of.get("type"):
            case "boolean":
                return self._gui.add_checkbox(name, bool(value), hint=hint)
            case "integer" | "number":
                step = 1 if of["type"] == "integer" else 0.01
                return self._gui.add_number(name, value or 0 * step, step=step, hint=hint)  # 0, or 0.0
            case "string":
                return self._gui.add_text(name, value or "", hint=hint)
            case _:
                return self._gui.add_text(name, json.dumps(value), hint=hint)


def _read(of: Schema, value: Any) -> Any:
    """Return what an input says, as JSON has it."""
    if "enum" in of:
        return next(each for each in of["enum"] if str(each) == value)
    if of.get("type") in ("boolean", "integer", "number", "string"):
        return value
    try:
        return json.loads(value)
    except ValueError:
        return value  # and the goal says what it should be


STAGE_COLOURS = ("#3b7ea1", "#5a9367", "#e0933f", "#c2503a", "#7d5ba6", "#2b9c92", "#8a6d3b")
SMALL = "font-size:12px;opacity:.75"
RECENT = 9
"""Stages listed in the timeline."""


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
    ALLOW = "allow what is asked"
    DENY = "deny what is asked"
    MOVE = "move the arms"
    RECORD = "begin or end a film"


class Panel:
    """The panel of one server. Buttons are pressed in the server's threads; `pressed` hands them over.

    Attributes:
        legs: the controls of a robot on its feet; None for one that hangs.
        arms, view: the controls of the arms, and of what is shown.
    """

    def __init__(
        self, server: viser.ViserServer, from_odom: Callable[[Array], Array], skills: Mapping[str, SkillSpec],
        first: str, *, standing: bool, restarts: bool,
    ) -> None:  # fmt: skip
        """Build the panel of `server`.

        Args:
            from_odom: see `ArmPanel`.
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
            if standing:
                gui.add_html(f'<div style="{SMALL};padding:0 14px 4px">{told.partition(". ")[0]}.</div>')
            self._release = gui.add_button("Release emergency stop", visible=False)
            self._revive = gui.add_button("Reset and activate", visible=False)
            self._pause = gui.add_button("Pause", color="gray")
            self._restart = gui.add_button("Start over", color="gray", visible=restarts)
            self._question = gui.add_html("", visible=False)
            self._answers = gui.add_button("Allow", color="green", visible=False), gui.add_button("Deny", visible=False)
        self.skill = SkillPanel(gui, skills, first)
        self.legs = LegsPanel(gui) if standing else None
        self.arms = ArmPanel(server, from_odom)
        self.view = ViewPanel(server, standing=standing)
        buttons = [
            (self.arms.move, Button.MOVE),
            (self.view.record, Button.RECORD),
            (self._stop, Button.PRESS),
            (self._release, Button.RELEASE),
            (self._revive, Button.REVIVE),
            (self.skill.start, Button.START),
            (self.skill.cancel, Button.CANCEL),
            (self._pause, Button.PAUSE),
            (self._restart, Button.RESTART),
            *zip(self._answers, (Button.ALLOW, Button.DENY), strict=True),
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

    def ask(self, text: str | None) -> None:
        """Show a question, to be allowed or denied, from any thread; None takes it away."""
        self._question.content = "" if text is None else f'<div style="padding:4px 14px"><b>{escape(text)}</b></div>'
        for handle in (self._question, *self._answers):
            handle.visible = text is not None

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
            stages: stages with their durations [s], in order.
            factor: robot time per wall time.
            note: a line for the operator; may be empty.
            pressed: whether the e-stop is pressed.
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
        for handle, enabled in (
            (self.skill.start, idle),
            (self.arms.move, idle),
            (self.skill.cancel, busy),
            (self._restart, not busy),
        ):
            if handle.disabled == enabled:
                handle.disabled = not enabled
        word = "Resume" if paused else "Pause"
        if self._pause.label != word:
            self._pause.label = word


def _status_html(
    status: Status, stages: list[tuple[str, float]], factor: float, note: str, paused: bool, standing: bool
) -> str:
    meaning, colour = (GATE_STATES[status.safety][key] for key in ("meaning", "panel"))
    parts = [
        '<div style="padding:4px 14px 8px;font-size:14px;line-height:1.4;font-variant-numeric:tabular-nums">',
        f'<div style="{SMALL};display:flex;justify-content:space-between"><span>robot time {status.t:.1f} s</span>'
        f"<span>{'paused' if paused else f'{factor:.2f} x real time'}</span></div>",
        f'<div style="margin:6px 0;padding:4px 10px;border-radius:6px;background:{colour};color:#fff">'
        f"<b>{escape(meaning)}</b>"
        f'<div style="font-size:12px">{escape(f"{status.safety} {status.reason}".rstrip())}</div></div>',
    ]
    advice = "Release the emergency stop, then reset and activate; a robot that fell needs Start over."
    for line in filter(None, (note, advice if status.safety.stopped else "")):
        parts.append(f'<div style="margin:6px 0;color:#c25a10"><b>{escape(line)}</b></div>')
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

    bar = "".join(f'<div style="width:{100 * s / total:.1f}%;background:{colour(name)}"></div>' for name, s in stages)
    legend = "".join(
        f'<span style="white-space:nowrap"><span style="color:{colour(name)}">&#9632;</span> '
        f"{escape(name)} {seconds:.1f}&thinsp;s</span> "
        for name, seconds in stages
    )
    return (
        '<div style="display:flex;height:8px;border-radius:4px;overflow:hidden;margin:6px 0 4px">'
        f'{bar}</div><div style="font-size:12px;display:flex;flex-wrap:wrap;gap:0 10px">{legend}</div>'
    )
