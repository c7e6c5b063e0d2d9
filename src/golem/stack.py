"""The stack file: which implementation sits in which slot, and how real the simulation shall be."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field, fields, replace
from importlib import resources
from pathlib import Path
from typing import Any

from golem import registry
from golem.capabilities.legs.vendor import Vendor
from golem.errors import ConfigError, GolemError, unknown_name
from golem.interfaces.unitree_api import LOCO_API, LocoApi, loco_api
from golem.options import check_values, read_yaml


@dataclass(frozen=True)
class Choice:
    """One slot's implementation.

    Attributes:
        use: registered name, `package.module:Class` or `my_file.py:Class`.
        options: its options by name.
    """

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
            if "use" in value:
                # A part of `handover` has its options under a key of their own.
                own = value.get("options") if value.keys() == {"use", "options"} else None
                others = {name: v for name, v in value.items() if name != "use"}
                yield Choice(value["use"], others if own is None else own)
            yield from _chosen(value)


def _is_vendor(use: str) -> bool:
    """Return whether the lower body `use` speaks to the on-board controller: `vendor`, or a class made of it."""
    with suppress(GolemError):  # what cannot be loaded is refused where it is to run, which need not be here
        return use == "vendor" or (":" in use and issubclass(registry.load("lower_body", use), Vendor))
    return False


@dataclass(frozen=True)
class Stack:
    """A whole stack: one choice per slot, the realism profile and the torque limits.

    Attributes:
        estimator: None: `random_walk_kf` where the robot's option `support` is `ground`, else `tether`.
        fallback: the lower body that takes the legs when `lower_body` fails. None: `almi` on the ground, else `hold`.
        onboard: the lower body that the twin's on-board controller runs for `vendor`. None: `almi`.
        profile: realism profile of a simulated robot: ideal, bench or field.
        limits: torque limit profile the safety gate enforces: urdf or paper.
    """

    robot: Choice = Choice("mujoco")
    estimator: Choice | None = None
    servo: Choice = Choice("pd_gravity")
    hand: Choice = Choice("magpie")
    lower_body: Choice = Choice("hold")
    upper_body: Choice = Choice("diff_ik")
    localizer: Choice = Choice("onnx")
    grasp_method: Choice = Choice("visual_servo")
    navigator: Choice = Choice("goto")
    fallback: Choice | None = None
    onboard: Choice | None = None
    profile: str = "bench"
    limits: str = "urdf"

    def __post_init__(self) -> None:
        """Check what would otherwise fall over without a word.

        Raises:
            ConfigError: the robot is on its feet, and the estimator takes it to hang in the hoist.
        """
        if self.on_ground and self.choice("estimator").use == "tether":
            raise ConfigError(
                "The estimator 'tether' takes the base to stay where it is; a robot with 'support: ground' needs "
                "random_walk_kf, invariant_ekf or one of yours."
            )

    def choice(self, slot: str) -> Choice:
        """Return what sits in `slot`."""
        if slot == "estimator" and self.estimator is None:
            return Choice("random_walk_kf" if self.on_ground else "tether")
        return getattr(self, slot)

    @property
    def legs_in_reserve(self) -> Choice:
        """The lower body that takes the legs when `lower_body` fails."""
        return self.fallback or Choice("almi" if self.on_ground else "hold")

    @property
    def legs_on_board(self) -> Choice | None:
        """The lower body of the twin's on-board controller; None where nothing speaks to that."""
        return self.onboard or Choice("almi") if self._vendor else None

    @property
    def loco_api(self) -> LocoApi:
        """The calls by which `vendor` speaks to the on-board controller, and which the twin's answers.

        Raises:
            ConfigError: there are none of that name.
        """
        robot = self._vendor.options.get("robot", LOCO_API) if self._vendor else LOCO_API
        return loco_api(robot)

    @property
    def _vendor(self) -> Choice | None:
        choices = (*self.lower_body.all, *self.legs_in_reserve.all)
        return next((choice for choice in choices if _is_vendor(choice.use)), None)

    @property
    def on_ground(self) -> bool:
        """Whether the robot stands on its feet."""
        return self.robot.options.get("support") == "ground"

    def with_choice(self, slot: str, use: str) -> Stack:
        """Return a copy with another implementation in `slot`.

        Args:
            slot: where.
            use: its name, without options, or `{use: NAME, option: value, ...}` as a stack file has it.

        Raises:
            ConfigError: there is no such slot, or `use` is neither.
        """
        if slot not in registry.slots():
            raise unknown_name("slot", slot, registry.slots())
        value = read_yaml(use, f"'{use}'") if use.startswith("{") else use
        return replace(self, **{slot: _choice(f"'{use}'", slot, slot, value)})

    def digest(self) -> str:
        """Return 12 hex digits that change whenever anything in the stack changes."""
        return hashlib.sha256(json.dumps(asdict(self), sort_keys=True).encode()).hexdigest()[:12]


def shipped() -> tuple[str, ...]:
    """Return the names of the stack files that come with the package."""
    folder = resources.files("golem") / "stacks"
    return tuple(sorted(p.name.removesuffix(".yaml") for p in folder.iterdir() if p.name.endswith(".yaml")))


def load_stack(source: str | Path, profile: str | None = None) -> Stack:
    """Read a stack file.

    Args:
        source: path of a YAML file, or the name of a shipped stack.
        profile: replaces the file's realism profile.

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
            raise ConfigError(
                f"No stack file '{source}'; give a path to a YAML file or one of: {', '.join(shipped())}."
            )
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"The stack file '{source}' cannot be read as text: {error}.") from error
    stack = parse_stack(text, str(source))
    return stack if profile is None else replace(stack, profile=profile)


def parse_stack(text: str, name: str) -> Stack:
    """Parse the YAML `text` of the stack file called `name`; errors as in `load_stack`."""
    data = read_yaml(text, name)
    if data is None:
        return Stack()
    if not isinstance(data, Mapping):
        raise ConfigError(f"{name}: a stack file is a mapping such as 'upper_body: {{use: diff_ik}}'.")
    values: dict[str, Any] = {}
    valid = [f.name for f in fields(Stack)]
    for key, value in data.items():
        if key not in valid:
            raise unknown_name(f"key in {name}", str(key), valid)
        slot = "lower_body" if key in ("fallback", "onboard") else key
        values[key] = _choice(name, key, slot, value) if slot in registry.slots() else _word(name, key, value)
    return Stack(**values)


def _word(name: str, key: str, value: object) -> str:
    if not isinstance(value, str):
        raise ConfigError(f"{name}: '{key}' is one word, e.g. '{key}: {getattr(Stack(), key)}'.")
    return value


def _choice(name: str, key: str, slot: str, value: object) -> Choice:
    if isinstance(value, str):
        return Choice(value)
    if not isinstance(value, Mapping) or not isinstance(value.get("use"), str):
        raise ConfigError(
            f"{name}: '{key}' wants '{{use: NAME, option: value, ...}}', with NAME one of "
            f"{', '.join(registry.names(slot))}, package.module:Class or file.py:Class."
        )
    options = {key: v for key, v in value.items() if key != "use"}
    check_values(f"{name}: {key}", options)
    return Choice(value["use"], options)
