"""The official client of the protocol lists and calls everything, in this process and over a port."""

from __future__ import annotations

import asyncio
import json
import socket
import threading
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest
from tests.agent.fake_body import HOSTILE, Rig

from golem.agent.mcp_server import http_app, make_server, tool_specs
from golem.agent.tool_rules import Rules, ToolRule
from golem.agent_command import McpConfig, run_mcp
from golem.errors import ConfigError
from golem.interfaces.payloads import Feedback
from golem.runtime.skill_table import SkillTable
from golem.stack import Stack

mcp = pytest.importorskip("mcp", reason="the extra agent is not installed")
jsonschema = pytest.importorskip("jsonschema", reason="the extra agent is not installed")
FREE = Rules(default="free", calls=1000)
TOKEN = "t" * 20


def served(rig: Rig, talk: Callable[[], Awaitable[None]]) -> None:
    """Have `talk` on a thread while the desk has its turns in this one, as in `golem mcp`."""
    over, raised = threading.Event(), list[BaseException]()

    def run() -> None:
        try:
            asyncio.run(asyncio.wait_for(talk(), 60.0))
        except BaseException as error:
            raised.append(error)
        finally:
            over.set()

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    rig.desk.run(over.is_set)
    thread.join()
    if raised:
        raise raised[0]


def test_the_schemas_of_every_shipped_skill_are_sound(tmp_path: Path) -> None:
    rig = Rig(tmp_path, Rules(tools={"walk": ToolRule("free", fields={"timeout": [0, 20]})}))
    rig.body.specs = SkillTable(Stack()).specs
    tools = {tool.name: tool for tool in tool_specs(rig.desk)}
    assert {"stop", "look", "read", "walk", "pick", "recall"} <= set(tools)
    asks = {name: "operator is asked" in tools[name].text for name in ("stop", "look", "read", "walk", "pick")}
    assert asks == {"stop": False, "look": False, "read": False, "walk": False, "pick": True}
    for tool in tools.values():
        for schema in (tool.takes, tool.gives):
            jsonschema.Draft202012Validator.check_schema(schema)
            assert schema["type"] == "object"
    walk = tools["walk"].takes["properties"]
    assert walk["timeout"]["maximum"] == 20 and "[m]" in walk["x"]["description"] and not tools["walk"].still
    assert tools["open"].takes["properties"]["angle"]["maximum"] == 1.2 and "operator" in tools["open"].text


def test_a_list_of_no_words_allows_none_and_is_shown(tmp_path: Path) -> None:
    rig = Rig(tmp_path, Rules(tools={"go": ToolRule("free", fields={"label": []})}))
    go = next(tool for tool in tool_specs(rig.desk) if tool.name == "go")
    assert go.takes["properties"]["label"]["enum"] == []
    assert not rig.desk.call("go", {"x": 1.0})["success"] and rig.body.began == []


@pytest.mark.parametrize("mode", ["auto", "legacy"])
def test_the_client_lists_and_calls_everything(tmp_path: Path, mode: str) -> None:
    rig = Rig(tmp_path, FREE)

    async def talk() -> None:
        async with mcp.Client(make_server(rig.desk), mode=mode) as client:
            tools = {tool.name: tool for tool in (await client.list_tools()).tools}
            assert set(tools) == {"stop", "look", "read", "go", "remember"}
            heard: list[str] = []

            async def progress(at: float, total: float | None, text: str | None) -> None:
                heard.append(text or "")

            calls: list[tuple[str, dict[str, Any]]] = [
                ("go", {"x": 1.0}),
                ("remember", {"labels": ["mug"]}),
                ("look", {"camera": "head", "labels": ["mug"]}),
                ("look", {}),
                ("read", {"resource": "state"}),
                ("stop", {}),
            ]
            for name, arguments in calls:
                said = await client.call_tool(name, arguments, progress_callback=progress)
                assert not said.is_error and json.loads(said.content[0].text) == said.structured_content
                jsonschema.validate(said.structured_content, tools[name].output_schema)
                assert [c.type for c in said.content[1:]] == ["image"] * (name == "look")
            assert heard and json.loads(heard[0])["from_world"] is True and HOSTILE not in "".join(heard)
            for name, wrong in (("nope", {}), ("go", {"x": "NaN"}), ("go", {}), ("read", {"resource": "x"})):
                assert (await client.call_tool(name, wrong)).is_error
            kept = (await client.list_resources()).resources
            assert {str(r.uri) for r in kept} == {f"golem://{n}" for n in "state safety map memory inventory".split()}
            for resource in kept:
                text = (await client.read_resource(resource.uri)).contents[0].text
                assert json.loads(text)["success"] is True

    served(rig, talk)
    assert len(rig.body.began) == 3


