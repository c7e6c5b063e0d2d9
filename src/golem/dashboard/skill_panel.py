"""The part of the panel for skills: which one, a form for its goal, and buttons to start and to cancel it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from golem.skills.spec import Schema, SkillSpec

if TYPE_CHECKING:
    import viser

    Input = viser.GuiInputHandle[Any]


class SkillPanel:
    """Form and buttons of one server.

    Attributes:
        start, cancel: to be listened to.
    """

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

    def fill(self, name: str, **values: Any) -> None:
        """Choose the skill called `name`, and fill in some fields, as clicks and keys do."""
        self._name.value = name
        if self._shown[0] != name:
            self._show()
        for key, value in values.items():
            self._shown[1][key].value = value

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
