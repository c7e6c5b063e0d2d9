"""The paper's `C-VS`: centroid grasp whose target is followed by the palm camera while the hand comes down.

Not look-and-move (their 75 s): every frame updates a Kalman filter on the object's position in odom, and the gripper
goes to the filtered position at the arm's rate. Errors of the head camera, of its calibration and of the joint
encoders drop out, because camera and gripper sit on the same hand. For the same reason the hand is turned until it
faces the plate squarely: tilt that the encoders do not know of shows in the plate's depth.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from golem.capabilities.grasping.base import Grasp, Gripper, ServoLaw, ServoStatus, ServoStep
from golem.capabilities.grasping.centroid import UP, Centroid, CentroidConfig, grasp_depth, grasp_pose
from golem.capabilities.grasping.object_cloud import ground_plane
from golem.types import Array, LocalizedObject


@dataclass(frozen=True)
class ServoLawConfig:
    """Noise, gates and patience of the loop.

    Attributes:
        normal_gain: share of a frame's ground normal that is taken over; 0 keeps the vertical.
        drift: how fast the object may wander in odom, by base sway and encoder error [m/sqrt(s)].
        sigma_lateral: standard deviation of one sighting across the optical axis [m].
        sigma_depth: the same along the axis, at close range [m].
        gate: squared Mahalanobis distance beyond which a sighting is another object (chi2, 3 dof, p = 0.999).
        first_score: least score of a first sighting; one that is where the object is expected may be doubtful.
        first_radius: how far from where the hand began the first sighting may be [m]: one pitch of the screws and half
            of one.
        first_height: how far above or below where the head camera saw the object that may be [m].
        left_radius: what is seen this near to an object that was left is that, and its neighbours are as high [m].
        confirm: sightings needed before the hand leaves its stand-off.
        standoff: height above the grasp at which the hand centres itself [m].
        slope: metres of height the hand keeps per metre of lateral error beyond `tolerance`.
        tolerance: lateral error within which the fingers close [m].
        height_tolerance: error of height within which the fingers close [m].
        dwell: frames in a row within both tolerances before the fingers close.
        blind_after: time without a sighting after which a hand within both tolerances closes on what it remembers [s]:
            fingers and their shadow hide what is between them.
        blind_from: how near to the grasp the last sighting has to have been for that [m].
        lost_after: time without a sighting until the hand backs off [s].
        again_radius: how far from where it was the object may be when it is seen again [m]: less than half of the pitch
            of the screws.
        retreat: how far it backs off to see more [m].
        retreats: how often it may do so.
        loose_height: by label, height of the top above the ground from which on an object is loose [m]; the heads of
            this pack's screws are 5 to 7 mm high, and a loosened one shows 5 mm of its shank or more.
        looks: frames in which the ground was seen before an object is called tight.
        stall_after: time without progress until it gives up [s].
        progress: what counts as progress [m].
        patience: time until it is given up in any case [s].
    """

    normal_gain: float = 0.2
    drift: float = 0.003
    sigma_lateral: float = 0.002
    sigma_depth: float = 0.002
    gate: float = 16.3
    first_score: float = 0.3
    first_radius: float = 0.14
    first_height: float = 0.1
    left_radius: float = 0.035
    confirm: int = 3
    standoff: float = 0.07
    slope: float = 6.0
    tolerance: float = 0.003
    height_tolerance: float = 0.0025
    dwell: int = 3
    blind_after: float = 0.3
    blind_from: float = 0.035
    lost_after: float = 1.0
    again_radius: float = 0.04
    retreat: float = 0.05
    retreats: int = 2
    loose_height: Mapping[str, float] = field(default_factory=lambda: {"screw": 0.0085})
    looks: int = 8
    stall_after: float = 3.0
    progress: float = 0.003
    patience: float = 20.0


class CentroidServo:
    """Kalman filter on a resting object, and a funnel that trades height against lateral error; see `ServoLaw`."""

    def __init__(
        self, config: ServoLawConfig, centroid: CentroidConfig, target: LocalizedObject, yaw: float, t: float
    ) -> None:
        """Start at time `t` [s] from the `target` as the head camera saw it; `yaw` is of the gripper's x axis [rad]."""
        self.label, self.patience = target.label, config.patience
        self._config = config
        self._centroid = centroid
        self._x = np.array(target.position, dtype=float)
        self._variance: Array = np.full(3, config.first_radius**2)
        self._depth = centroid.depth
        self._normal: Array = UP
        self._heights: list[float] = []
        self._yaw = yaw
        self._t = t
        self._seen_at = t
        self._sightings = 0
        self._found, self._seen_from = False, np.inf
        self._start: Array | None = None
        self._left: list[Array] = []
        self._left_as = ServoStatus.LOST
        self._retreats = 0
        self._inside = 0
        self._lift = 0.0
        self._best = np.inf
        self._best_at = t

    def step(self, t: float, sightings: list[LocalizedObject] | None, T_odom_gripper: Array) -> ServoStep:
        c = self._config
        start = self._start = T_odom_gripper[:2, 3].copy() if self._start is None else self._start
        self._variance = self._variance + c.drift**2 * (t - self._t)
        self._t = t
        seen = sightings is not None and self._update(t, sightings, start)
        status = ServoStatus.TRACKING
        if t - self._seen_at > c.lost_after:
            self._retreats += 1
            self._look_again(t)
            if self._retreats > c.retreats:
                status = ServoStatus.LOST if self._found else self._left_as

        grasp = self._x - self._depth * self._normal
        offset = T_odom_gripper[:3, 3] - grasp
        height = float(offset @ self._normal)
        lateral = float(np.linalg.norm(offset - height * self._normal))
        error = lateral + abs(height)
        confirmed, sigma = self._sightings >= c.confirm, float(np.sqrt(self._variance.max()))
        if status is ServoStatus.TRACKING and confirmed:
            self._found, there = True, lateral <= c.tolerance and abs(height) <= c.height_tolerance
            self._inside = self._inside + seen if there else 0
            self._seen_from = error if seen else self._seen_from
            blind = there and t - self._seen_at > c.blind_after and self._seen_from < c.blind_from
            if blind or self._inside >= c.dwell:
                status = ServoStatus.CONVERGED
            if self._is_tight():
                status = self._leave(t, start, ServoStatus.TIGHT)
            if error < self._best - c.progress:
                self._best, self._best_at = error, t
            elif t - self._best_at > c.stall_after and status is ServoStatus.TRACKING:
                status = self._leave(t, start, ServoStatus.STALLED)
        else:
            self._best, self._best_at = np.inf, t

        funnel = float(np.clip(c.slope * (lateral - c.tolerance), 0.0, c.standoff))
        above = funnel if confirmed else c.standoff + self._lift
        goal = grasp_pose(grasp + above * self._normal, self._yaw, self._normal)
        return ServoStep(goal, self._x.copy(), sigma, status)

    def _update(self, t: float, sightings: list[LocalizedObject], start: Array) -> bool:
        """Fuse the target's sighting; return whether the frame has one. The hand began at `start` (2,) in odom [m]."""
        c = self._config
        candidates = [s for s in sightings if s.label == self.label]
        if not candidates:
            return False
        noise = np.array([c.sigma_lateral**2, c.sigma_lateral**2, c.sigma_depth**2])
        if self._sightings == 0:
            # The head camera may be off by as much as the pitch of the screws: take what is under the hand, and from it
            # go on to its neighbours. What was lost meanwhile is where it was; its neighbours are others.
            middle, radius = (self._x[:2], c.again_radius) if self._found else (start, c.first_radius)
            away = [float(np.linalg.norm(s.position[:2] - middle)) for s in candidates]
            least = 0.0 if self._found else c.first_score
            height = c.left_radius if self._left else c.first_height
            near = [
                k
                for k, s in enumerate(candidates)
                if away[k] <= radius
                and abs(s.position[2] - self._x[2]) <= height
                and s.detection.score >= least
                and not any(np.linalg.norm(s.position[:2] - x) < self._config.left_radius for x in self._left)
            ]
            if not near:
                return False
            nearest = candidates[min(near, key=lambda k: away[k])]
            self._x, self._variance = nearest.position.copy(), noise
            self._depth = self._wanted_depth(nearest)
        else:
            total = self._variance + noise
            distances = [float(np.sum((s.position - self._x) ** 2 / total)) for s in candidates]
            best = int(np.argmin(distances))
            if distances[best] > c.gate:
                return False
            gain = self._variance / total
            self._x = self._x + gain * (candidates[best].position - self._x)
            self._variance = (1.0 - gain) * self._variance
            # The ground gets clearer as the hand comes closer; the same gain as the height follows it.
            self._depth += float(gain[2]) * (self._wanted_depth(candidates[best]) - self._depth)
            self._turn(candidates[best])
        self._sightings += 1
        self._seen_at = t
        return True

    def _turn(self, sighting: LocalizedObject) -> None:
        """Turn the approach towards the ground's normal: a hand that comes in askew jams the screw it pulls."""
        plane = ground_plane(sighting)
        if plane is not None:
            normal, height = plane
            self._heights.append(height)
            mixed = self._normal + self._config.normal_gain * (normal - self._normal)
            self._normal = mixed / np.linalg.norm(mixed)

    def _look_again(self, t: float) -> None:
        self._seen_at, self._sightings = t, 0
        self._lift = self._config.retreat * self._retreats
        self._variance = np.full(3, self._config.first_radius**2)

    def _leave(self, t: float, start: Array, status: ServoStatus) -> ServoStatus:
        """Leave an object for its neighbour, from above `start`; `status` is said if there is none."""
        self._left.append(self._x[:2].copy())
        self._left_as = status
        self._found, self._heights = False, []
        self._x[:2], self._normal = start, UP
        self._retreats = max(self._config.retreats - 1, 0)
        self._look_again(t)
        return ServoStatus.TRACKING

    def _is_tight(self) -> bool:
        """Return whether the object stands as low as one that is screwed down, by the last looks at the ground."""
        loose = self._config.loose_height.get(self.label)
        recent = self._heights[-self._config.looks :]
        return loose is not None and len(recent) == self._config.looks and float(np.median(recent)) < loose

    def _wanted_depth(self, sighting: LocalizedObject) -> float:
        return grasp_depth(sighting, self._centroid.depth, self._centroid.clearance)


@dataclass(frozen=True)
class VisualServoConfig:
    """Options of `VisualServo`.

    Attributes:
        centroid: where around the object the fingers close.
        servo: noise, gates and patience of the loop.
    """

    centroid: CentroidConfig = field(default_factory=CentroidConfig)
    servo: ServoLawConfig = field(default_factory=ServoLawConfig)


class VisualServo:
    """Centroid grasp, refined by the palm camera at image rate; see `GraspMethod`."""

    latency = Centroid.latency

    def __init__(self, config: VisualServoConfig | None = None) -> None:
        self.config = config or VisualServoConfig()
        self._coarse = Centroid(self.config.centroid)

    def propose(self, target: LocalizedObject, scene: Array, gripper: Gripper) -> list[Grasp]:
        return self._coarse.propose(target, scene, gripper)

    def servo(self, target: LocalizedObject, grasp: Grasp, t: float) -> ServoLaw:
        x_axis = grasp.T_odom_gripper[:3, 0]
        yaw = float(np.arctan2(x_axis[1], x_axis[0]))
        return CentroidServo(self.config.servo, self.config.centroid, target, yaw, t)
