"""Looks of a camera at the tags on a hand, from one posture of the arms after the other."""

from __future__ import annotations

from collections.abc import Sequence

from golem.capabilities.calibration.kinematic_fit import TagView
from golem.capabilities.calibration.tag_detector import TagDetector
from golem.capabilities.collision.obstacles import Obstacle, World
from golem.capabilities.planning.base import PlanRefused
from golem.capabilities.planning.joint_space import JointSpace, PlanningRobot
from golem.interfaces import topics
from golem.robots.model.spatial import transform
from golem.robots.model.tag_cuff import cuff_tags
from golem.skills.context import Context
from golem.skills.planned_motion import PlannedMotion
from golem.types import Array, CameraInfo, Side

WORK_PLACE = World((Obstacle("box", transform((0.85, 0.0, -0.22)), (0.55, 1.3, 0.28), "work place"),))
"""What the arms keep out of, in base_link [m]: whatever stands before the robot, up to 6 cm above its pelvis."""
SPEED = 0.6
"""How fast a hand goes from view to view [m/s]."""
FRAMES = 2
"""Frames that are looked at in one posture: the second one tells nothing new of a tag, but may show one at all."""
FRAME_TIME = 1.0
"""How long a frame is waited for [s]."""


class TagLooks:
    """Brings a hand with tags before a camera, again and again.

    Attributes:
        info: the camera as its images tell; None until one came.
        robot: what plans the ways.
    """

    def __init__(self, context: Context, camera: str) -> None:
        """Look with `camera`, from how the arms are now."""
        self._context, self._camera = context, camera
        self._detector, self._motion = TagDetector(), PlannedMotion(context)
        self._motion.world = WORK_PLACE
        self.robot = PlanningRobot()
        self._space = JointSpace(self.robot, context.joints, WORK_PLACE)
        self.info: CameraInfo | None = None

    def free(self, q: Array) -> bool:
        """Return whether nothing touches in the posture `q` (15,) [rad] of torso and arms."""
        return self._space.verdict(q) == 0

    async def views(
        self, postures: Sequence[Array], shown: Side, moving: Sequence[Side], settle: float, what: str
    ) -> list[TagView]:
        """Return what was seen from `postures`, those left out that no way leads to; the arms come back at the end.

        Args:
            postures: (15,) each, of torso and arms; the torso stays as it is [rad].
            shown: the hand that is looked at.
            moving: the arms that move.
            settle: time they get to come to rest in each [s].
            what: what feedback calls it.
        """
        home, views = self._context.commanded_joints.copy(), list[TagView]()
        for k, q in enumerate(postures):
            self._context.say("look", f"{what}, view {k + 1} of {len(postures)}.")
            q[0] = home[0]
            try:
                await self._motion.to_joints(q, moving, SPEED)
            except PlanRefused:
                continue
            await self._context.sleep(settle)
            seen = await self._look(shown)
            if seen is not None:
                views.append(seen)
        await self._motion.to_joints(home, moving, SPEED)
        return views

    async def _look(self, shown: Side) -> TagView | None:
        """Look at a hand that rests; return what was seen with the joints of that moment, None for nothing."""
        own, bus = cuff_tags(shown), self._context.bus
        with self._context.watch(self._camera, "screw") as stream:
            for _ in range(FRAMES):
                if await stream.look(FRAME_TIME) is None:
                    continue
                frame, state = bus.latest(topics.rgbd_images(self._camera)), bus.latest(topics.LOW_STATE)
                if frame is None or state is None:
                    continue
                self.info = frame.info
                corners = {n: c for n, c in self._detector.find(frame.rgb).items() if n in own}
                if corners:
                    return TagView(shown, state.q.copy(), corners)
        return None
