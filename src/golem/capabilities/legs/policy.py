"""Lower body driven by any policy network whose description lies beside it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from golem.capabilities.legs.base import LocomotionCommand
from golem.capabilities.legs.description import JOINTS, load_description
from golem.capabilities.legs.network import load_network
from golem.capabilities.legs.swing import swing_legs
from golem.errors import GolemError
from golem.interfaces.payloads import LegCommand
from golem.kernels import njit
from golem.types import LEGS, Array, BaseEstimate, LowState


class BadAction(GolemError):
    """A policy network returned something that is not finite."""


@njit(cache=True, nogil=True)
def _targets(
    action: Array,
    clip: float,
    scale: Array,
    phase: Array,
    period: float,
    stance: float,
    amplitude: float,
    lag: Array,
    out: Array,
) -> bool:
    """Clip `action` (12,) and add its part and that of the swing to the posture `out` (12,); False if not finite.

    Lengths, phases and gains are those of `swing_offset`.
    """
    swing = np.empty(len(out))
    swing_legs(phase, period, stance, amplitude, lag, swing)
    for i in range(len(out)):
        if action[i] - action[i] != 0.0:
            return False
        action[i] = min(max(action[i], -clip), clip)
        out[i] = out[i] + scale[i] * action[i] + swing[i]
    return True


@dataclass(frozen=True, slots=True)
class PolicyConfig:
    """Options of `Policy`.

    Attributes:
        file: path of the description (YAML), or the name of a shipped one.
        network: path of the network (.onnx or .pt); the one that the description names, beside it, if absent.
    """

    file: str
    network: str | None = None


class Policy:
    """Runs a network on the observation its description lays out; its actions are offsets from a default posture.

    Joint targets are q0 + scale * clip(action) + swing; there is no feed-forward torque.

    Attributes:
        rate, latency, envelope, gait: see `LowerBody`.
    """

    def __init__(self, config: PolicyConfig) -> None:
        """Load description and network.

        Raises:
            ConfigError: a file is absent or says something it cannot mean, or the two do not fit each other.
            MissingExtra: the network is a TorchScript file, and torch is not installed.
        """
        description, path = load_description(config.file, config.network)
        self.description = description
        self.rate = description.rate
        self.latency = description.latency
        self.envelope = description.envelope
        self.gait = description.gait
        self._layout = description.layout()
        self._network = load_network(path, self._layout.size)
        self._q0 = description.q0()[LEGS]
        self._scale = description.action_scale()
        self._kp, self._kd = description.gains()
        self._lag = self._kd / np.maximum(self._kp, 1e-6)
        self._action: Array = np.zeros(JOINTS)

    def reset(self, state: LowState) -> None:
        """Forget the last action and what the network remembers."""
        self._action = np.zeros(JOINTS)
        self._network.reset()

    def step(self, state: LowState, base: BaseEstimate, motion: LocomotionCommand, dt: float) -> LegCommand:
        """Run the network once; see `LowerBody.step`.

        Raises:
            BadAction: the network returned NaN or infinity.
        """
        observation = self._layout.look(state, base, motion, self._action)
        action = self._network(observation.astype(np.float32)).astype(np.float64)
        q, own, gait = self._q0.copy(), self.description.action, self.gait
        finite = _targets(
            action, own.clip, self._scale, motion.phase, gait.period, gait.stance, own.swing, self._lag, q
        )
        if not finite:
            culprit = np.flatnonzero(~np.isfinite(observation))
            cause = f"; it was shown {self._layout.components[culprit[0]]} that is not finite" if len(culprit) else ""
            raise BadAction(f"The network's action is not finite{cause}.")
        self._action = action
        return LegCommand(q, self._kp.copy(), self._kd.copy(), np.zeros(JOINTS))
