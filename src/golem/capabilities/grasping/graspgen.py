"""Client of a GraspGen server (Murali et al., NVlabs/GraspGen): 6-DOF grasps of a diffusion model on another machine.

The protocol is that of `grasp_gen/serving/zmq_server.py` (April 2026): msgpack maps over a ZeroMQ REP socket, arrays as
msgpack-numpy packs them. Weights and server are the user's; without one this method says so and proposes nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from golem.capabilities.grasping.antipodal import upright
from golem.capabilities.grasping.base import Grasp, Gripper, OpenLoop
from golem.capabilities.grasping.object_cloud import MIN_POINTS, object_points, thinned
from golem.errors import ServiceUnavailable, needs, shorten
from golem.finite import check_finite
from golem.options import require
from golem.types import Array, LocalizedObject

ROTATION = 0.01
"""Largest entry of R R^T - 1 of a pose that counts as a rotation: the server's numbers are single precision."""


@dataclass(frozen=True)
class GraspGenConfig:
    """Where the server is, and what its gripper is to ours.

    Attributes:
        host, port: address of the server.
        timeout: time that the server gets for an answer [s].
        grasps: how many the model draws.
        top: how many come back.
        tip: from the origin of the server's gripper to its fingertips, along z [m]: 0.195 for its Robotiq 2F-140,
            0.105 for its Franka hand.
        width: its opening [m]; ours arrives as wide, but no wider than it can.
        tilt: how far a grasp's approach may lean away from the wanted one [rad].
        points: points that are sent at most.
        latency: declared time of a proposal [s]; the paper of GraspGen has 20 proposals a second on its GPU.
    """

    host: str = "localhost"
    port: int = 5556
    timeout: float = 5.0
    grasps: int = 200
    top: int = 100
    tip: float = 0.195
    width: float = 0.136
    tilt: float = 0.8
    points: int = 4000
    latency: float = 0.10

    def __post_init__(self) -> None:
        require(
            "graspgen ",
            ("port", self.port, 0 < self.port < 65536, "from 1 to 65535"),
            ("timeout", self.timeout, 0.0 < self.timeout <= 600.0, "from 0 to 600 s"),
            ("grasps", self.grasps, 1 <= self.grasps <= 10000, "from 1 to 10000"),
        )


