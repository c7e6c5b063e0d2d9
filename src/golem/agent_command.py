"""`golem mcp`: the skills of a stack as tools for programs and language models, in this process or on a domain."""

from __future__ import annotations

import asyncio
import secrets
import signal
import socket
import sys
import threading
from collections.abc import Callable, Iterable
from contextlib import ExitStack, closing, redirect_stdout, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from tyro.conf import OmitArgPrefixes, Positional, arg

from golem.agent.audit import AuditLog
from golem.agent.body import Body
from golem.agent.desk import Call, Desk
from golem.agent.domain_body import DomainBody
from golem.agent.mcp_server import modules, serve_http, serve_stdio
from golem.agent.sentences import SentencePlanner, replay
from golem.agent.stack_body import StackBody
from golem.agent.tool_rules import load_rules
from golem.dashboard.live import LiveView
from golem.errors import ConfigError
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.web_gate import listen
from golem.run import on_air, shown
from golem.runtime.live.node_setup import member
from golem.runtime.lockstep import build
from golem.stack import load_stack

TERMINAL = Path("/dev/tty")
HELP = "Answer 'yes NUMBER' or 'no NUMBER'; 'stop' cancels what runs, 'stop motors' has the safety gate stop the robot."


class ToolOperator:
    """Asks and listens."""

    def __init__(self, desk: Desk, tell: Callable[[str], None], show: Callable[[str | None], None]) -> None:
        """Answer for `desk`; `tell` says a line on the console, `show` a question in the live view."""
        self._desk, self._tell, self._show = desk, tell, show
        self._shown: int | None = None
        desk.on_ask = self._asked

    def _asked(self, text: str | None) -> None:
        if text is not None:
            self._tell(f"May it? {text}   {HELP}")
        self._shown = next(iter(self._desk.asked), None)
        call = None if self._shown is None else self._desk.asked[self._shown]
        self._show(None if call is None else f"[{call.number}] {call.tool} {call.fields}"[:400])

    def decide(self, yes: bool) -> None:
        """Answer the question that the live view shows."""
        if self._shown is not None:
            self._desk.decide(self._shown, yes, "the live view")

    def listen(self, lines: Iterable[str]) -> None:
        """Do what each line says, on a thread of its own."""
        threading.Thread(target=self._listen, args=(lines,), name="operator", daemon=True).start()

    def _listen(self, lines: Iterable[str]) -> None:
        for line in lines:
            word, _, rest = line.strip().partition(" ")
            if word in ("yes", "no") and rest.strip().isdecimal():
                self._desk.decide(int(rest), word == "yes", "the console")
            elif word == "stop":
                self._desk.submit(Call("operator", "stop", {"motors": rest.strip() == "motors"}))
            elif word:
                self._tell(HELP)


def terminal() -> Iterable[str]:
    """Return the lines that an operator types, where stdin is the agent's; none where there is no terminal."""
    try:
        return TERMINAL.open(encoding="utf-8", errors="replace")
    except OSError:
        print("golem: no terminal to ask the operator on; what has to be asked is denied.", file=sys.stderr)
        return ()


@dataclass(frozen=True)
class McpConfig:
    """Offer the skills of a robot as tools of the Model Context Protocol, on stdin and stdout or on a port.

    With a STACK the robot is simulated in this process; without, it is the one on the domain. With --do or --replay
    nobody is served: the same tools, under the same rules, are used at once.
    """

    stack: Annotated[str | None, Positional, arg(metavar="[STACK]")] = None
    """Path of a stack file, or the name of a shipped one."""
    do: Annotated[str | None, arg(metavar="WORDS")] = None
    """Do this errand without any model, e.g. 'put the mug where the bowl was'."""
    replay: Annotated[Path | None, arg(metavar="FILE")] = None
    """Make the calls of an audit log again."""
    rules: Path | None = None
    """YAML file that says which tools run freely, ask or never run; by default all that move ask."""
    audit: Path = Path("audit.jsonl")
    """File to which every call, answer, question and refusal is added."""
    port: int | None = None
    """Serve on this port of 127.0.0.1 instead of stdin and stdout; a token is printed."""
    token_file: Path | None = None
    """File with the token for the port; by default a new one is made, and printed."""
    paced: bool = False
    """Let a simulated robot's time pass with the wall clock; by default it passes only while a skill runs."""
    view: bool = False
    """Show it in the live view, where the operator may answer; paced."""
    record: Annotated[Path | None, arg(metavar="PATH", help_behavior_hint="")] = None
    """Write everything public into a bag, a new folder of this name."""
    profile: str | None = None
    """Realism profile: ideal, bench or field; default: the stack file's."""
    seed: int = 0
    """Seed of the episode."""
    jobs: Path = Path()
    """Folder of the jobs of `disassemble`, where the robot is on a domain."""
    dds: OmitArgPrefixes[DdsConfig] = field(default_factory=DdsConfig)


