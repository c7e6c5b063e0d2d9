"""`golem options` shows every option of every module, and nothing that a stack file cannot set."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import pytest

from golem import registry
from golem.errors import ConfigError, GolemError
from golem.option_list import REQUIRED, Option, OptionsConfig, options_of, options_text
from golem.options import read_yaml
from golem.slots import PARTS, SLOTS

MINE = '''
class Mine:
    """Legs of mine.

    Longer.
    """

    def __init__(self, gain: float, names: tuple[str, ...] = ("a", "b"), onboard: object = None) -> None:
        """Build it.

        Args:
            gain: how strong; a text that goes
                on here [1/s].
            names (tuple): whose.
        """
'''


def shipped() -> list[tuple[str, str]]:
    return [(slot, use) for slot, row in SLOTS.items() for use in row.shipped if use != "pink_ik"]


def options(slot: str, use: str) -> list[Option]:
    cls = registry.load(slot, use)
    return list(options_of(registry.config_class(cls) or cls, SLOTS[slot].supplied))


def without_text(where: str, found: Iterable[Option]) -> list[str]:
    return [f"{where} {option.name}" for option in found if not option.text]


def test_every_option_of_a_shipped_module_says_what_it_is() -> None:
    assert len(shipped()) > 60
    found = [without_text(f"{slot} {use}", options(slot, use)) for slot, use in shipped()]
    assert [silent for each in found for silent in each] == []


def test_every_option_of_a_part_does() -> None:
    found = {part: list(options_of(registry.part_class(part))) for part in PARTS}
    assert all(found.values())
    assert [silent for part, each in found.items() for silent in without_text(part, each)] == []


def refused(slot: str, use: str, option: Option) -> str | None:
    """Return why a default that was written into a stack file as it is shown is refused, None if it is taken."""
    *outer, last = option.name.split(".")
    text = "".join(f"{{{name}: " for name in outer) + f"{{{last}: {option.default}}}" + "}" * len(outer)
    try:
        written = read_yaml(text, option.name)
        assert isinstance(written, dict)
        assert registry.configure(slot, use, written) is not None
    except Exception as error:
        return f"{slot} {use} {text}: {error!r}"
    return None


def test_every_default_can_be_written_into_a_stack_file_as_it_is_shown() -> None:
    tried: list[str] = []
    found: list[str | None] = []
    for slot, use in shipped():
        shown = options(slot, use)
        # Without one that has no default, it cannot be configured by one option alone.
        if registry.config_class(registry.load(slot, use)) and REQUIRED not in {o.default for o in shown}:
            tried.append(use)
            found += [refused(slot, use, option) for option in shown if option.default]
    assert len(tried) > 40
    assert [why for why in found if why] == []


def test_a_default_that_is_refused_is_found() -> None:
    why = refused("grasp_method", "visual_servo", Option("centroid.depth", "float", "much", "how far"))
    assert why is not None and "much" in why


def test_options_inside_a_mapping_come_after_it_with_the_defaults_of_the_outer_one() -> None:
    found = {option.name: option for option in options("lower_body", "vendor")}
    assert list(found)[1:3] == ["envelope", "envelope.vx"]
    # Envelope's own default is no motion at all.
    assert found["envelope.vx"].default == "[-0.4, 0.8]"
    assert found["robot"] == Option("robot", "str", "h1", found["robot"].text)


def test_an_option_without_a_default_says_so() -> None:
    found = {option.name: option.default for option in options("lower_body", "handover")}
    assert (found["walk"], found["walk.use"], found["blend"]) == (REQUIRED, REQUIRED, "0.8")


def test_what_may_be_switched_off_says_so() -> None:
    found = {option.name: option.kind for option in options_of(registry.part_class("locomotion"))}
    assert (found["blend"], found["trim"]) == ("float or off", "mapping or off")


def test_a_users_class_is_shown_by_its_constructor(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(MINE)
    text = options_text(OptionsConfig("lower_body", f"{tmp_path / 'mine.py'}:Mine"))
    assert "Mine: Legs of mine.\n" in text and "Longer" not in text
    assert f"gain: float = {REQUIRED}\n      how strong; a text that goes on here [1/s]." in text
    assert "names: list of str = [a, b]\n      whose." in text
    assert "onboard" not in text


def test_slots_implementations_and_their_first_lines_are_listed() -> None:
    everything = options_text(OptionsConfig())
    assert all(f"{name} " in everything for name in (*SLOTS, *PARTS))
    assert "tether, random_walk_kf, invariant_ekf" in everything
    assert "It has no options." in options_text(OptionsConfig("estimator", "tether"))
    listed = options_text(OptionsConfig("fallback"))
    assert all(f"\n  {use} " in listed for use in SLOTS["lower_body"].shipped)
    assert "Moves the legs to a stance" in listed


def test_the_first_line_of_a_module_says_more_than_where_to_read() -> None:
    lists = (options_text(OptionsConfig(slot)).splitlines() for slot in SLOTS)
    assert [line for lines in lists for line in lines if "  See `" in line] == []


def test_an_implementation_that_cannot_be_loaded_hides_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    load = registry.load

    def lacking(slot: str, use: str) -> type:
        if use == "wbc":
            raise GolemError("It needs a solver.")
        return load(slot, use)

    monkeypatch.setattr(registry, "load", lacking)
    text = options_text(OptionsConfig("lower_body"))
    assert "wbc       It needs a solver." in text and "almi      Walks" in text


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("lower_bdy",), "Unknown slot 'lower_bdy'.*Did you mean 'lower_body'"),
        (("locomotoin",), "Did you mean 'locomotion'"),
        (("hand", "magpi"), "Did you mean 'magpie'"),
    ],
)
def test_wrong_names_are_answered(words: tuple[str, ...], said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        options_text(OptionsConfig(*words))
