"""The desk between agents and a robot: one lease, the rules, the operator's yes or no, and the audit log.

Transport-free: agents hand calls in from any thread, one thread lets the desk have its turns and owns the robot.
"""

from __future__ import annotations

import math
import time
from collections import Counter, deque
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field
from queue import Empty, SimpleQueue
from typing import Any

import numpy as np

from golem import registry
from golem.agent.answers import answer, refusal, words
from golem.agent.audit import AuditLog
from golem.agent.body import Body, BodyMotion, Picture
from golem.agent.tool_rules import Rules
from golem.errors import GolemError, shorten, unknown_name
from golem.interfaces.payloads import Feedback
from golem.package_data import load_data
from golem.runtime.goal_parser import read_fields
from golem.skills.spec import Schema, SkillSpec
from golem.types import Array

LARGEST = 1 << 16
"""Characters of the arguments of a call [own]; more are refused unread."""
LOOK = 0.6
"""Time that is looked for things in a camera's picture [s]: a few frames and their latency."""
WAIT = 0.02
"""Time between two looks of a desk that has nothing to do [s]."""
FELT = 5
"""Moments over which what a hand feels is averaged: see `ForceGuard`."""
CLEAN_UP = 12.0
"""Time that a skill gets to leave the robot safe when the desk closes [s]: a little more than it has itself."""


def _own(name: str, description: str, properties: dict[str, Schema]) -> SkillSpec:
    """Return a tool that is no skill, as if it were one."""
    required = [key for key, of in properties.items() if "default" not in of]
    rest = {"properties": properties, "required": required, "additionalProperties": False}
    return SkillSpec(name, "", description, {"type": "object", **rest})


_DATA = load_data(__package__, "tools.yaml")
RESOURCES: Mapping[str, str] = _DATA["resources"]
"""What can be read, by name, and what it is."""
OWN = {name: _own(name, **said) for name, said in _DATA["tools"].items()}
"""Tools that are no skills."""
STILL = (*OWN, "recall", "remember")
"""Tools that move nothing; they need no lease."""


@dataclass(frozen=True)
class Answer:
    """What a tool says: JSON, and a picture where it has one."""

    data: dict[str, Any]
    jpeg: bytes | None = None


@dataclass(eq=False)
class Call:
    """One call in the desk's hands.

    Attributes:
        session, tool, arguments: whose, and what is asked.
        tell: called with what the skill says; from the desk's thread.
        answered: brings the answer.
        number: of the call, by which the operator is asked.
        fields: the skill's whole goal.
        canceled: whether who called wants it no more.
        until: when the operator's patience ends, by the desk's clock [s].
    """

    session: str
    tool: str
    arguments: Mapping[str, Any]
    tell: Callable[[Feedback], None] = lambda feedback: None
    answered: Future[Answer] = field(default_factory=Future[Answer])
    number: int = 0
    fields: dict[str, Any] = field(default_factory=dict[str, Any])
    canceled: bool = False
    until: float = 0.0


