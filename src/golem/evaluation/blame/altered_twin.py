"""The twin for trials in which a module is exchanged, and the modules that are fed with its truth."""

from __future__ import annotations

import weakref
from collections import deque
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from golem.capabilities.odometry.base import Source
from golem.capabilities.odometry.legs import Legs
from golem.errors import ConfigError
from golem.interfaces.lidar import LegOdometry
from golem.robots.model import magpie_model
from golem.robots.mujoco.config import MujocoConfig
from golem.robots.mujoco.engine import MujocoRobot
from golem.types import LEGS, SIDES, Array, BaseEstimate, LowState

KEPT = 100
"""Exposures whose state is kept: a frame is looked at within a second."""


@dataclass(frozen=True)
class AlteredConfig(MujocoConfig):
    """Options of the altered twin.

    Attributes:
        held: whether its hoist goes on to hold the pelvis of a robot that stands.
        grip: factor on the friction of the finger pads.
        leg_torque: factor on the torque that the leg motors can give.
    """

    held: bool = False
    grip: float = 1.0
    leg_torque: float = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (0.0 < self.grip <= 10.0 and 0.0 < self.leg_torque <= 10.0):
            raise ConfigError("The altered twin's grip and leg_torque are factors above 0 and up to 10.")


class AlteredTwin(MujocoRobot):
    """The twin, altered; see `AlteredConfig`.

    Attributes:
        exposures: time [s], (nq,) positions, and positions and orientations of the mocap bodies at each exposure.
    """

    _newest: ClassVar[weakref.ref[AlteredTwin] | None] = None

    def __init__(self, profile: str, seed: int, posture: Array, config: AlteredConfig | None = None) -> None:
        """Build it, and let modules of truth that are made from now on look into it; see `MujocoRobot`."""
        config = config or AlteredConfig()
        super().__init__(profile, seed, posture, config)
        self._held, self._let_go = config.held, False
        self.exposures: deque[tuple[float, Array, Array, Array]] = deque(maxlen=KEPT)
        for pad in (magpie_model.finger_names(side, f)[2] for side in SIDES for f in magpie_model.FINGERS):
            self._model.geom(pad).friction[0] *= config.grip
        self._memory["motors"]["limit"][..., LEGS] *= config.leg_torque
        AlteredTwin._newest = weakref.ref(self)

    @classmethod
    def newest(cls) -> AlteredTwin:
        """Return the one that was built last in this process, or raise a ConfigError."""
        twin = None if cls._newest is None else cls._newest()
        if twin is None:
            raise ConfigError("A module of truth needs the altered twin; name it by --use oracle=... on a rung.")
        return twin

    @property
    def on_gantry(self) -> bool:
        """Whether the robot stands in a band that is to be let go; one that is held says no when that was asked."""
        return super().on_gantry and not self._let_go

    def release(self) -> None:
        """Let the band go, or, where the pelvis is held, say so and hold it where it is now."""
        if not self._held:
            super().release()
        elif not self._let_go:
            self._let_go = True
            # Its feet must stay on the floor, or the estimator has none: the hoist carries half of the weight.
            self._memory["hoist"]["home"][..., :] = self.data.qpos[self._base.qposadr[0] :][:3]
            self._memory["hoist"]["weight"][..., :] *= 0.5

    def capture(self, camera: str) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """Expose one camera now, and keep what it really was exposed to; see `Robot`."""
        data = self.data
        self.exposures.append((data.time, data.qpos.copy(), data.mocap_pos.copy(), data.mocap_quat.copy()))
        return super().capture(camera)


class TrueBase:
    """A `BaseEstimator` that knows pose, velocity and contacts of the base."""

    def __init__(self) -> None:
        self._truth = AlteredTwin.newest().truth

    def reset(self, state: LowState) -> None:
        """Forget nothing."""

    def step(self, state: LowState, dt: float) -> BaseEstimate:
        return self._truth.estimate(state.t)


class TrueOdometry(Legs):
    """A `LidarOdometry` that knows where the base is."""

    sources: tuple[Source, ...] = ("imu", "legs", "scan")

    def __init__(self) -> None:
        super().__init__()
        self._truth = AlteredTwin.newest().truth

    def add_legs(self, legs: LegOdometry) -> None:
        """Take the waist from the legs, and the rest from the truth."""
        true = self._truth.estimate(legs.t)
        velocity = true.T_odom_base[:3, :3].T @ true.velocity
        super().add_legs(replace(legs, T_odom_base=true.T_odom_base, velocity=velocity, stale=False))