@pytest.mark.parametrize("mode", ["auto", "legacy"])
def test_a_call_that_is_cancelled_stops_the_robot(tmp_path: Path, mode: str) -> None:
    rig = Rig(tmp_path, FREE)
    step = rig.body.step
    rig.body.step = lambda: (threading.Event().wait(0.005), step())[1]  # not done before it is cancelled

    async def talk() -> None:
        async with mcp.Client(make_server(rig.desk), mode=mode) as client:
            begun = asyncio.Event()

            async def progress(at: float, total: float | None, text: str | None) -> None:
                begun.set()

            call = asyncio.ensure_future(client.call_tool("go", {"x": 1.0, "steps": 100}, progress_callback=progress))
            await begun.wait()
            call.cancel()
            with pytest.raises(asyncio.CancelledError):
                await call
            while rig.body.busy:
                await asyncio.sleep(0.01)

    served(rig, talk)
    assert rig.body.x < 9.0 and "cancel" in rig.events()


def test_what_a_skill_says_after_its_client_left_disturbs_nobody(tmp_path: Path) -> None:
    rig = Rig(tmp_path, FREE)
    step, said = rig.body.step, rig.body.said
    rig.body.step = lambda: (threading.Event().wait(0.005), step())[1]
    loop = asyncio.new_event_loop()
    threading.Thread(target=loop.run_forever, daemon=True).start()

    async def talk() -> None:
        async with mcp.Client(make_server(rig.desk)) as client:
            await client.call_tool("go", {"x": 1.0, "steps": 100})

    talking = asyncio.run_coroutine_threadsafe(talk(), loop)
    rig.desk.run(lambda: rig.body.x > 0.0)
    loop.call_soon_threadsafe(loop.stop)
    while loop.is_running():
        threading.Event().wait(0.01)
    talking.cancel()
    loop.close()
    news = iter([Feedback(1.0, "go", "stand", "It stands.")])
    rig.body.said = lambda: next(news, None) or said()
    rig.desk.leave_all()
    assert not rig.body.busy and next(news, None) is None


def test_a_port_that_cannot_be_had_is_said_before_a_robot_is_built(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("golem.agent_command.build", lambda *_: pytest.fail("built"))
    with socket.create_server(("127.0.0.1", 0)) as taken:
        for port in (taken.getsockname()[1], 99_999, -1):
            with pytest.raises(ConfigError, match=rf"^Cannot listen on 127.0.0.1:{port} \(.*\); choose another port"):
                run_mcp(McpConfig("tether", port=port))


def test_only_who_has_the_token_is_served_over_http(tmp_path: Path) -> None:
    httpx = pytest.importorskip("httpx2")
    rig = Rig(tmp_path, FREE)
    app = http_app(rig.desk, TOKEN)
    call = {"jsonrpc": "2.0", "id": 1, "method": "tools/list"}
    kinds = {"content-type": "application/json", "accept": "application/json, text/event-stream"}
    good = {"authorization": f"Bearer {TOKEN}", **kinds}

    async def talk() -> None:
        async with httpx.AsyncClient(transport=httpx.ASGITransport(app=app), base_url="http://127.0.0.1:1") as client:
            for headers in ({}, {"authorization": "Bearer " + "u" * 20}, {"authorization": TOKEN}):
                assert (await client.post("/mcp", json=call, headers=kinds | headers)).status_code == 401
            assert (await client.post("/mcp", json=call, headers=good | {"origin": "http://a.b"})).status_code == 403
            assert (await client.post("/mcp", json=call, headers=good | {"host": "a.b"})).status_code == 421
            big = {**call, "params": {"x": "x" * 2_000_000}}
            assert (await client.post("/mcp", json=big, headers=good)).status_code == 413

    async def with_manager() -> None:
        # The application begins its sessions with its lifespan, as a server would let it.
        begun, end = asyncio.Event(), asyncio.Event()
        first = [{"type": "lifespan.startup"}]

        async def receive() -> Any:
            if first:
                return first.pop()
            await end.wait()
            return {"type": "lifespan.shutdown"}

        async def send(message: Any) -> None:
            begun.set()

        life = asyncio.ensure_future(app({"type": "lifespan", "asgi": {"version": "3.0"}}, receive, send))
        await begun.wait()
        await talk()
        end.set()
        await life

    served(rig, with_manager)
