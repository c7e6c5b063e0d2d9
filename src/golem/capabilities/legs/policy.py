"""Lower body driven by any policy network, with a description of ours beside it or as its trainer wrote it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from golem.capabilities.legs.base import LocomotionCommand
from golem.capabilities.legs.description import JOINTS, Description
from golem.capabilities.legs.gait import swing_legs
from golem.capabilities.legs.network import Network, load_network
from golem.capabilities.legs.passports.onnx_metadata import said_joints
from golem.capabilities.legs.passports.read import read_passport
from golem.errors import ConfigError, GolemError
from golem.interfaces.payloads import LegCommand
from golem.kernels import njit
from golem.robots.model.table import JOINT_NAMES
from golem.types import LEGS, NUM_JOINTS, Array, BaseEstimate, LowState


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
        file: what its trainer wrote (see `passports`): ours or another description (YAML), a network with metadata
            (.onnx), a known one (.pt); or the name of a shipped description.
        network: path of the network (.onnx or .pt); the one that the description names, beside it, if absent.
    """

    file: str
    network: str | None = None


class Policy:
    """Runs a network on the observation its description lays out; its actions are offsets from a default posture.

    Joint targets are q0 + scale * clip(action) + swing; there is no feed-forward torque.
    """

    def __init__(self, config: PolicyConfig) -> None:
        """Load description and network. Raises MissingExtra: a network of TorchScript needs torch, which is absent.

        Raises ConfigError: a file is absent or says something it cannot mean, or the two do not fit each other.
        """
        passport = read_passport(config.file, config.network)
        description, path = passport.description, passport.network
        network = load_network(path, description.layout().size, len(description.outputs()))
        said = said_joints(path)
        if said and said != (description.joints or JOINT_NAMES[LEGS]):
            raise ConfigError(
                f"The metadata of {path} name its joints in another order than {config.file}; write there 'joints: "
                f"[{', '.join(said[:3])}, ...]', as the network has them."
            )
        self._follow(description, network)

    @classmethod
    def of(cls, description: Description, network: Network) -> Policy:
        """Return the policy that runs `network` as `description` says. Raises ConfigError: that cannot be meant."""
        policy = cls.__new__(cls)
        policy._follow(description, network)
        return policy

    def _follow(self, description: Description, network: Network) -> None:
        self.description = description
        self.rate = description.rate
        self.latency = description.latency
        self.envelope = description.envelope
        self.gait = description.gait
        self._layout = description.layout()
        self._network = network
        self._outputs = outputs = description.outputs()
        self._plain = len(outputs) == JOINTS and bool((outputs == np.arange(JOINTS)).all())
        self._q0 = description.q0()[LEGS]
        self._scale = description.action_scale()
        self._kp, self._kd = description.gains()
        self._lag = self._kd / np.maximum(self._kp, 1e-6)
        self._bounds = np.array(description.action.targets)
        self._action: Array = np.zeros(NUM_JOINTS)

    def reset(self, state: LowState) -> None:
        """Forget the last action, past ticks, and what the network remembers."""
        self._action = np.zeros(NUM_JOINTS)
        self._layout.reset()
        self._network.reset()

    def step(self, state: LowState, base: BaseEstimate, motion: LocomotionCommand, dt: float) -> LegCommand:
        """Run the network once; see `LowerBody.step`. Raises BadAction: the network returned NaN or infinity."""
        observation = self._layout.look(state, base, motion, self._action)
        action = self._network(observation.astype(np.float32)).astype(np.float64)
        q, own, gait = self._q0.copy(), self.description.action, self.gait
        moved = action
        if not self._plain:
            action = np.zeros(NUM_JOINTS)
            action[self._outputs] = np.clip(moved, -own.clip, own.clip)
            moved = action[LEGS]
        finite = _targets(moved, own.clip, self._scale, motion.phase, gait.period, gait.stance, own.swing, self._lag, q)
        if not finite:
            culprit = np.flatnonzero(~np.isfinite(observation))
            cause = f"; it was shown {self._layout.components[culprit[0]]} that is not finite" if len(culprit) else ""
            raise BadAction(f"The network's action is not finite{cause}.")
        self._action = action
        if len(self._bounds):
            q = np.clip(q, self._bounds[:, 0], self._bounds[:, 1])
        return LegCommand(q, self._kp.copy(), self._kd.copy(), np.zeros(JOINTS))