class GraspGen(OpenLoop):
    """Grasps of a GraspGen server, in the order of its confidences; see `GraspMethod`."""

    def __init__(self, config: GraspGenConfig | None = None) -> None:
        """Take the options; the server is asked when a grasp is. Raises MissingExtra: a package it needs is absent."""
        self.config = config or GraspGenConfig()
        self.latency = self.config.latency
        _packages()

    def propose(self, target: LocalizedObject, scene: Array, gripper: Gripper) -> list[Grasp]:
        """Return the server's grasps that come along the wanted approach; see `GraspMethod`.

        Raises ServiceUnavailable: the server is not there, takes too long, refuses, or answers nonsense.
        """
        check_finite("the object's position", target.position)
        c = self.config
        cloud = thinned(object_points(target.points, target.position), c.points)
        if len(cloud) < MIN_POINTS:
            return []
        request = {
            "action": "infer",
            "point_cloud": cloud.astype(np.float32),
            "num_grasps": c.grasps,
            "topk_num_grasps": c.top,
        }
        poses, scores = self._grasps(self.ask(request))
        T = upright(_in_our_frame(poses, c.tip), gripper.yaw)
        lean = np.arccos(np.clip(T[:, :3, 2] @ gripper.approach, -1.0, 1.0))
        gap = min(c.width, gripper.max_gap)
        order = [int(k) for k in np.argsort(-scores, kind="stable") if lean[k] <= c.tilt]
        return [Grasp(T[k], gap, float(scores[k])) for k in order]

    def ask(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """Return the answer to a request. Raises ServiceUnavailable: none in time, an error, or no map."""
        zmq, msgpack = _packages()
        c = self.config
        where = f"The GraspGen server at {c.host}:{c.port}"
        context = zmq.Context.instance()
        socket = context.socket(zmq.REQ)  # one per request: a server that died leaves no half-spoken dialogue
        try:
            socket.setsockopt(zmq.LINGER, 0)
            socket.connect(f"tcp://{c.host}:{c.port}")
            socket.send(msgpack.packb(dict(request), default=_pack_array, use_bin_type=True))
            if not socket.poll(int(1000 * c.timeout)):
                raise ServiceUnavailable(
                    f"{where} gave no answer within {c.timeout:g} s; start it (client-server/README.md of "
                    "NVlabs/GraspGen) or choose another grasp method, such as antipodal."
                )
            raw = socket.recv()
        except zmq.ZMQError as error:
            raise ServiceUnavailable(f"{where} cannot be reached: {error}.") from error
        finally:
            socket.close()
        try:
            answer = msgpack.unpackb(raw, object_hook=_unpack_array, raw=False, strict_map_key=False)
        except Exception as error:  # msgpack's errors have no common base
            raise ServiceUnavailable(f"{where} sent {len(raw)} bytes that are no msgpack.") from error
        if not isinstance(answer, dict):
            raise ServiceUnavailable(f"{where} sent a {type(answer).__name__}, not a map.")
        fields = cast("dict[str, Any]", answer)
        if "error" in fields:
            raise ServiceUnavailable(f"{where} refused: {shorten(str(fields['error']))}.")
        return fields

    def _grasps(self, answer: Mapping[str, Any]) -> tuple[Array, Array]:
        """Return poses (n, 4, 4) and confidences (n,) of an answer. Raises ServiceUnavailable: they are not there."""
        where = f"The GraspGen server at {self.config.host}:{self.config.port} sent"
        try:
            poses = np.asarray(answer["grasps"], np.float64)
            scores = np.asarray(answer["confidences"], np.float64)
        except (KeyError, TypeError, ValueError) as error:
            raise ServiceUnavailable(f"{where} no grasps: {shorten(str(error))}.") from error
        if poses.shape[1:] != (4, 4) or scores.shape != poses.shape[:1]:
            raise ServiceUnavailable(f"{where} grasps of shape {poses.shape} with {scores.shape} confidences.")
        if not (np.isfinite(poses).all() and np.isfinite(scores).all()):
            raise ServiceUnavailable(f"{where} grasps that are not finite.")
        R = poses[:, :3, :3]
        off = np.abs(R @ R.transpose(0, 2, 1) - np.eye(3))
        if len(poses) and (off.max() > ROTATION or (np.linalg.det(R) < 0.0).any()):
            raise ServiceUnavailable(f"{where} poses that are no rotations.")
        return poses, scores


def _in_our_frame(poses: Array, tip: float) -> Array:
    """Return GraspGen's poses (n, 4, 4), closing along x, as grasp frames at the fingertips, closing along y."""
    out = np.tile(np.eye(4), (len(poses), 1, 1))
    # Orthonormal in double precision, as our contract asks.
    z = poses[:, :3, 2] / np.linalg.norm(poses[:, :3, 2], axis=1, keepdims=True)
    y = poses[:, :3, 0] - np.einsum("ni,ni->n", poses[:, :3, 0], z)[:, None] * z
    y /= np.linalg.norm(y, axis=1, keepdims=True)
    out[:, :3, 0], out[:, :3, 1], out[:, :3, 2] = np.cross(y, z), y, z
    out[:, :3, 3] = poses[:, :3, 3] + tip * z
    return out


def _pack_array(value: object) -> object:
    if not isinstance(value, np.ndarray):
        raise TypeError(f"a {type(value).__name__} is not sent")
    data = np.ascontiguousarray(value)
    return {b"nd": True, b"type": data.dtype.str, b"kind": b"", b"shape": data.shape, b"data": data.tobytes()}


def _unpack_array(value: dict[Any, Any]) -> object:
    """Return the array that a map of msgpack-numpy holds, or another map as it is. Raises ValueError: it is damaged."""
    flag = value.get(b"nd", value.get("nd"))
    if flag is None:
        return value
    fields = {key.decode() if isinstance(key, bytes) else key: inner for key, inner in value.items()}
    kind = fields["type"]
    dtype = np.dtype(kind.decode() if isinstance(kind, bytes) else kind)
    if dtype.kind not in "fiub":
        raise ValueError(f"an array of {dtype}")
    if not flag:
        return np.frombuffer(fields["data"], dtype)[0]
    return np.frombuffer(fields["data"], dtype).reshape(fields["shape"])


def _packages() -> tuple[Any, Any]:
    with needs("", "graspgen"):
        import msgpack
        import zmq
    return zmq, msgpack
