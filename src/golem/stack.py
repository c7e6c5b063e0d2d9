"""The stack file: which implementation sits in which slot, and how real the simulation shall be."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from importlib import resources
from pathlib import Path
from typing import Any, cast

from golem import registry
from golem.errors import ConfigError, GolemError, check_known, unknown_name
from golem.options import check_values, read_yaml
from golem.robots.base import Standing
from golem.slots import KEYS, PARTS

HOIST, GROUND, ONBOARD, SCAN = "hoist", "ground", "onboard", "scan"
"""What a module's class may say that it `requires`: a robot that hangs, one that stands on its feet, the robot's own
computer, or scans of a LiDAR (a navigator)."""
WORDS = ("profile", "limits")
"""Keys of a stack file whose values are one word."""
SKILLS = "skills"
"""Key of the skills in a stack file."""
_SKILLS_EXAMPLE = "{pick: {force: 8}, mine: {use: my_skill.py:Mine}}"


@dataclass(frozen=True)
class Choice:
    """One slot's implementation; `use` is a registered name, `package.module:Class` or `my_file.py:Class`."""

    use: str
    options: dict[str, Any] = field(default_factory=dict)

    @property
    def all(self) -> tuple[Choice, ...]:
        """Everything that is chosen: this, and what its options choose by `{use: NAME, ...}`."""
        return (self, *_chosen(self.options))


def _chosen(options: Mapping[str, Any]) -> Iterator[Choice]:
    """Yield every choice among `options`, at any depth."""
    for value in options.values():
        if isinstance(value, Mapping):
            if isinstance(value.get("use"), str):
                # A part of `handover` has its options under a key of their own.
                own = value.get("options") if value.keys() == {"use", "options"} else None
                others = {name: v for name, v in value.items() if name != "use"}
                yield Choice(value["use"], others if own is None else own)
            yield from _chosen(value)


