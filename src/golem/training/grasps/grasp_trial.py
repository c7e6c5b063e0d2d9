"""One simulated grasp: come, close softly, close, lift, shake; held or not."""

from __future__ import annotations

from collections.abc import Iterable

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from golem.robots.model import magpie_model
from golem.robots.model.spatial import quat_of
from golem.robots.mujoco.hand_servos import HandServos
from golem.training.grasps.ware_scene import LEADER, SIDE, STEP, WARE, WRIST
from golem.types import Array, HandCommand

BEFORE, SPARE = 0.12, 0.024
"""Distance from which the hand comes, and how much wider it is open than the grasp asks for [m]; as in `take`."""
COMES, CLOSES, HOLDS, RISES, SHAKES = 0.4, 0.9, 0.5, 0.5, 0.8
"""How long each part takes [s]."""
TOUCH, FORCE = 1.0, 16.0
"""Force of each finger until both touch, and then [N]; as `take` has them."""
LIFT = 0.10
"""How high the hand lifts [m]."""
SWING, TILT, RATE = 0.012, 0.12, 3.0
"""The shake: amplitude [m], [rad], and rate [Hz]: 0.4 g, more than any motion of the arm."""
SLIPPED, TURNED = 0.025, 0.5
"""How far a ware that is held may have moved in the hand [m], [rad]."""
T_WRIST_GRIPPER: Array = magpie_model.T_WRIST_HAND @ magpie_model.T_HAND_GRIPPER


class GraspTrial:
    """Tries grasps on one ware, each from the same start."""

    def __init__(self, model: mujoco.MjModel) -> None:
        """Let the ware of `model` come to rest."""
        self.model, self.data = model, mujoco.MjData(model)
        self._leader = int(model.body(LEADER).mocapid[0])
        self._ware, self._wrist = model.body(WARE).id, model.body(WRIST).id
        self._wrist_q = int(model.joint(WRIST).qposadr[0])
        self._servos = HandServos(model, SIDE)
        far = np.eye(4)
        far[2, 3] = 1.0
        self._put(far, 0.08)
        for _ in range(200):
            mujoco.mj_step(model, self.data)
        self._start = self.data.qpos.copy()

    def held(self, T: Array, gap: float) -> bool:
        """Return whether a hand that closes at `T` (4, 4), the grasp frame, lifts the ware and keeps it.

        Args:
            T: pose of the grasp frame in the world.
            gap: opening that the grasp asks for [m].
        """
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:] = self._start
        wide = min(gap + SPARE, magpie_model.MAX_GAP)
        before, above = T.copy(), T.copy()
        before[:3, 3] -= BEFORE * T[:3, 2]
        above[2, 3] += LIFT
        self._put(before, wide)
        self._lead(_line(before, T, COMES), wide, magpie_model.MAX_FORCE)
        self._lead(_still(T, CLOSES), 0.0, TOUCH)
        self._lead(_still(T, HOLDS), 0.0, FORCE)
        first = self._in_hand()
        self._lead(_line(T, above, RISES), 0.0, FORCE)
        self._lead(_shaken(above, SHAKES), 0.0, FORCE)
        last = self._in_hand()
        moved = float(np.linalg.norm(last[:3, 3] - first[:3, 3]))
        turned = Rotation.from_matrix(first[:3, :3].T @ last[:3, :3]).magnitude()
        return moved < SLIPPED and float(turned) < TURNED

    def _put(self, T: Array, gap: float) -> None:
        """Place hand and leader with the grasp frame at `T`, the fingers open by `gap`."""
        wrist = T @ np.linalg.inv(T_WRIST_GRIPPER)
        self.data.qpos[self._wrist_q : self._wrist_q + 7] = [*wrist[:3, 3], *quat_of(wrist[:3, :3])]
        self._servos.reset(self.data, gap)
        self._aim(T)
        mujoco.mj_forward(self.model, self.data)

    def _aim(self, T: Array) -> None:
        wrist = T @ np.linalg.inv(T_WRIST_GRIPPER)
        self.data.mocap_pos[self._leader] = wrist[:3, 3]
        self.data.mocap_quat[self._leader] = quat_of(wrist[:3, :3])

    def _lead(self, poses: Iterable[Array], gap: float, force: float) -> None:
        command = HandCommand(t=0.0, gap=gap, force=force)
        for T in poses:
            self._aim(T)
            self._servos.command(command, STEP)
            self._servos.drive(self.data)
            mujoco.mj_step(self.model, self.data)

    def _in_hand(self) -> Array:
        """Return the (4, 4) pose of the ware's centre of mass in the wrist."""
        R = self.data.xmat[self._wrist].reshape(3, 3)
        T = np.eye(4)
        T[:3, :3] = R.T @ self.data.xmat[self._ware].reshape(3, 3)
        T[:3, 3] = R.T @ (self.data.xipos[self._ware] - self.data.xpos[self._wrist])
        return T


def _line(start: Array, end: Array, seconds: float) -> Iterable[Array]:
    """Yield poses that go smoothly from one place to another."""
    for s in np.linspace(0.0, 1.0, round(seconds / STEP)):
        T = end.copy()
        T[:3, 3] += (1.0 - s * s * (3.0 - 2.0 * s)) * (start - end)[:3, 3]
        yield T


def _still(T: Array, seconds: float) -> Iterable[Array]:
    """Yield the same pose."""
    for _ in range(round(seconds / STEP)):
        yield T


def _shaken(T: Array, seconds: float) -> Iterable[Array]:
    """Yield poses that swing sideways, and tilt."""
    for k in range(round(seconds / STEP)):
        phase = 2.0 * np.pi * RATE * k * STEP
        swung = T.copy()
        swung[:3, :3] = Rotation.from_rotvec([0.0, TILT * np.sin(phase), 0.0]).as_matrix() @ T[:3, :3]
        swung[:3, 3] += SWING * np.array([np.sin(phase), np.sin(0.5 * phase), 0.0])
        yield swung
