"""Fits the head camera's mount and the zeros of the arms' encoders to views of tags on the hands.

Least squares over the corners' pixels, weighed by their noise, with priors on every unknown (the maximum a posteriori
estimate of a kinematic calibration; e.g. Hollerbach, Khalil, Gautier: "Model identification", Springer Handbook of
Robotics). Both hands are needed: a turn of the camera about an arm's first axis looks like a wrong zero of that axis,
and only the other arm, whose axis leans the other way, tells them apart. The torso carries camera and arms, so its
zero plays no part.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from golem.errors import ConfigError
from golem.robots.model.magpie_model import cuff_tags, hand_name, tag_corners
from golem.robots.model.pinocchio_model import Kinematics
from golem.robots.model.spatial import transform
from golem.robots.model.table import T_TORSO_HEAD_OPTICAL
from golem.robots.sensors.calibration import Calibration
from golem.robots.sensors.cameras import HEAD, project
from golem.types import NUM_JOINTS, SIDES, Array, CameraInfo, Side

PIXEL = 0.4
"""Noise of a corner [px]."""
MOUNT = (0.05, 0.05)
"""Prior of the camera's mount, rotation [rad] and translation [m]."""
ZERO = 0.05
"""Prior of an encoder's zero [rad]."""
CUFF = (0.003, 0.0005)
"""How well a cuff sits on its hand, rotation [rad] and translation [m]."""
STEP = 1e-5
"""Change of an unknown over which a derivative is taken [rad, m]."""
VIEWS = 6
"""Views of each hand that are the least to work with."""
OUTLIER = 3.0
"""Residuals, in `PIXEL`, from which a corner counts less at first; a tag that is as far off in the mean is left out."""
ARM = {"left": slice(13, 20), "right": slice(20, 27)}
"""Joints of each arm, in motor order."""


@dataclass(frozen=True, slots=True)
class TagView:
    """What the head camera saw of one hand in one posture.

    Attributes:
        side: which hand.
        q: (27,) joints as they were reported [rad].
        corners: (4, 2) of each tag seen [px], by its number.
    """

    side: Side
    q: Array
    corners: dict[int, Array]


def fit(views: Sequence[TagView], info: CameraInfo) -> Calibration:
    """Return the calibration that explains views of both hands best. Raises ConfigError: too few that agree."""
    for side in SIDES:
        n = sum(view.side == side for view in views)
        if n < VIEWS:
            raise ConfigError(f"The {side} hand's tags were seen in {n} postures; {VIEWS} are the least.")
    problem = _Problem(views, info)
    x, covariance, residual = solve(problem)
    offset = np.zeros(NUM_JOINTS)
    sigma = np.zeros(NUM_JOINTS)
    for k, side in enumerate(SIDES):
        part = slice(6 + 7 * k, 13 + 7 * k)
        offset[ARM[side]] = x[part]
        sigma[ARM[side]] = np.sqrt(np.diag(covariance)[part])
    return Calibration(
        cameras={"head": pose(x[:6])},
        covariances={"head": covariance[:6, :6]},
        joint_offset=offset,
        joint_sigma=sigma,
        residual=residual,
        views=problem.count,
    )


def information(side: Side, q: Array, tags: Sequence[int]) -> Array:
    """Return what a view would tell of mount, the arm's zeros and the cuff, (19, 19), in units of their priors.

    The joints are at `q` (27,) [rad], and those `tags` are seen.
    """
    problem = _Problem([TagView(side, q, dict.fromkeys(tags, np.zeros((4, 2))))], HEAD)
    k = SIDES.index(side)
    columns = (*range(6), *range(6 + 7 * k, 13 + 7 * k), *range(20 + 6 * k, 26 + 6 * k))
    return problem.information()[np.ix_(columns, columns)]