@dataclass(frozen=True)
class Stack:
    """A whole stack: its modules, the options of what has no alternatives, the realism profile and the torque limits.

    Attributes:
        choices: by key of the stack file (see `golem.slots.KEYS`). What is left out gets its default at once, unless
            the default depends on whether the robot stands on its feet.
        parts: options by part (see `golem.slots.PARTS`).
        skills: by name; the shipped ones that it does not name are there, too, with their default options.
        profile: realism profile of a simulated robot: ideal, bench or field.
        limits: torque limit profile the safety gate enforces: urdf or paper.
    """

    choices: Mapping[str, Choice] = field(default_factory=dict[str, Choice])
    parts: Mapping[str, Mapping[str, Any]] = field(default_factory=dict[str, Mapping[str, Any]])
    skills: dict[str, Choice] = field(default_factory=dict[str, Choice])
    profile: str = "bench"
    limits: str = "urdf"

    def __post_init__(self) -> None:
        defaults = {key: Choice(row.default) for key, row in KEYS.items() if row.standing is None}
        object.__setattr__(self, "choices", {**defaults, **self.choices})

    def choice(self, key: str) -> Choice:
        """Return what is chosen under `key`, a key of `golem.slots.KEYS`."""
        if key in self.choices:
            return self.choices[key]
        row = KEYS[key]
        return Choice((row.standing if self.on_ground else None) or row.default)

    def part(self, name: str) -> Any:
        """Return the config of a part, a key of `golem.slots.PARTS`. Raises ConfigError: an option is wrong."""
        return registry.part(name, self.parts.get(name, {}))

    @property
    def all_skills(self) -> dict[str, Choice]:
        """Every skill of the stack by its name."""
        return {name: Choice(name) for name in registry.names(registry.SKILL)} | self.skills

    @property
    def on_ground(self) -> bool:
        """Whether the robot's class says that it stands; see `robots.base.Standing`. Raises as `registry.load` does."""
        robot = self.choice("robot")
        cls = registry.load("robot", robot.use)
        return issubclass(cls, Standing) and cls.on_feet(robot.options)

    @property
    def onboard_client(self) -> Choice | None:
        """The lower body that speaks to the robot's own computer; None where none of the stack's does."""
        for choice in (*self.choice("lower_body").all, *self.choice("fallback").all):
            with suppress(GolemError):  # what cannot be loaded is refused where it is to run, not here
                if ONBOARD in registry.requires("lower_body", choice.use):
                    return choice
        return None

    @property
    def legs_on_board(self) -> Choice | None:
        """The lower body of the twin's on-board controller; None where nothing speaks to that."""
        return self.choice("onboard") if self.onboard_client else None

    def check(self) -> None:
        """Check every module: it is one of its slot, has its options, and gets from the robot what it `requires`.

        Legs must carry a robot that stands on its feet.

        Raises:
            ConfigError: one is not, does not, or cannot be loaded.
            ModuleFault: importing one raised.
        """
        missing, is_so = (HOIST, "stands on its feet") if self.on_ground else (GROUND, "hangs in the hoist")
        for key, row in KEYS.items():
            use = self.choice(key).use
            if missing in registry.requires(row.slot, use):
                others = ", ".join(name for name in registry.names(row.slot) if name != use)
                raise ConfigError(
                    f"The {key} '{use}' is for a robot with support '{missing}', and this one {is_so}: choose one of "
                    f"{others}, or yours."
                )
            for choice in self.choice(key).all:  # what a module's options choose is of its own slot
                registry.check(row.slot, choice.use, choice.options)
        for choice in self.skills.values():
            registry.check(registry.SKILL, choice.use, choice.options)

        if self.on_ground:
            for key in ("lower_body", "fallback", *(("onboard",) if self.onboard_client else ())):
                for choice in self.choice(key).all:
                    self._check_legs(key, choice)

    def _check_legs(self, key: str, choice: Choice) -> None:
        cls = registry.load("lower_body", choice.use)
        if "carries" in vars(cls) and not cls.carries(choice.options):  # a heir has options of its own
            raise ConfigError(
                f"The {key} '{choice.use}' lets the legs hang, and this robot stands on its feet: choose almi, another "
                f"that walks, or {{use: {choice.use}, standing: true}} for legs that only stand."
            )

    def with_choice(self, key: str, use: str | Choice) -> Stack:
        """Return a copy with another implementation under `key`.

        Args:
            key: where; `skills` adds to those there are.
            use: its name, without options, or `{use: NAME, option: value, ...}` as a stack file has it; of skills
                `{NAME: {option: value, ...}, ...}`.

        Raises:
            ConfigError: there is no such key, or `use` is neither.
        """
        value = read_yaml(use, f"'{use}'") if isinstance(use, str) and use.startswith("{") else use
        if key == SKILLS:
            return replace(self, skills={**self.skills, **_skills(f"'{use}'", value)})
        check_known("slot", (*KEYS, SKILLS), key)
        choice = value if isinstance(value, Choice) else _choice(f"'{use}'", key, KEYS[key].slot, value)
        return replace(self, choices={**self.choices, key: choice})

    def with_choices(self, choices: Mapping[str, str]) -> Stack:
        """Return a copy with other implementations, by key; see `with_choice`."""
        stack = self
        for key, use in choices.items():
            stack = stack.with_choice(key, use)
        return stack

    def with_options(self, key: str, **options: object) -> Stack:
        """Return a copy in which some options of the implementation under `key` are others."""
        old = self.choice(key)
        return self.with_choice(key, Choice(old.use, {**old.options, **options}))

    def with_skill(self, name: str, **options: object) -> Stack:
        """Return a copy in which some options of the skill called `name` are others."""
        old = self.all_skills.get(name, Choice(name))
        return replace(self, skills={**self.skills, name: Choice(old.use, {**old.options, **options})})

    def with_part(self, name: str, **options: object) -> Stack:
        """Return a copy with other options of a part, a key of `slots.PARTS`. Raises ConfigError: one is wrong."""
        parts = {**self.parts, name: {**self.parts.get(name, {}), **options}}
        registry.part(name, parts[name])
        return replace(self, parts=parts)

    def digest(self) -> str:
        """Return 12 hex digits that change whenever anything in the stack changes."""
        return hashlib.sha256(json.dumps(asdict(self), sort_keys=True).encode()).hexdigest()[:12]


def shipped() -> tuple[str, ...]:
    """Return the names of the stack files that come with the package."""
    folder = resources.files("golem") / "stacks"
    return tuple(sorted(p.name.removesuffix(".yaml") for p in folder.iterdir() if p.name.endswith(".yaml")))


END = "..."
"""YAML's end of a document: the last line of a stack file that is known to be whole."""


