"""unitree_go: what the robot's own estimator says of the base.

Members and types: unitree_sdk2_python, unitree_sdk2py/idl/unitree_go/msg/dds_.
"""

from __future__ import annotations

from golem.middleware.wire import hg
from golem.middleware.wire.struct_layout import Fields, StructLayout, structure

_IMU: Fields = {**hg.IMU, "temperature": (52, "u1")}
_PATH_POINT = structure(
    28, {name: (4 * i, "<f4") for i, name in enumerate(("t_from_start", "x", "y", "yaw", "vx", "vy", "vyaw"))}
)

SPORT_MODE_STATE = StructLayout(
    "unitree_go::msg::dds_::SportModeState_",
    512,
    {
        "sec": (0, "<i4"),
        "nanosec": (4, "<u4"),
        "error_code": (8, "<u4"),
        "imu": (12, structure(53, _IMU)),
        "mode": (65, "u1"),
        "progress": (68, "<f4"),
        "gait_type": (72, "u1"),
        "foot_raise_height": (76, "<f4"),
        "position": (80, ("<f4", 3)),
        "body_height": (92, "<f4"),
        "velocity": (96, ("<f4", 3)),
        "yaw_speed": (108, "<f4"),
        "range_obstacle": (112, ("<f4", 4)),
        "foot_force": (128, ("<i2", 4)),
        "foot_position_body": (136, ("<f4", 12)),
        "foot_speed_body": (184, ("<f4", 12)),
        "path_point": (232, (_PATH_POINT, 10)),
    },
)
