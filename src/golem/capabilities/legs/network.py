"""Networks from files: one observation in, actions out, on one thread."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import onnxruntime
from numpy.typing import NDArray

from golem.errors import ConfigError, needs

Float32 = NDArray[np.float32]
ACTIONS = 12
"""Outputs of a leg policy, one per motor of the legs; some move more."""


class Network(Protocol):
    """A policy network. It may remember what it saw since the last `reset`."""

    def reset(self) -> None:
        """Forget everything."""

    def __call__(self, observation: Float32) -> Float32:
        """Return the (12,) action, or a longer one, for an observation (n,)."""
        ...


def load_network(path: Path, size: int, actions: int = ACTIONS) -> Network:
    """Return the network in `path`, which takes `size` values and returns `actions`.

    Raises:
        ConfigError: no such file, no such network, or it takes or returns something else.
        MissingExtra: it is a TorchScript file, and torch is not installed.
    """
    if path.suffix not in LOADERS:
        raise ConfigError(f"The network {path} ends in '{path.suffix}'; valid: {', '.join(LOADERS)}.")
    if not path.is_file():
        raise ConfigError(f"There is no network {path}; a policy's network lies beside its description.")
    return LOADERS[path.suffix](path, size, actions)


class OnnxNetwork:
    """A network run by onnxruntime: an input (1, n) or (n,), an output of actions.

    A recurrent one has an input more for each part of its state, and an output of the same shape, in the same order.
    See `Network`.
    """

    def __init__(self, path: Path, size: int, actions: int = ACTIONS) -> None:
        session = onnx_session(path)
        inputs, outputs = session.get_inputs(), session.get_outputs()
        states = [tuple(i.shape) for i in inputs[1:]]
        fixed = all(isinstance(n, int) for shape in states for n in shape)
        if not outputs or states != [tuple(o.shape) for o in outputs[1:]] or not fixed:
            raise ConfigError(
                f"The network {path} has {len(inputs)} inputs and {len(outputs)} outputs; a policy has one of each, or "
                "one more of both, of one fixed shape, for each part of its state."
            )
        width = inputs[0].shape[-1] if inputs[0].shape else None
        if isinstance(width, int) and width != size:
            raise _wrong_input(path, size, str(width))
        kinds = inputs[0].type, outputs[0].type
        if {*kinds, *(i.type for i in inputs[1:])} != {"tensor(float)"}:
            raise ConfigError(
                f"The network {path} takes {kinds[0]} and returns {kinds[1]}; a policy's are tensor(float)."
            )
        batched = len(inputs[0].shape) == 2
        self._session = session
        self._x: Float32 = np.zeros((1, size) if batched else size, dtype=np.float32)
        self._states = [np.zeros(shape, dtype=np.float32) for shape in states]
        self._after = [np.zeros(shape, dtype=np.float32) for shape in states]
        fed = dict(zip([i.name for i in inputs], [self._x, *self._states], strict=True))
        try:
            out = np.asarray(session.run(None, fed)[0])
        except Exception as error:  # onnxruntime's errors have no common base
            raise _wrong_input(path, size, str(inputs[0].shape)) from error
        self._y: Float32 = np.zeros(actions, dtype=np.float32)
        _check_output(path, out[0] if batched else out, actions)
        # All buffers stay where they are, so that a run converts and allocates nothing.
        self._binding = session.io_binding()
        for name, values in fed.items():
            self._binding.bind_cpu_input(name, values)
        for output, values in zip(outputs, [self._y.reshape(out.shape), *self._after], strict=True):
            self._binding.bind_output(output.name, "cpu", 0, np.float32, values.shape, values.ctypes.data)

    def reset(self) -> None:
        for state in self._states:
            state[...] = 0.0

    def __call__(self, observation: Float32) -> Float32:
        self._x[...] = observation
        self._session.run_with_iobinding(self._binding)
        for state, after in zip(self._states, self._after, strict=True):
            state[...] = after
        return self._y.copy()


def onnx_session(path: Path) -> onnxruntime.InferenceSession:
    """Return the network in `path`, to be run on one thread. Raises ConfigError: there is none."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    options.inter_op_num_threads = 1
    try:
        return onnxruntime.InferenceSession(path.read_bytes(), options, ["CPUExecutionProvider"])
    except Exception as error:  # onnxruntime's errors have no common base
        raise ConfigError(f"{path} is not an ONNX network that onnxruntime can load.") from error


class TorchScriptNetwork:
    """A TorchScript module that takes (1, n) and returns (1, 12), or more actions.

    A module with a memory of its own clears it in a method `reset_memory`; without one its buffers are put back to what
    they were in the file. Loading one sets torch to one thread for the whole process. See `Network`.
    """

    def __init__(self, path: Path, size: int, actions: int = ACTIONS) -> None:
        with needs("torch", "train"):
            import torch
        self._torch: Any = torch
        torch.set_num_threads(1)
        try:
            self._module: Any = torch.jit.load(str(path), map_location="cpu").eval()
        except RuntimeError as error:
            raise ConfigError(f"{path} is not a TorchScript module that torch can load.") from error
        self._forget: Callable[[], None] = getattr(self._module, "reset_memory", self._restore)
        self._buffers = {name: buffer.clone() for name, buffer in self._module.named_buffers()}
        try:
            out = self(np.zeros(size, dtype=np.float32))
        except RuntimeError as error:
            raise _wrong_input(path, size, _reason(error)) from error
        except (AttributeError, TypeError) as error:
            raise ConfigError(f"The network {path} does not return one tensor, as a policy does.") from error
        _check_output(path, out, actions)
        self.reset()

    def reset(self) -> None:
        self._forget()

    def __call__(self, observation: Float32) -> Float32:
        torch = self._torch
        with torch.no_grad():
            return self._module(torch.from_numpy(observation)[None]).numpy()[0]

    def _restore(self) -> None:
        """Put the buffers back to what they were in the file."""
        for name, buffer in self._module.named_buffers():
            buffer.copy_(self._buffers[name])


LOADERS: dict[str, Callable[[Path, int, int], Network]] = {".onnx": OnnxNetwork, ".pt": TorchScriptNetwork}
"""Which class reads a file, by its ending."""


def _wrong_input(path: Path, size: int, found: str) -> ConfigError:
    return ConfigError(f"The network {path} does not take the {size} values of the described observation: {found}.")


def _reason(error: RuntimeError) -> str:
    """Return the last line of what torch says, which names the shapes."""
    return str(error).strip().splitlines()[-1].removeprefix("RuntimeError: ")


def _check_output(path: Path, out: Float32, actions: int) -> None:
    if out.shape != (actions,):
        raise ConfigError(
            f"The network {path} returns {out.shape} for one observation; a leg policy returns ({actions},)."
        )
