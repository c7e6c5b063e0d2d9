"""A grasp method of your own: close straight down on the middle of what is seen. It picks a screw from the pack."""

from __future__ import annotations

from golem.capabilities.grasping.base import Grasp, Gripper, OpenLoop
from golem.capabilities.grasping.centroid import grasp_pose
from golem.finite import check_finite
from golem.runtime.lockstep import build
from golem.skills.pick_config import PickGoal
from golem.stack import load_stack
from golem.types import Array, LocalizedObject


class StraightDown(OpenLoop):
    """One top-down grasp, carried out as it is proposed."""

    latency = 0.0

    def __init__(self, depth: float = 0.01) -> None:
        """Put the fingertips `depth` below the surface that is seen [m]."""
        self.depth = depth

    def propose(self, target: LocalizedObject, scene: Array, gripper: Gripper) -> list[Grasp]:
        """Return grasps for `target`, best first."""
        check_finite("the position of the object", target.position)
        place = target.position - (0.0, 0.0, self.depth)
        return [Grasp(grasp_pose(place, gripper.yaw), gap=0.05, score=target.detection.score)]


def main() -> None:
    stack = load_stack("tether", profile="ideal").with_choice("grasp_method", f"{__file__}:StraightDown")
    running, robot = build(stack, seed=0)
    result = running.execute("pick", PickGoal())
    robot.close()
    print(f"{'picked' if result.success else 'failed'} after {running.executor.t:.1f} s: {result.reason}")


if __name__ == "__main__":
    main()
