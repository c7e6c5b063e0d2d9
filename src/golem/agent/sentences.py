"""A small planner that needs no model: it knows some sentences, and uses the tools as an agent would."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from golem.agent.audit import read_audit
from golem.errors import ConfigError, shorten
from golem.package_data import load_data

Use = Callable[[str, Mapping[str, Any]], dict[str, Any]]
"""Has a tool used with arguments, and returns its answer; `Desk.call`, or a client's."""
NUMBERS = {"a": 1, "one": 1, "two": 2, "three": 3, "four": 4, "five": 5, "six": 6}
SPANS = {"second": 1.0, "minute": 60.0, "hour": 3600.0, "day": 86400.0}
BESIDE = 20
"""How far beside another thing is, where nobody says [cm]."""
LOOKS, APART = 3, 0.02
"""How often screws are looked for, and how far apart places of two of them are [m]."""
SURE = 0.5
"""Score from which on a thing is counted."""
_DATA = load_data(__package__, "sentences.yaml")
SENTENCES: dict[str, str] = {pattern.format(**_DATA["parts"]): name for name, pattern in _DATA["sentences"].items()}
"""What is understood, and which script does it."""
EXAMPLES = "'put the mug where the bowl was yesterday', 'take out the three loose screws on the left'"


@dataclass
class ErrandReport:
    """What came of an errand.

    Attributes:
        done: whether the planner believes that it was done.
        text: a sentence.
        facts: what was found out, as numbers: `place` (x, y, z in the memory's frame [m]), `count`, `taken`, and
            `tight` and `jammed`, x and y in odom [m] of each.
        stage, slot: the stage of the tool that failed, and the module that it blames.
    """

    done: bool
    text: str
    facts: dict[str, Any] = field(default_factory=dict[str, Any])
    stage: str = "errand"
    slot: str | None = "memory"


class Spot(NamedTuple):
    """Where something is or was, in the memory's frame [m]."""

    x: float
    y: float
    z: float


