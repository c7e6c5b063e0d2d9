#!/usr/bin/env bash
# mcp 2.3.0, CPython 3.11: over Streamable HTTP a tool goes on when its client has died, up to the protocol of 2025-11.
#
# A tool that moves something has to stop when nobody is left who wanted it. With the protocol of 2026-07 the server
# cancels the handler when the connection of its request ends. With the handshake of before it does not: the stream may be
# resumed, so the handler runs to its end, and neither its progress reports nor anything else tells it. A server has to
# listen for `http.disconnect` of the request itself.
#
# Seen: the client is killed in the middle of a call; 3 s later the handler of mode `auto` was cancelled, that of `legacy`
# still runs.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet mcp==2.3.0

cat > "$folder/call.py" << 'PYTHON'
import asyncio
import subprocess
import sys

import mcp_types as types
import uvicorn
from mcp import Client
from mcp.server.lowlevel.server import Server

PORT = 18765
seen = []


async def call_tool(context, params):
    seen.append("began")
    try:
        await asyncio.sleep(10.0)
    except asyncio.CancelledError:
        seen.append("cancelled")
        raise
    return types.CallToolResult(content=[])


async def list_tools(context, params):
    return types.ListToolsResult(tools=[types.Tool(name="move", input_schema={"type": "object"})])


async def serve(mode):
    app = Server("s", on_call_tool=call_tool, on_list_tools=list_tools).streamable_http_app()
    server = uvicorn.Server(uvicorn.Config(app, host="127.0.0.1", port=PORT, log_level="error"))
    task = asyncio.create_task(server.serve())
    while not server.started:
        await asyncio.sleep(0.05)
    client = subprocess.Popen([sys.executable, __file__, "client", mode], stderr=subprocess.DEVNULL)
    while not seen:
        await asyncio.sleep(0.05)
    client.kill()
    await asyncio.sleep(3.0)
    print(mode, seen[-1], flush=True)
    task.cancel()


async def client(mode):
    async with Client(f"http://127.0.0.1:{PORT}/mcp", mode=mode) as session:
        await session.call_tool("move", {})


try:
    asyncio.run(client(sys.argv[2]) if sys.argv[1] == "client" else serve(sys.argv[2]))
except asyncio.CancelledError:
    pass
PYTHON

found=$(cd "$folder" && for mode in auto legacy; do timeout 300 "$folder/venv/bin/python" call.py server $mode 2> /dev/null | tail -1; done)
echo "$found"
[ "$found" = "$(printf 'auto cancelled\nlegacy began')" ]
