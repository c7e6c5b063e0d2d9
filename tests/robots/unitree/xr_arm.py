"""Drives the arm class of a checkout of xr_teleoperate, unchanged: `xr_arm.py DOMAIN`.

GOLEM_XR_TELEOPERATE names the checkout, GOLEM_UNITREE_SDK the SDK's. The class joins a domain of its own choice; the
SDK joins one per process, the first that is asked for. Where its release knows `motion_mode` the arms go by /arm_sdk,
above the robot's own legs, else by /lowcmd, with nobody else there.
"""

from __future__ import annotations

import inspect
import os
import sys
import time
import types


def main(domain: int) -> None:
    sys.path[:0] = [os.environ["GOLEM_UNITREE_SDK"], os.path.join(os.environ["GOLEM_XR_TELEOPERATE"], "teleop")]
    try:
        import logging_mp  # noqa: F401  # type: ignore[import-not-found]
    except ModuleNotFoundError:
        import logging

        stub = types.ModuleType("logging_mp")
        stub.get_logger = logging.getLogger  # type: ignore[attr-defined]
        sys.modules["logging_mp"] = stub
    from unitree_sdk2py.core.channel import ChannelFactoryInitialize  # type: ignore[import-not-found]

    ChannelFactoryInitialize(domain, "lo")
    from robot_control.robot_arm import H1_2_ArmController  # type: ignore[import-not-found]

    motion = "motion_mode" in inspect.signature(H1_2_ArmController.__init__).parameters
    arm = H1_2_ArmController(**({"motion_mode": True} if motion else {}), simulation_mode=True)
    start = arm.get_current_dual_arm_q()
    print("motion" if motion else "debug", flush=True)
    for k in range(500):  # of the wall clock, at 50 Hz
        target = start.copy()
        target[3] -= 0.3 * min(1.0, k / 200.0)
        target[10] -= 0.3 * min(1.0, k / 200.0)
        arm.ctrl_dual_arm(target, 0.0 * target)
        time.sleep(0.02)
    print("moved", *(arm.get_current_dual_arm_q() - start)[[3, 10]], flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]))