def load_stack(source: str | Path, profile: str | None = None, whole: bool = False) -> Stack:
    """Read a stack file.

    Args:
        source: path of a YAML file, or the name of a shipped stack.
        profile: replaces the file's realism profile.
        whole: whether a file has to show that nothing of it is missing, as for a real robot.

    Raises:
        ConfigError: no such file, not YAML, or a key or value that means nothing; names what would be valid.
    """
    path = Path(source)
    try:
        if str(source) in shipped():
            text = (resources.files("golem") / "stacks" / f"{source}.yaml").read_text(encoding="utf-8")
        elif path.is_file():
            text = path.read_text(encoding="utf-8")
        else:
            meant = Path(f"{source}.yaml")
            hint = f" Did you mean '{meant}'?" if meant.is_file() else ""
            raise ConfigError(
                f"No stack file '{source}'; give a path to a YAML file or one of: {', '.join(shipped())}.{hint}"
            )
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"The stack file '{source}' cannot be read as text: {error}.") from error
    stack = parse_stack(text, str(source))
    both = "estop" in stack.parts and re.search("^limits:", text, re.MULTILINE)
    if whole and str(source) not in shipped() and not both and text.rstrip().splitlines()[-1:] != [END]:
        raise ConfigError(
            f"{source}: a real robot's stack file ends with a line '{END}', or names both 'estop' and 'limits'; "
            "this one may be half a copy."
        )
    return stack if profile is None else replace(stack, profile=profile)


def parse_stack(text: str, name: str) -> Stack:
    """Parse the YAML `text` of the stack file called `name`; errors as in `load_stack`."""
    data = read_yaml(text, name)
    if data is None:
        return Stack()
    if not isinstance(data, Mapping):
        raise ConfigError(f"{name}: a stack file is a mapping such as 'upper_body: {{use: diff_ik}}'.")
    choices: dict[str, Choice] = {}
    parts: dict[str, Mapping[str, Any]] = {}
    skills: dict[str, Choice] = {}
    words: dict[str, str] = {}
    for key, value in data.items():
        if key in KEYS:
            choices[key] = _choice(name, key, KEYS[key].slot, value)
        elif key in PARTS:
            parts[key] = _options(name, key, value)
        elif key == SKILLS:
            skills = _skills(name, value)
        elif key in WORDS:
            words[key] = _word(name, key, value)
        else:
            raise unknown_name(f"key in {name}", str(key), (*KEYS, *PARTS, SKILLS, *WORDS))
    return Stack(choices, parts, skills, **words)


def _options(name: str, key: str, value: object) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise ConfigError(f"{name}: '{key}' wants '{{option: value, ...}}'; golem options {key} lists them.")
    check_values(f"{name}: {key}", value)
    registry.part(key, value)
    return value


def _word(name: str, key: str, value: object) -> str:
    if not isinstance(value, str):
        raise ConfigError(f"{name}: '{key}' is one word, e.g. '{key}: {getattr(Stack(), key)}'.")
    return value


def _skills(name: str, value: object) -> dict[str, Choice]:
    """Return the skills that a stack file lists; one without `use` is the shipped one of its name."""
    if not isinstance(value, Mapping):
        raise ConfigError(f"{name}: 'skills' wants '{{NAME: {{option: value, ...}}, ...}}', e.g. {_SKILLS_EXAMPLE}.")
    chosen: dict[str, Choice] = {}
    for key, own in cast("Mapping[object, object]", value).items():
        if not re.fullmatch(r"[a-z][a-z0-9_]*", str(key)):
            raise ConfigError(f"{name}: a skill's name is a word of a-z, 0-9 and _ such as 'pick', not {key!r}.")
        own = {"use": key, **cast("Mapping[str, object]", own)} if isinstance(own, Mapping) else own
        choice = chosen[str(key)] = _choice(name, f"{SKILLS}: {key}", registry.SKILL, own)
        if ":" not in choice.use and choice.use not in registry.names(registry.SKILL):
            raise unknown_name(f"skill in {name}", choice.use, registry.names(registry.SKILL))
    return chosen


def _choice(name: str, key: str, slot: str, value: object) -> Choice:
    use, options = value, dict[str, Any]()
    if isinstance(value, Mapping):
        use, options = value.get("use"), {key: v for key, v in value.items() if key != "use"}
    if not isinstance(use, str):
        raise ConfigError(
            f"{name}: '{key}' wants '{{use: NAME, option: value, ...}}', with NAME one of "
            f"{', '.join(registry.names(slot))}, package.module:Class or file.py:Class."
        )
    check_values(f"{name}: {key}", options)
    use, own = registry.resolve(slot, use, options)
    return Choice(use, dict(own))


def read_choice(slot: str, use: str) -> Choice:
    """Return what `use` chooses for `slot`: a name, or `{use: NAME, option: value, ...}`.

    Raises ConfigError: it begins with `{` and is not of that form.
    """
    return _choice(f"'{use}'", slot, slot, read_yaml(use, f"'{use}'") if use.startswith("{") else use)
