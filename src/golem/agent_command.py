"""`golem mcp`: the skills of a stack as tools for programs and language models, in this process or on a domain."""

from __future__ import annotations

import asyncio
import secrets
import sys
import threading
from contextlib import ExitStack, closing, redirect_stdout
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from tyro.conf import OmitArgPrefixes, Positional, arg

from golem.agent.audit import AuditLog
from golem.agent.body import Body
from golem.agent.console import HELP, Operator, terminal
from golem.agent.desk import Desk
from golem.agent.domain_body import DomainBody
from golem.agent.mcp_server import modules, serve_http, serve_stdio
from golem.agent.rules import load_rules
from golem.agent.stack_body import StackBody
from golem.dashboard.live import LiveView
from golem.errors import ConfigError
from golem.middleware.dds.domain import DdsConfig
from golem.run import on_air, shown
from golem.runtime.live.node_setup import member
from golem.runtime.lockstep import build
from golem.stack import load_stack


@dataclass(frozen=True)
class McpConfig:
    """Offer the skills of a robot as tools of the Model Context Protocol, on stdin and stdout or on a port.

    With a STACK the robot is simulated in this process; without, it is the one on the domain.
    """

    stack: Annotated[str | None, Positional, arg(metavar="[STACK]")] = None
    """Path of a stack file, or the name of a shipped one."""
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
    """Serve until the client leaves, or Ctrl-C.

    Raises:
        ConfigError, GolemError: an option, the stack or the rules are wrong, or no robot is there.
        MissingExtra: mcp is not installed.
    """
    modules()
    rules, token = load_rules(config.rules), _token(config)
    if config.stack is None and (config.view or config.record is not None):
        raise ConfigError("--view and --record are for a STACK in this process; beside a domain: golem view, record.")
    with ExitStack() as closing_all:
        log = AuditLog(config.audit, bag=str(config.record or ""), stack=config.stack or "", rules=str(config.rules))
        closing_all.callback(log.close)
        view: LiveView | None = None
        body: Body
        if config.stack is None:
            _, node = closing_all.enter_context(member("mcp", config.dds))
            body = DomainBody(node, f"start a stack with: {config.dds.command('up STACK')}", config.jobs)
        else:
            # Where stdout is the client's, what a library prints goes elsewhere.
            with redirect_stdout(sys.stderr):
                running, robot = build(load_stack(config.stack, profile=config.profile), config.seed)
                closing_all.enter_context(closing(robot))
                show = closing_all.enter_context(on_air(running, robot, config.record))
                if config.view:
                    view = closing_all.enter_context(LiveView(running, shown(running, robot), passive=True))
            watched = show if config.record is not None else None
            body = StackBody(running, robot, config.paced or config.view, watched)
        desk = Desk(body, rules, log)
        operator = Operator(desk, _say, view.panel.ask if view is not None else lambda text: None)
        if view is not None:
            view.decide = operator.decide
        operator.listen(terminal() if config.port is None else sys.stdin)
        if config.port is not None:
            _say(f"http://127.0.0.1:{config.port}/mcp   Authorization: Bearer {token}\n{HELP}")
        _serve(desk, config, token)
    return True


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


def _serve(desk: Desk, config: McpConfig, token: str) -> None:
    """Serve on a thread, while this one has the robot; what runs when the client has left is cancelled first."""
    left = threading.Event()

    def serve() -> None:
        try:
            asyncio.run(serve_stdio(desk) if config.port is None else serve_http(desk, config.port, token))
        finally:
            left.set()

    threading.Thread(target=serve, name="mcp", daemon=True).start()
    try:
        desk.run(left.is_set)
    except KeyboardInterrupt:
        pass
    desk.leave_all()
