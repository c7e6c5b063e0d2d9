"""The parameter services that every ROS 2 node has, for nodes that have no parameters.

`ros2 param list` and its like wait for them at every node they see, until a timeout where there are none. The options
of GOLEM's modules are in its stack files and hold for a whole run: nothing can be set here, and the answer says so.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from golem.middleware.ros.msgs import rcl_interfaces as rcl

REFUSED = rcl.SetParametersResult(
    False, "GOLEM has no ROS parameters; the options of its modules are in the stack file."
)
SERVICES: dict[str, tuple[str, Callable[[Any], Any]]] = {
    "list_parameters": ("ListParameters", lambda _: rcl.ListParameters_Response()),
    "get_parameters": (
        "GetParameters",
        lambda asked: rcl.GetParameters_Response([rcl.ParameterValue() for _ in asked.names]),
    ),
    "get_parameter_types": (
        "GetParameterTypes",
        lambda asked: rcl.GetParameterTypes_Response(np.zeros(len(asked.names), np.uint8)),
    ),
    "describe_parameters": (
        "DescribeParameters",
        lambda asked: rcl.DescribeParameters_Response([rcl.ParameterDescriptor(n) for n in asked.names]),
    ),
    "set_parameters": ("SetParameters", lambda asked: rcl.SetParameters_Response([REFUSED for _ in asked.parameters])),
    "set_parameters_atomically": ("SetParametersAtomically", lambda _: rcl.SetParametersAtomically_Response(REFUSED)),
}
"""Name within the node, short type name, and what answers."""