def run_mcp(config: McpConfig) -> bool:
    """Serve until the client leaves, or Ctrl-C; or do what is asked, and return whether it was done.

    Raises:
        ConfigError, GolemError: an option, the stack or the rules are wrong, or no robot is there.
        MissingExtra: mcp is not installed.
    """
    served = config.do is None and config.replay is None
    if served:
        modules()
    rules, token = load_rules(config.rules), _token(config)
    if config.stack is None and (config.view or config.record is not None):
        raise ConfigError("--view and --record are for a STACK in this process; beside a domain: golem view, record.")
    stack = None if config.stack is None else load_stack(config.stack, profile=config.profile)
    listener = listen("127.0.0.1", config.port) if served and config.port is not None else None
    with ExitStack() as ending:
        for number in (signal.SIGTERM, signal.SIGHUP):  # of clients, and of terminals
            if signal.getsignal(number) is not signal.SIG_IGN:
                ending.callback(signal.signal, number, signal.signal(number, signal.default_int_handler))
        log = AuditLog(config.audit, bag=str(config.record or ""), stack=config.stack or "", rules=str(config.rules))
        ending.callback(log.close)
        view: LiveView | None = None
        body: Body
        if stack is None:
            joined = ending.enter_context(member("mcp", config.dds))
            body = DomainBody(*joined, f"start a stack with: {config.dds.command('up STACK')}", config.jobs)
        else:
            # Where stdout is the client's, what a library prints goes elsewhere.
            with redirect_stdout(sys.stderr):
                running, robot = build(stack, config.seed)
                ending.enter_context(closing(robot))
                show = ending.enter_context(on_air(running, robot, config.record))
                if config.view:
                    view = ending.enter_context(LiveView(running, shown(running, robot), passive=True))
            body = StackBody(running, robot, config.paced or config.view, None if config.record is None else show)
        desk = Desk(body, rules, log)
        ending.callback(desk.leave_all)  # however it ends: on a domain the robot would go on
        operator = ToolOperator(desk, _say, (lambda text: None) if view is None else view.panel.ask)
        if view is not None:
            view.decide = operator.decide
        operator.listen(terminal() if served and config.port is None else sys.stdin)
        if served:
            _serve(desk, listener, token)
            return True
        return _use(desk, config)


def _use(desk: Desk, config: McpConfig) -> bool:
    if config.replay is not None:
        rows = list(replay(config.replay, desk.call))
        for tool, then, now in rows:
            print(f"{tool:12s} {'did' if then else 'did not'} succeed, {'does' if now else 'does not'} now")
        return all(then == now for _, then, now in rows)
    report = SentencePlanner(desk.call).do(config.do or "")
    print(report.text)
    return report.done


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def _token(config: McpConfig) -> str:
    if config.token_file is None:
        return secrets.token_urlsafe(24)
    try:
        token = config.token_file.read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"The token in '{config.token_file}' cannot be read: {error}.") from error
    if len(token) < 16 or not token.isascii():
        raise ConfigError(f"The token in '{config.token_file}' has at least 16 letters and digits.")
    return token


def _serve(desk: Desk, listener: socket.socket | None, token: str) -> None:
    """Serve on a thread, while this one has the robot, until the client has left."""
    left = threading.Event()
    if listener is not None:
        _say(f"http://127.0.0.1:{listener.getsockname()[1]}/mcp   Authorization: Bearer {token}\n{HELP}")

    def serve() -> None:
        try:
            asyncio.run(serve_stdio(desk) if listener is None else serve_http(desk, listener, token))
        finally:
            left.set()

    threading.Thread(target=serve, name="mcp", daemon=True).start()
    with suppress(KeyboardInterrupt):
        desk.run(left.is_set)