class SentencePlanner:
    """Does errands by `use`."""

    def __init__(self, use: Use) -> None:
        self._use = use

    def do(self, words: str) -> ErrandReport:
        """Do what a sentence says. Raises ConfigError: it is none that is known."""
        sentence = " ".join(words.lower().split()).rstrip(".?!")
        for pattern, script in SENTENCES.items():
            found = re.fullmatch(pattern, sentence)
            if found is not None:
                return getattr(self, f"_{script}")(**{k: v for k, v in found.groupdict().items() if v is not None})
        raise ConfigError(f"The planner does not know how to '{shorten(words)}'; say it as in {EXAMPLES}.")

    def _recall(self, thing: str, tense: str, when: str = "") -> Spot | None:
        question: dict[str, Any] = {"text": thing, "when": "now" if tense == "is" else "anywhere", "limit": 20}
        number, _, span = when.partition(" ")
        if when == "yesterday":
            question |= {"when": "at", "ago": SPANS["day"]}
        elif number.isdecimal():
            question |= {"when": "at", "ago": float(number) * SPANS[span.split()[0].rstrip("s")]}
        places = (self._use("recall", question).get("value") or {}).get("places", [])
        if tense == "is":  # what was looked for in its place, and not seen, is elsewhere
            places = [place for place in places if place["evidence"]["text"] != "moved"]
        if not places:
            return None
        best = max(places, key=lambda p: p["first_seen"]) if when == "at first" else places[0]
        if question["when"] == "anywhere" and best["evidence"]["text"] == "seen" and when != "at first":
            # It was seen there last, and is there; nobody has looked again at every place where it was before.
            best = places[min(1, len(places) - 1)]
        return Spot(best["x"], best["y"], best["z"])

    def _fetch(self, thing: str, to: Spot | None) -> ErrandReport:
        goal = {"text": thing} if to is None else {"text": thing, "to": [to.x, to.y], "frame": "seen"}
        said = self._use("fetch", goal)
        facts = {} if to is None else {"place": list(to)}
        return ErrandReport(said["success"], said["reason"]["text"], facts, said["stage"], said["slot"])

    def _to_where(self, thing: str, other: str, tense: str, when: str = "") -> ErrandReport:
        spot = self._recall(other, tense, when)
        if spot is None:
            return ErrandReport(False, f"Nothing is remembered of the {other}.")
        return self._fetch(thing, spot)

    def _back(self, thing: str, when: str = "") -> ErrandReport:
        return self._to_where(thing, thing, "was", when)

    def _beside(self, thing: str, way: str, other: str, cm: str = str(BESIDE)) -> ErrandReport:
        spot = self._recall(other, "is")
        if spot is None:
            found = self._find(other)
            if not found.done:
                return found
            spot = Spot(*found.facts["place"])
        aside = 0.01 * float(cm) * (1.0 if way == "left" else -1.0)
        return self._fetch(thing, spot._replace(y=spot.y + aside))

    def _where(self, thing: str, tense: str, when: str = "") -> ErrandReport:
        spot = self._recall(thing, tense, when)
        if spot is None:
            return self._find(thing) if tense == "is" else ErrandReport(False, f"Nothing is remembered of the {thing}.")
        return ErrandReport(
            True, f"The {thing} {tense} at ({spot.x:.2f}, {spot.y:.2f}, {spot.z:.2f}).", {"place": list(spot)}
        )

    def _count(self, thing: str) -> ErrandReport:
        said = self._use("look", {"camera": "head", "labels": [thing]})
        count = sum(one["score"] >= SURE for one in said.get("found", []))
        return ErrandReport(said["success"], f"{count} of {thing}.", {"count": count})

    def _bring(self, thing: str) -> ErrandReport:
        return self._fetch(thing, None)

    def _find(self, thing: str) -> ErrandReport:
        said = self._use("search", {"text": thing})
        places = (said.get("value") or {}).get("places", [])
        facts = {"place": [places[0][axis] for axis in "xyz"]} if places else {}
        done = said["success"] and bool(places)
        return ErrandReport(done, said["reason"]["text"], facts, said["stage"], said["slot"])

    def _screws(self, number: str = "all", side: str = "") -> ErrandReport:
        """Pick what is seen on a side, the nearest to the middle first, until so many are out; look again for more."""
        wanted = int(number) if number.isdecimal() else NUMBERS.get(number)
        taken, ends, tried = 0, dict[str, list[list[float]]](), list[tuple[float, float]]()
        lost: tuple[str, str | None] = ("detect", "localizer")
        for _ in range(LOOKS):
            places = [(x, y) for x, y in self._seen(side) if all(math.dist((x, y), at) > APART for at in tried)]
            wanted = len(places) or None if wanted is None else wanted
            for x, y in places:
                if taken == wanted:
                    break
                said = self._use("pick", {"side": "either", "wanted": [x, y]})
                taken += said["success"]
                hands = (said.get("value") or {}).get("tried", [])
                if said["success"] or hands:
                    tried.append((x, y))
                if not said["success"]:
                    lost = said["stage"], said["slot"]
                if not said["success"] and hands:
                    ends.setdefault(hands[-1]["outcome"]["text"], []).append([hands[-1]["x"], hands[-1]["y"]])
        text = f"{taken} screws are out" + "".join(f"; {len(places)} {end}" for end, places in ends.items())
        facts = {"taken": taken} | {end: ends.get(end, []) for end in ("tight", "jammed")}
        return ErrandReport(taken >= (wanted or 0), f"{text}.", facts, *lost)

    def _seen(self, side: str) -> list[tuple[float, float]]:
        """Return x, y in odom [m] of the screws that are in view on a side, the nearest to the middle first."""
        base = self._use("read", {"resource": "state"}).get("state", {}).get("base", {"x": 0.0, "y": 0.0, "yaw": 0.0})
        places: list[tuple[float, float, float]] = []
        for one in self._use("look", {"camera": "head", "labels": ["screw"]}).get("found", []):
            dx, dy = one["position"][0] - base["x"], one["position"][1] - base["y"]
            aside = -math.sin(base.get("yaw", 0.0)) * dx + math.cos(base.get("yaw", 0.0)) * dy
            if side == "" or (aside > 0.0) == (side == "left"):
                places.append((abs(aside), *one["position"][:2]))
        return [(x, y) for _, x, y in sorted(places)]


def replay(file: Path, use: Use) -> Iterator[tuple[str, bool, bool]]:
    """Have the calls of a recorded session made again, in order; yield each tool, whether it succeeded, then and now.

    Raises ConfigError: the log cannot be read, or was changed.
    """
    starts: list[list[dict[str, Any]]] = []  # each numbers its calls from 1
    for entry in read_audit(file):
        if entry["event"] == "begin" or not starts:
            starts.append([])
        starts[-1].append(entry)
    try:
        calls = [call for entries in starts for call in _calls(entries)]
    except (KeyError, TypeError, AttributeError) as error:
        raise ConfigError(f"The audit log '{file}' was changed: an entry of it lacks {error}.") from error
    for tool, arguments, then in calls:
        yield tool, then, use(tool, arguments)["success"] is True


def _calls(entries: list[dict[str, Any]]) -> Iterator[tuple[str, dict[str, Any], bool]]:
    """Yield tool and arguments of each call that was kept whole, and whether it succeeded."""
    ends = {(e["session"], e["number"]): e for e in entries if e["event"] in ("answer", "refuse")}
    for entry in entries:
        if entry["event"] == "call" and isinstance(entry["arguments"], dict):
            answer = ends.get((entry["session"], entry["number"]), {}).get("answer", {})
            yield entry["tool"], entry["arguments"], answer.get("success") is True
