"""Serves a checkpoint of LeRobot's, or any policy of a Python file, by OpenPI's protocol, so that GOLEM can use it.

It runs in the environment of the policy, with `msgpack`, `websockets` and `numpy`, and needs nothing of GOLEM's:

    python serve_policy.py lerobot FOLDER_OR_REPO --port 8000      # needs lerobot: 0.4.4, or 0.6.1 from Python 3.12 on
    python serve_policy.py my_policy.py:make --port 8000           # make() returns what has infer(observation)

On the robot: golem ladder --method '{use: policy, port: 8000, cameras: [right_hand], width: 160}'
"""

# pyright: reportMissingImports=false
from __future__ import annotations

import argparse
import importlib.util
import threading
import traceback
from typing import Any

import msgpack
import numpy as np
from websockets.sync.server import serve


def pack_array(value: object) -> object:
    """Return an array or a NumPy number as openpi_client.msgpack_numpy packs it."""
    if isinstance(value, np.ndarray):
        data = np.ascontiguousarray(value).tobytes()
        return {b"__ndarray__": True, b"data": data, b"dtype": value.dtype.str, b"shape": value.shape}
    if isinstance(value, np.generic):
        return {b"__npgeneric__": True, b"data": value.item(), b"dtype": value.dtype.str}
    raise TypeError(f"a {type(value).__name__} is not sent")


def unpack_array(value: dict[Any, Any]) -> object:
    """Return the array in a map of openpi_client.msgpack_numpy; any other map as it is."""
    if b"__ndarray__" in value:
        return np.frombuffer(value[b"data"], np.dtype(value[b"dtype"])).reshape(value[b"shape"])
    if b"__npgeneric__" in value:
        return np.dtype(value[b"dtype"]).type(value[b"data"])
    return value


class LeRobotPolicy:
    """A checkpoint of LeRobot's, with its own normalisation; one chunk per observation."""

    def __init__(self, name: str, device: str) -> None:
        """Load the checkpoint `name`, a folder or a repository."""
        import torch
        from lerobot.configs.policies import PreTrainedConfig
        from lerobot.policies.factory import get_policy_class, make_pre_post_processors

        config = PreTrainedConfig.from_pretrained(name)
        config.device = device
        self._torch, self._device = torch, device
        self._policy = get_policy_class(config.type).from_pretrained(name, config=config)
        self._policy.to(device).eval()
        override = {"device_processor": {"device": device}}
        self._before, self._after = make_pre_post_processors(config, name, preprocessor_overrides=override)

    def infer(self, observation: dict[str, Any]) -> Any:
        """Return the chunk (n, a) for an observation of numbers, pictures (h, w, 3) and a `prompt`."""
        torch, batch = self._torch, {"task": [str(observation.get("prompt", ""))]}
        for name, value in observation.items():
            if isinstance(value, np.ndarray):
                tensor = torch.from_numpy(np.array(value))[None]
                batch[name] = tensor.permute(0, 3, 1, 2).float() / 255.0 if value.dtype == np.uint8 else tensor.float()
        with torch.inference_mode():
            chunk = self._policy.predict_action_chunk(self._before(batch))
            return np.stack([self._after(action)[0].cpu().numpy() for action in chunk[0].split(1)])


def load(what: str, name: str, device: str) -> Any:
    """Return the policy that the command line names."""
    if what == "lerobot":
        return LeRobotPolicy(name, device)
    path, _, attribute = what.rpartition(":")
    spec = importlib.util.spec_from_file_location("served_policy", path)
    if spec is None or spec.loader is None:
        raise SystemExit(f"{what} reads FILE.py:NAME.")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return getattr(module, attribute)()


def main() -> None:
    """Serve until Ctrl-C, one observation at a time."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", help="lerobot, or FILE.py:NAME")
    parser.add_argument("name", nargs="?", default="", help="folder or repository of the checkpoint")
    parser.add_argument("--host", default="127.0.0.1", help="whoever reaches this address may use the policy")
    parser.add_argument("--port", type=int, default=8000)
    parser.add_argument("--device", default="cpu")
    given = parser.parse_args()
    policy, turn = load(given.what, given.name, given.device), threading.Lock()

    def handle(connection: Any) -> None:
        connection.send(msgpack.packb({"policy": given.name or given.what}))
        for raw in connection:
            try:
                seen = msgpack.unpackb(raw, object_hook=unpack_array, strict_map_key=False)
                with turn:
                    actions = np.asarray(policy.infer(seen))
                connection.send(msgpack.packb({"actions": actions}, default=pack_array))
            except Exception:
                connection.send(traceback.format_exc())

    with serve(handle, given.host, given.port, compression=None, max_size=2**26) as server:
        port = server.socket.getsockname()[1]
        print(f"Serving at ws://{given.host}:{port}.", flush=True)
        try:
            server.serve_forever()
        except KeyboardInterrupt:
            pass


if __name__ == "__main__":
    main()
