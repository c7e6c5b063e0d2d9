"""What an operator asks of running processes: of the safety gate, and of what started them.

A client of the safety process that is there already when it is needed: Enter presses the emergency stop.

`golem safety press` starts an interpreter and joins the domain first, which takes seconds on a busy machine. This one
has done both, found the services, and waits for a line.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any, Literal

from tyro.conf import OmitArgPrefixes, Positional

from golem.errors import ConfigError, GolemError, unknown_name
from golem.interfaces import public
from golem.interfaces.payloads import GateState, GateStatus, Reason
from golem.interfaces.ros_convert import to_gate_status
from golem.middleware.dds.base import Participant
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.ros.future import Future, RosError
from golem.middleware.ros.msgs.std_srvs import SetBool_Request, Trigger_Request
from golem.middleware.ros.node import RosNode
from golem.middleware.ros.service import Client
from golem.runtime.live.motion_switcher_client import CALLS, MotionSwitcherClient
from golem.runtime.live.node_setup import ANSWER, SEARCH, find, log_line, member, settle, until
from golem.runtime.live.role_endpoints import RoleEndpoints
from golem.runtime.live.safety_status import describe_status

REQUESTS: dict[str, tuple[str, Any]] = {
    "activate": ("/safety/activate", Trigger_Request()),
    "stop": ("/safety/stop", Trigger_Request()),
    "reset": ("/safety/reset", Trigger_Request()),
    "hand-over": ("/safety/hand_over", Trigger_Request()),
    "press": ("/estop/press", SetBool_Request(True)),
    "release": ("/estop/press", SetBool_Request(False)),
    "status": ("", None),
}
"""What can be asked of the safety process: service and request."""


@dataclass(frozen=True)
class RequestConfig:
    """Ask something of the safety process on a domain."""

    dds: OmitArgPrefixes[DdsConfig] = field(default_factory=DdsConfig)


@dataclass(frozen=True)
class TakeConfig:
    """Have the robot's own controller let go of the motors, so that the safety gate may have them."""

    hanging: bool = False
    """The robot hangs in its hoist: without a controller it goes limp at once."""
    dds: OmitArgPrefixes[DdsConfig] = field(default_factory=DdsConfig)


@dataclass(frozen=True)
class RestartConfig:
    """Restart one process that `golem launch` started; the others go on."""

    process: Positional[Literal["twin", "safety", "up"]]
    """Which one."""
    dds: OmitArgPrefixes[DdsConfig] = field(default_factory=DdsConfig)


def run_request(what: str, config: RequestConfig) -> bool:
    """Ask the safety process for `what`, a key of `REQUESTS`, and say what it answers; return whether it agreed.

    Raises RosError: there is none, or it does not answer.
    """
    service, request = REQUESTS[what]
    with member("operator", config.dds) as (_, node):
        if not service:
            return _status(node, config.dds)
        kind = next(row.type for row in public.SERVICES if row.name == service)
        try:
            response = ask(node, service, kind, request, f"start it with: {config.dds.command('safety')}")
        except RosError as error:
            if what not in ("stop", "press"):
                raise
            raise RosError(not_stopped(config.dds)) from error
        log_line(response.message)
        return response.success


def not_stopped(dds: DdsConfig) -> str:
    """Return what a person is told whose request to stop reached nobody."""
    return f"NOT STOPPED: press the robot's own emergency stop. No gate answers on {dds}."


def run_restart(config: RestartConfig) -> bool:
    """Have a process restarted, say the answer; return whether it was. Raises RosError: nothing was launched."""
    with member("operator", config.dds) as (_, node):
        name = f"/launch/restart_{config.process}"
        remedy = f"only what 'golem launch' started on {config.dds} can be restarted so"
        response = ask(node, name, public.TRIGGER, Trigger_Request(), remedy)
        log_line(response.message)
        return response.success


def ask(node: RosNode, service: str, kind: str, request: Any, remedy: str) -> Any:
    """Call a service and return the response. `remedy`: what the user can do when nobody offers it.

    Raises RosError: nobody offers it, or it does not answer in time.
    """
    client = node.client(service, kind)
    find(node, service, client, remedy)
    return node.wait(client.call(request), ANSWER)


def _status(node: RosNode, dds: DdsConfig) -> bool:
    status = _heard(node)
    if status is None:
        raise RosError(f"No safety gate on {dds}; start one with: {dds.command('safety')}")
    log_line(describe_status(status))
    return status.state is GateState.ACTIVE