class ViewProblem(ABC):
    """Unknowns that explain views, each with a prior about zero, whose standard deviations are `scale`."""

    scale: Array

    def __init__(self, views: Sequence[TagView], info: CameraInfo) -> None:
        self.views, self._info, self._kinematics = list(views), info, Kinematics()
        self._corners = np.column_stack([tag_corners(), np.ones(4)])

    @abstractmethod
    def pixels(self, x: Array) -> Array:
        """Return predicted minus seen corners [px]."""

    def _errors(self, view: TagView, T_camera_hand: Array, tags: Mapping[int, Array]) -> list[Array]:
        """Return the same of the tags of one view, on a hand at `T_camera_hand` (4, 4)."""
        seen_at = ((T_camera_hand @ tags[number] @ self._corners.T).T[:, :3] for number in view.corners)
        return [(project(self._info, p) - c).ravel() for p, c in zip(seen_at, view.corners.values(), strict=True)]

    @property
    def size(self) -> int:
        """How many unknowns there are."""
        return len(self.scale)

    @property
    def count(self) -> int:
        """How many views count."""
        return len(self.views)

    def residuals(self, x: Array) -> Array:
        """Return the corners' errors and the priors', each by its standard deviation."""
        return np.concatenate([self.pixels(x) / PIXEL, x / self.scale])

    def keep(self, x: Array) -> None:
        """Leave out the tags that `x` does not explain."""
        kept: list[TagView] = []
        for view in tuple(self.views):
            self.views = [view]
            errors = self.pixels(x).reshape(len(view.corners), 8)
            good = np.sqrt(np.mean(errors**2, axis=1)) < OUTLIER * PIXEL
            corners = {n: c for (n, c), ok in zip(view.corners.items(), good, strict=True) if ok}
            kept.append(replace(view, corners=corners))
        self.views = [view for view in kept if view.corners]

    def information(self) -> Array:
        """Return what the views tell of the unknowns without their priors, (n, n), in units of the priors."""
        here = self.pixels(np.zeros(self.size))
        J = np.empty((len(here), self.size))
        for column in range(self.size):
            x = np.zeros(self.size)
            x[column] = STEP
            J[:, column] = (self.pixels(x) - here) / STEP * (self.scale[column] / PIXEL)
        return J.T @ J


def solve(problem: ViewProblem) -> tuple[Array, Array, float]:
    """Return the likeliest unknowns (n,), their covariance (n, n), and the corners' error that is left, RMS [px].

    Tags that the unknowns do not explain are left out. Raises ConfigError: too few views of a hand are left.
    """
    shown = {view.side for view in problem.views}
    start = np.zeros(problem.size)
    rough = least_squares(problem.residuals, start, loss="cauchy", f_scale=OUTLIER, x_scale=problem.scale)
    # A tag that is partly hidden has corners where it has none.
    problem.keep(rough.x)
    for side in sorted(shown):
        if (n := sum(view.side == side for view in problem.views)) < VIEWS:
            raise ConfigError(
                f"Only {n} views of the {side} hand's tags agree with each other; {VIEWS} are the least: check that "
                "its cuff sits as in the model, and that the camera is the one that its profile says."
            )
    found = least_squares(problem.residuals, rough.x, x_scale=problem.scale)
    return found.x, np.linalg.inv(found.jac.T @ found.jac), float(np.sqrt(np.mean(problem.pixels(found.x) ** 2)))


class _Problem(ViewProblem):
    """The unknowns: mount (rotation vector, translation), left arm's zeros, right arm's, left cuff's pose, right's."""

    def __init__(self, views: Sequence[TagView], info: CameraInfo) -> None:
        super().__init__(views, info)
        self._tags = {side: cuff_tags(side) for side in SIDES}
        mount = np.repeat(MOUNT, 3)
        cuff = np.repeat(CUFF, 3)
        self.scale = np.concatenate([mount, np.full(14, ZERO), cuff, cuff])

    def pixels(self, x: Array) -> Array:
        """Return predicted minus seen corners [px]."""
        T_optical_torso = np.linalg.inv(T_TORSO_HEAD_OPTICAL @ pose(x[:6]))
        errors: list[Array] = []
        for view in self.views:
            k = SIDES.index(view.side)
            q = view.q.copy()
            q[ARM[view.side]] -= x[6 + 7 * k : 13 + 7 * k]
            self._kinematics.update(q)
            T_base_torso = self._kinematics.pose("torso_link")
            T_base_hand = self._kinematics.pose(hand_name(view.side))
            T = T_optical_torso @ np.linalg.solve(T_base_torso, T_base_hand) @ pose(x[20 + 6 * k : 26 + 6 * k])
            errors += self._errors(view, T, self._tags[view.side])
        return np.concatenate(errors)


def pose(x: Array) -> Array:
    """Return the (4, 4) pose with rotation vector and translation `x` (6,)."""
    return transform(x[3:], Rotation.from_rotvec(x[:3]).as_matrix())
