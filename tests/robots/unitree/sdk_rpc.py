"""Remote calls with the vendor's SDK: its clients of the motion switcher and the H1's loco service, or its server.

GOLEM_UNITREE_SDK=<checkout> python tests/robots/unitree/sdk_rpc.py client|server DOMAIN
"""

# pyright: reportMissingImports=false

from __future__ import annotations

import json
import os
import sys
import time
from typing import Any

ECHO, FAIL = 1234, 1235


def client() -> list[Any]:
    """Call every function the twin answers, and some it refuses; return status codes and results."""
    from unitree_sdk2py.comm.motion_switcher.motion_switcher_client import MotionSwitcherClient
    from unitree_sdk2py.h1.loco.h1_loco_client import LocoClient

    switcher, loco = MotionSwitcherClient(), LocoClient()
    for one in (switcher, loco):
        one.SetTimeout(5.0)
        one.Init()
    return [
        switcher.GetServerApiVersion(),
        switcher.CheckMode(),
        switcher.SelectMode("normal"),
        loco.GetServerApiVersion(),
        loco.SetFsmId(204),
        loco.SetFsmId(1),
        loco.SetFsmId(2),
        loco.SetVelocity(0.1, 0.0, 0.0, 1.0),
        loco.SetStandHeight(0.9),
        switcher.ReleaseMode(),
        switcher.CheckMode(),
        loco.SetFsmId(1),
        switcher.SelectMode("ai"),
        switcher.CheckMode(),
    ]


def server() -> None:
    """Serve `test`: one function repeats its parameter, another fails."""
    from unitree_sdk2py.rpc.server import Server

    one = Server("test")
    one._SetApiVersion("1.2.3.4")
    one._RegistHandler(ECHO, lambda parameter: (0, parameter), False)
    one._RegistHandler(FAIL, lambda parameter: (42, "not sent with an error"), False)
    one.Start()
    time.sleep(60.0)


def main() -> None:
    """Run what the command line says."""
    sys.path.insert(0, os.environ["GOLEM_UNITREE_SDK"])
    from unitree_sdk2py.core.channel import ChannelFactoryInitialize

    ChannelFactoryInitialize(int(sys.argv[2]), "lo")
    if sys.argv[1] == "server":
        server()
    else:
        print(json.dumps(client()))


if __name__ == "__main__":
    main()
