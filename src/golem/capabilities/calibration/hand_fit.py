"""Fits the mount of a palm camera to views of the tags on the other hand.

As the fit of the head camera (see `kinematic_fit`), with a chain that runs through both arms: what the arms' zeros are
still off by is found with it, so far as the views tell, and counts in the covariance.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from golem.capabilities.arms.postures import posture
from golem.capabilities.calibration import view_postures
from golem.capabilities.calibration.kinematic_fit import ARM, CUFF, VIEWS, TagView, ViewProblem, pose, solve
from golem.errors import ConfigError
from golem.hardware.safety.base import SafetyLimits
from golem.robots.model.magpie_model import T_HAND_CAMERA, cuff_tags, hand_name
from golem.robots.model.pinocchio_model import Kinematics
from golem.robots.sensors.calibration import Calibration
from golem.robots.sensors.cameras import CAMERAS
from golem.types import SIDES, UPPER, Array, CameraInfo, Side

MOUNT = (0.02, 0.005)
"""Prior of a palm camera's mount, rotation [rad] and translation [m]."""
OTHER: dict[Side, Side] = {"left": "right", "right": "left"}


def fit_hand(views: Sequence[TagView], camera: Side, info: CameraInfo, zero: float) -> Calibration:
    """Return the calibration of one palm camera that explains the views best; joints are left alone.

    Args:
        camera: the side whose hand carries the camera.
        zero: standard deviation of what the arms' zeros are off by [rad].

    Raises:
        ConfigError: too few views, or they are at odds.
    """
    if len(views) < VIEWS:
        raise ConfigError(
            f"The {camera} palm camera saw the {OTHER[camera]} hand's tags in {len(views)} postures; {VIEWS} are the "
            "least."
        )
    problem = _HandProblem(views, camera, info, zero)
    x, covariance, residual = solve(problem)
    name = f"{camera}_hand"
    return Calibration(
        cameras={name: pose(x[:6])}, covariances={name: covariance[:6, :6]}, residual=residual, views=problem.count
    )


def hand_information(camera: Side, q: Array, tags: Sequence[int], zero: float) -> Array:
    """Return what a view would tell of mount, zeros and cuff, (26, 26), in units of their priors; see `fit_hand`.

    The joints are at `q` (27,) [rad], and those `tags` of the other hand are seen.
    """
    view = TagView(OTHER[camera], q, dict.fromkeys(tags, np.zeros((4, 2))))
    return _HandProblem([view], camera, CAMERAS[f"{camera}_hand"], zero).information()


class _HandProblem(ViewProblem):
    """The unknowns: mount (rotation vector, translation), left arm's zeros, right arm's, pose of the cuff seen."""

    def __init__(self, views: Sequence[TagView], camera: Side, info: CameraInfo, zero: float) -> None:
        super().__init__(views, info)
        self._camera: Side = camera
        self._tags = cuff_tags(OTHER[camera])
        self.scale = np.concatenate([np.repeat(MOUNT, 3), np.full(14, zero), np.repeat(CUFF, 3)])

    def pixels(self, x: Array) -> Array:
        """Return predicted minus seen corners [px]."""
        mount, cuff = T_HAND_CAMERA @ pose(x[:6]), pose(x[20:26])
        errors: list[Array] = []
        for view in self.views:
            q = view.q.copy()
            for k, side in enumerate(SIDES):
                q[ARM[side]] -= x[6 + 7 * k : 13 + 7 * k]
            self._kinematics.update(q)
            T_base_camera = self._kinematics.pose(hand_name(self._camera)) @ mount
            T = np.linalg.solve(T_base_camera, self._kinematics.pose(hand_name(OTHER[self._camera]))) @ cuff
            errors += self._errors(view, T, self._tags)
        return np.concatenate(errors)


MARGIN = 35.0
"""How far inside the image the tag's middle has to be [px]."""
RANGE = (0.15, 0.38)
"""Distances of the tag from the camera [m]."""
SPARE = 0.05
"""Distance kept from the ends of the joints' ranges [rad]."""


def hand_view_postures(
    camera: Side,
    count: int,
    free: Callable[[Array], bool],
    spheres: Callable[[Array], Array],
    zero: float,
    seed: int = 0,
) -> list[Array]:
    """Return up to `count` postures (15,) of torso and arms that tell the most of the mount together.

    Args:
        camera: the side whose palm camera looks at the other hand.
        free: says of a posture whether it may be gone to.
        spheres: returns the (m, 4) spheres of the robot in a posture, centres in base_link and radii [m].
        zero: standard deviation of the arms' zeros [rad].
        seed: of the draws.
    """
    rng, limits = np.random.default_rng(seed), SafetyLimits.from_profile()
    lower, upper = limits.lower[UPPER] + SPARE, limits.upper[UPPER] - SPARE
    T_base_torso = Kinematics().pose("torso_link")
    found: list[tuple[Array, list[int]]] = []
    for _ in range(view_postures.DRAWS // view_postures.BATCH * len(SIDES)):
        Q = np.zeros((view_postures.BATCH, len(lower)))
        for side in SIDES:
            part = view_postures.ARM[side]
            drawn = posture(f"ready_{side}")[part] + view_postures.SPREAD * rng.uniform(
                -1.0, 1.0, (view_postures.BATCH, 7)
            )
            Q[:, part] = np.clip(drawn, lower[part], upper[part])
        eyes = T_base_torso @ view_postures.hand_poses(camera, Q[:, view_postures.ARM[camera]]) @ T_HAND_CAMERA
        hands = T_base_torso @ view_postures.hand_poses(OTHER[camera], Q[:, view_postures.ARM[OTHER[camera]]])
        inverse = np.linalg.inv(eyes)
        poses = {n: inverse @ hands @ T for n, T in cuff_tags(OTHER[camera]).items()}
        seen = {n: view_postures.visible(CAMERAS[f"{camera}_hand"], T, MARGIN, RANGE) for n, T in poses.items()}
        for i in np.flatnonzero(np.any(list(seen.values()), axis=0)):
            if not free(Q[i]):
                continue
            around = spheres(Q[i])
            tags = [
                n
                for n, T in cuff_tags(OTHER[camera]).items()
                if seen[n][i] and not view_postures.hidden(eyes[i][:3, 3], (hands[i] @ T)[:3, 3], around)
            ]
            if tags:
                found.append((Q[i], tags))
        if len(found) >= view_postures.CANDIDATES:
            break
    return view_postures.telling(found, lambda q, tags: hand_information(camera, q, tags, zero), count)