class Desk:
    """Answers calls, one motion at a time.

    Attributes:
        asked: what waits for the operator, by number.
        on_ask: called with each new question, and with None when one is settled.
    """

    def __init__(self, body: Body, rules: Rules, audit: AuditLog, clock: Callable[[], float] = time.monotonic) -> None:
        """Let agents use `body` as `rules` say, and keep all of it in `audit`; `clock` is this process's own [s].

        Raises ConfigError: the rules name a tool that is none, so what they mean to narrow would be free.
        """
        known = {*OWN, *body.specs, *registry.names("skill")}
        for name in rules.tools:
            if name not in known:
                raise unknown_name("tool in the rules", name, known)
        self.body, self.rules, self._audit, self._clock = body, rules, audit, clock
        self._inbox: SimpleQueue[Callable[[], None]] = SimpleQueue()
        self.asked: dict[int, Call] = {}
        self.on_ask: Callable[[str | None], None] = lambda text: None
        self._active: Call | None = None
        self._over = ""
        self._felt: deque[Array] = deque(maxlen=FELT)
        self._before: Array | None = None
        self._owner, self._seen = "", -math.inf
        self._count, self._recent, self._number = Counter[str](), deque[float](), 0

    @property
    def tools(self) -> tuple[str, ...]:
        """Names of all tools."""
        return (*OWN, *self.body.specs)

    def submit(self, call: Call) -> Future[Answer]:
        """Hand in a call, from any thread; the future brings its answer."""
        self._inbox.put(lambda: self._take(call))
        return call.answered

    def cancel(self, call: Call) -> None:
        """Take a call back, from any thread; the robot stops what it does for it."""
        self._inbox.put(lambda: self._cancel(call))

    def leave(self, session: str) -> None:
        """Say, from any thread, that a client is gone: nothing of it goes on, and it has no lease."""
        self._inbox.put(lambda: self._leave(session))

    def decide(self, number: int, yes: bool, by: str = "operator") -> None:
        """Settle a question as the operator, from any thread; one that does not wait any more is settled already."""
        self._inbox.put(lambda: self._decide(number, yes, by))

    def call(self, tool: str, arguments: Mapping[str, Any], session: str = "here") -> dict[str, Any]:
        """Have a tool used in this thread, which owns the robot, and return its answer."""
        answered = self.submit(Call(session, tool, arguments))
        while not answered.done():
            self.turn()
        return answered.result().data

    def run(self, stop: Callable[[], bool]) -> None:
        """Have turns until `stop()`."""
        while not stop():
            self.turn()

    def leave_all(self) -> None:
        """Cancel what runs and what waits, and let it end: in this thread, when nobody serves any more."""
        for call in [*self.asked.values(), *([] if self._active is None else [self._active])]:
            self._cancel(call)
        end = self._clock() + CLEAN_UP
        while (self._active is not None or not self._inbox.empty()) and self._clock() < end:
            self.turn()

    def turn(self) -> None:
        """Take what has come, see to what runs, and let a little time pass."""
        idle = not (self.body.paced or self.body.busy or self._active)
        try:
            while True:
                self._inbox.get(idle, WAIT)()
                idle = False
        except Empty:
            pass
        for call in [call for call in self.asked.values() if self._clock() > call.until]:
            self._decide(call.number, False, "no answer in time")
        if self._active is not None:
            self._watch(self._active)
        if self.body.paced or self.body.busy:
            self.body.step()

    def _take(self, call: Call) -> None:
        self._number = call.number = self._number + 1
        now = self._clock()
        while self._recent and self._recent[0] < now - 1.0:
            self._recent.popleft()
        known = call.tool if call.tool in self.tools else shorten(repr(call.tool))
        arguments = call.arguments if _size(call.arguments) <= LARGEST else {"more than": LARGEST}
        self._tell("call", call, tool=known, arguments=arguments)
        try:
            if call.tool != "stop":
                if len(self._recent) >= self.rules.calls:
                    raise GolemError(f"More than {self.rules.calls} calls a second.")
                self._recent.append(now)
            self._admit(call)
        except GolemError as error:
            self._refuse(call, str(error))
        except Exception as error:  # arguments are a stranger's
            self._refuse(call, f"{type(error).__name__}: {shorten(str(error))}")

    def _admit(self, call: Call) -> None:
        """Answer, ask, begin or refuse; raises what is wrong with the call."""
        if _size(call.arguments) > LARGEST:
            raise GolemError(f"The arguments have more than {LARGEST} characters.")
        call.fields = fields = read_fields(self._spec(call.tool), call.arguments)
        if call.tool == "stop":
            return self._stop(call)
        rule = self.rules.of(call.tool)
        problem = self.rules.problem(call.tool, fields, self._places(fields))
        if rule.run == "never":
            problem = "The rules do not allow this tool."
        if rule.count is not None and self._count[call.tool] >= rule.count:
            problem = f"The rules allow this tool {rule.count} times."
        if problem:
            raise GolemError(problem)
        if call.tool not in STILL:
            now = self._clock()
            held = self._active is not None or bool(self.asked) or now - self._seen < self.rules.lease
            if self._owner not in ("", call.session) and held:
                raise GolemError("Another client has the lease for motions.")
            self._owner, self._seen = call.session, now
        if rule.run == "free":
            return self._begin(call)
        if any(other.session == call.session for other in self.asked.values()):
            raise GolemError("The operator has not yet answered your last question.")
        call.until = self._clock() + self.rules.patience
        self.asked[call.number] = call
        self._tell("ask", call)
        self.on_ask(f"[{call.number}] {call.tool} {shorten(str(call.fields), 400)}")

    def _spec(self, tool: str) -> SkillSpec:
        if tool not in self.tools:
            raise unknown_name("tool", shorten(str(tool)), self.tools)
        return OWN.get(tool) or self.body.specs[tool]

    def _places(self, goal: Mapping[str, Any]) -> list[tuple[float, float]]:
        """Return x, y in odom of where a goal sends the robot, or what it holds; raises where that is not known."""
        pairs = [(goal["x"], goal["y"])] if {"x", "y"} <= set(goal) else []
        pairs += [tuple(goal["to"])] if len(goal.get("to") or ()) == 2 else []
        if self.rules.region is None or not pairs:
            return []
        frame = goal.get("frame", "odom")
        places = [self.body.in_odom(frame, float(x), float(y)) for x, y in pairs]
        if None in places:
            raise GolemError(f"Where the frame '{frame}' is, is not known, so the region cannot be kept.")
        return [place for place in places if place is not None]

    def _begin(self, call: Call) -> None:
        if call.tool in OWN and not call.fields.get("labels"):
            self._count[call.tool] += 1
            if call.tool == "look":
                return self._answer(call, _seen(self.body.picture(call.fields["camera"])))
            name = call.fields["resource"]
            return self._answer(call, Answer({"success": True, name: self.body.read(name)}))
        if call.tool == "look":
            call.fields = read_fields(self._spec("remember"), {**call.fields, "seconds": LOOK})
        if self._audit.problem:
            raise GolemError(self._audit.problem)
        if self._active is not None:
            raise GolemError("Another skill is running; cancel it first.")
        self.body.begin("remember" if call.tool == "look" else call.tool, call.fields)
        self._count[call.tool] += 1
        self._active, self._over, self._before = call, "", None
        self._felt.clear()
        self._tell("begin skill", call)

    def _watch(self, call: Call) -> None:
        """Pass on what the skill that runs says, keep it within the rules, and answer once it has ended."""
        self._seen = self._clock()
        said = self.body.said()
        if said is not None:
            call.tell(said)
        result = self.body.result()
        if result is None:
            moment = self.body.moment()
            excess = ""
            if not self._over:
                excess = self._audit.problem or ("" if moment is None else self._excess(moment))
            if excess:
                self._over = excess
                self._tell("excess", call, why=excess)
                self.body.cancel()
            return
        self._active = None
        if call.tool == "look":
            self._answer(call, _seen(self.body.picture(call.fields["camera"])))
            return
        data = answer(result, self._spec(call.tool).result)
        if self._over and not result.success:
            data |= {"stage": "rules", "slot": None, "reason": words(self._over, False)}
        self._answer(call, Answer(data))

    def _excess(self, moment: BodyMotion) -> str:
        self._felt.append(moment.forces)
        force, mean = 0.0, np.mean(self._felt, axis=0)
        if len(self._felt) == FELT:
            self._before = mean if self._before is None else self._before
            force = float(np.linalg.norm(mean - self._before, axis=1).max())
        return self.rules.excess(moment.x, moment.y, moment.velocity, force)

    def _stop(self, call: Call) -> None:
        """Cancel what runs, whoever began it; with `motors` the safety gate stops the robot, too."""
        for number in list(self.asked):
            self._decide(number, False, "a stop")
        if self._active is not None:
            self.body.cancel()
        motors = call.fields["motors"]
        if motors:
            self.body.stop_motors()
        done = "The safety gate was asked for a stop." if motors else "What ran is cancelled."
        self._answer(call, Answer(refusal(done, "done") | {"success": True}))

    def _cancel(self, call: Call) -> None:
        if call.canceled or call.answered.done():
            return
        call.canceled = True
        self._tell("cancel", call)
        if call is self._active:
            self.body.cancel()
        elif call.number in self.asked:
            self._decide(call.number, False, "a cancellation")

    def _leave(self, session: str) -> None:
        self._audit.write("leave", self.body.t, session=session)
        for call in [call for call in self.asked.values() if call.session == session]:
            self._cancel(call)
        if self._active is not None and self._active.session == session:
            self._cancel(self._active)
        if self._owner == session:
            self._owner = ""

    def _decide(self, number: int, yes: bool, by: str) -> None:
        call = self.asked.pop(number, None)
        if call is None:
            self._audit.write("late decision", self.body.t, number=number, yes=yes, by=by)
            return
        self._tell("approve" if yes else "deny", call, by=by)
        self.on_ask(None)
        if not yes:
            self._refuse(call, f"The operator has not allowed it: {by}.")
            return
        try:
            # What was allowed is what runs; whether the rules still allow it may have changed meanwhile.
            problem = self.rules.problem(call.tool, call.fields, self._places(call.fields))
            if problem:
                raise GolemError(problem)
            self._begin(call)
        except GolemError as error:
            self._refuse(call, str(error))
        except Exception as error:  # a skill is a user's
            self._refuse(call, f"{type(error).__name__}: {shorten(str(error))}")

    def _refuse(self, call: Call, reason: str) -> None:
        self._tell("refuse", call, why=reason)
        self._done(call, Answer(refusal(reason)))

    def _answer(self, call: Call, said: Answer) -> None:
        self._tell("answer", call, answer=said.data)
        self._done(call, said)

    def _done(self, call: Call, said: Answer) -> None:
        if call.answered.set_running_or_notify_cancel():
            call.answered.set_result(said)

    def _tell(self, event: str, call: Call, **facts: object) -> None:
        self._audit.write(event, self.body.t, number=call.number, session=call.session, **{"tool": call.tool, **facts})


def _seen(picture: Picture | None) -> Answer:
    if picture is None:
        return Answer(refusal("No picture came.", "look"))
    found = [{"label": words(n), "score": s, "position": [x, y, z]} for n, s, x, y, z in picture.found]
    return Answer({"success": True, "frame": "odom", "found": found}, picture.jpeg)


def _size(value: Any) -> int:
    """Return how many characters a value has, about, without going through more than is allowed."""
    left, size = [value], 0
    while left and size <= LARGEST:
        each = left.pop()
        size += len(each) if isinstance(each, str) else 8
        if isinstance(each, Mapping):
            left += [*each.keys(), *each.values()]
        elif isinstance(each, list | tuple):
            left += each[: LARGEST // 8 + 1]
    return size
