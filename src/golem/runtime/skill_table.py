"""The skills of a stack: what there are, and new instances of them."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from typing import Any

from golem import registry
from golem.errors import ModuleFault, unknown_name
from golem.runtime.contract_check import ContractCheck
from golem.skills.base import Routine, Skill
from golem.skills.context import Context
from golem.skills.spec import Schema, SkillSpec, read_goal, schema_of, summary, with_ranges
from golem.stack import Choice, Stack


class SkillTable:
    """The skills of one stack by name; `specs` is what others may know of them."""

    def __init__(self, stack: Stack) -> None:
        """Load every skill of `stack`, and make each once: a wrong option is better said now than when it is called.

        Raises ConfigError: a name or an option is wrong; ModuleFault: a constructor raised, or a skill lacks a part of
        its contract.
        """
        self._choices = stack.all_skills
        self.specs = {name: _spec(name, choice) for name, choice in self._choices.items()}
        for name in self._choices:
            self.make(name)

    def spec(self, name: str) -> SkillSpec:
        """Return what others may know of the skill called `name`. Raises ConfigError: there is none of that name."""
        if name not in self.specs:
            raise unknown_name("skill", name, self.specs)
        return self.specs[name]

    def make(self, name: str) -> Skill[Context, Any]:
        """Return a new instance of the skill `name`. Raises ConfigError: there is none; ModuleFault: it raised."""
        use = self.spec(name).use
        skill = registry.create(registry.SKILL, use, self._choices[name].options)
        for contract in (Routine, Skill):
            ContractCheck(registry.SKILL, use).satisfies(skill, contract)
        return skill

    def goal(self, name: str, fields: Mapping[str, object]) -> Any:
        """Return the goal of the skill called `name` that `fields` say.

        Raises:
            ConfigError: there is no such skill, or they say none; see `read_goal`.
            ModuleFault: its class raised.
        """
        return read_goal(name, registry.load(registry.SKILL, self.spec(name).use).Goal, fields)


def _spec(name: str, choice: Choice) -> SkillSpec:
    cls = registry.load(registry.SKILL, choice.use)
    try:
        kind: Any = getattr(cls, "Goal", None)
        goal, result = with_ranges(kind, schema_of(kind)), Schema()
        with suppress(Exception):  # what a skill finds out is described where it can be
            result = schema_of(getattr(cls, "Result", None))
        return SkillSpec(name, choice.use, summary(cls), goal, result)
    except Exception as error:  # a user's dataclass may refer to what does not exist
        raise ModuleFault(registry.SKILL, choice.use, f"its 'Goal' is unsuitable: {error}") from error
