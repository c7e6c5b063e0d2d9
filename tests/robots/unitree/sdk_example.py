"""Runs a program of the vendor's SDK, unchanged, on a DDS domain of one's choice.

    GOLEM_UNITREE_SDK=<checkout> python tests/robots/unitree/sdk_example.py 1 h1_2/low_level/h1_2_low_level_example.py

The program itself joins domain 0, which is the robot's. The SDK joins one domain per process: the first one asked for.
"""

from __future__ import annotations

import io
import os
import runpy
import sys
from pathlib import Path


def main(domain: int, example: str) -> None:
    """Run `example`, a path below the SDK's `example/`, on `domain` through the loopback interface."""
    sdk = Path(os.environ["GOLEM_UNITREE_SDK"])
    sys.path.insert(0, str(sdk))
    from unitree_sdk2py.core.channel import ChannelFactoryInitialize  # type: ignore[import-not-found]

    ChannelFactoryInitialize(domain, "lo")
    path = sdk / "example" / example
    sys.argv = [str(path), "lo"]
    sys.stdin = io.StringIO("\n")  # it waits for Enter
    runpy.run_path(str(path), run_name="__main__")


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2])