def _heard(node: RosNode) -> GateStatus | None:
    """Return what the gate says of itself; None: there is none."""
    row = public.topic("/safety/status")
    subscription = node.subscription(row.name, row.type, None, row.qos)
    until(node, lambda: subscription.latest() is not None, SEARCH)
    message = subscription.latest()
    return None if message is None else to_gate_status(message)


def run_take(config: TakeConfig) -> bool:
    """Have the robot's own controller let go of the motors; return whether none of them has them now.

    Raises:
        ConfigError: nobody said that the robot hangs, or the gate would not damp the motors.
        RosError: nobody answers for the robot, or there is no gate.
    """
    with member("operator", config.dds) as (participant, node):
        return _take(participant, node, config)


def _take(participant: Participant, node: RosNode, config: TakeConfig) -> bool:
    switcher = MotionSwitcherClient.on(RoleEndpoints("safety", participant, node, only=(CALLS,)), node.now)

    def answered(wanted: Callable[[], bool], timeout: float) -> bool:
        def ask() -> bool:
            switcher.poll()
            return wanted()

        return until(node, ask, timeout)

    if not answered(lambda: switcher.known, SEARCH):
        raise RosError(f"No robot on {config.dds} says which of its own controllers has the motors; is it switched on?")
    if not switcher.free:
        status = _heard(node)
        if status is None:
            raise RosError(
                f"No safety gate on {config.dds} would damp the motors: start one with: {config.dds.command('safety')}"
            )
        if status.reason is not Reason.HELD and status.state is GateState.INIT:
            raise ConfigError(f"The gate would not damp the motors: {status.why}. Mend that first.")
        if not config.hanging:
            raise ConfigError(
                f"'{switcher.owner}' has the motors. A robot that stands falls once it lets go of them: hang it up, "
                "then repeat this with --hanging."
            )
        log_line(f"'{switcher.owner}' has the motors and lets go of them: the robot goes limp.")
        switcher.release()
        if not answered(lambda: switcher.free, SEARCH):
            log_line(f"'{switcher.owner}' still has them: switch the robot to its debug mode by remote control.")
            return False
    log_line("None of the robot's own controllers has the motors.")
    return True


WORDS = tuple(word for word, (service, _) in REQUESTS.items() if service)
"""What can be typed; an empty line is the first that helps in an emergency: press."""
HELP = (
    "Enter, or a word that is none of these, stops the robot; Enter presses the virtual emergency stop, too. "
    f"Type {', '.join(WORDS)}. Ctrl-D ends this."
)


def run_console(config: RequestConfig) -> None:
    """Wait for lines on stdin, and ask the safety process for what each says. Raises RosError: there is none."""
    with member("operator", config.dds) as (_, node):
        console = Console(node, lambda answer: node.wait(answer, ANSWER))
        console.connect(f"start it with: {config.dds.command('safety')}")
        settle()
        log_line(HELP)
        console.run(sys.stdin)


class Console:
    """The clients of the safety process's services, and what turns lines into calls."""

    def __init__(
        self, node: RosNode, wait: Callable[[Future[Any]], Any], tell: Callable[[str], None] = log_line
    ) -> None:
        """Call through `node`; `wait` returns what is answered, and `tell` says it."""
        kinds = {row.name: row.type for row in public.SERVICES}
        names = dict.fromkeys(REQUESTS[word][0] for word in WORDS)
        self._clients: dict[str, Client] = {name: node.client(name, kinds[name]) for name in names}
        self._node, self._wait, self._tell = node, wait, tell

    def connect(self, remedy: str) -> None:
        """Find every service ahead of the first call. Raises RosError: nobody offers them; `remedy` says what to do."""
        for name, client in self._clients.items():
            find(self._node, name, client, remedy)

    def run(self, lines: Iterable[str]) -> None:
        """Ask for what each line says, until there are no more; what fails is said, and the next line counts."""
        for line in lines:
            word = line.strip() or "press"
            # A robot with a button of its own has none that can be pressed from here; who mistypes may mean a stop.
            known = (word,) if word in WORDS else ("stop",)
            for request in ("stop", "press") if word == "press" else known:
                try:
                    self._ask(request)
                except GolemError as error:
                    self._tell(str(error))
            if word not in WORDS:
                self._tell(str(unknown_name("request", word, WORDS)))

    def _ask(self, word: str) -> bool:
        service, request = REQUESTS[word]
        answer = self._wait(self._clients[service].call(request))
        self._tell(answer.message)
        return bool(answer.success)
