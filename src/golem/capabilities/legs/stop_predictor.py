"""Where a robot that steps would come to rest: above its footprints, as it stood before it set off.

A body that walks or marks time sways over its feet and leans otherwise than one that stands; the feet stay where they
are when it stops. So a navigator that looks at the body stops it beside the goal, by 3 cm and some degrees.
"""

from __future__ import annotations

from golem.types import Array, PlanarPose

SMOOTHING = 0.7
"""Time constant of the filter on what is predicted [s]: a period of the gait."""
STOOD = 0.5
"""Time without a step after which the robot stands as it does [s]."""
LOADED = 0.5
"""Probability of contact from which a foot counts as planted."""

HERE = PlanarPose(0.0, 0.0, 0.0)


class StopPredictor:
    """Remembers the footprints of one robot, and how it stands above them.

    Attributes:
        pose: the place of rest as seen from base_link.
    """

    def __init__(self) -> None:
        """Begin without footprints: the robot is taken to stay where it is."""
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self.pose = HERE
        self._prints = [HERE, HERE]
        self._samples = [0, 0]
        self._stance: PlanarPose | None = None
        self._stood = 0.0

    def step(self, base: Array, feet: Array, contact: Array, moving: bool, dt: float) -> None:
        """Advance by `dt` [s].

        Args:
            base: (4, 4) pose of base_link in odom.
            feet: (2, 4, 4) poses of the soles in base_link, left and right.
            contact: (2,) probability that each foot carries load.
            moving: whether the robot walks or steps.
            dt: time since the previous step [s].
        """
        for k, foot in enumerate(base @ feet):
            planted = not moving or contact[k] > LOADED
            # The mean over a stance, because a sole rolls and the estimate trembles; at rest the newest is the best.
            self._samples[k] = self._samples[k] + 1 if planted and moving else int(planted)
            if planted:
                self._prints[k] = self._prints[k].toward(PlanarPose.of(foot), 1.0 / self._samples[k])
        left, right = self._prints
        middle = left.toward(right, 0.5)
        here = PlanarPose.of(base)
        if not moving:
            self.pose = HERE
            self._stood += dt
            if self._stood > STOOD:
                self._stance = middle.to(here)
            return
        self._stood = 0.0
        if self._stance is not None:
            expected = here.to(middle @ self._stance)
            self.pose = self.pose.toward(expected, dt / (SMOOTHING + dt))
