"""Which postures of torso and arms are free: limits, the robot itself, the world, and rules."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from golem.capabilities.collision import sphere_kernel
from golem.capabilities.collision.collision_model import CollisionModel
from golem.capabilities.collision.obstacles import World
from golem.capabilities.collision.sphere_robot import Packing, SphereRobot, holding, shipped_spheres
from golem.capabilities.planning import plan_kernel
from golem.capabilities.planning.base import Held
from golem.capabilities.planning.plan_kernel import FREE, ITSELF, RANGE, RULE, WORLD, Space
from golem.capabilities.planning.rules import Balanced, Rule
from golem.hardware.safety.base import SafetyLimits
from golem.robots.model import pinocchio_model
from golem.robots.model.magpie_model import T_HAND_GRIPPER, hand_name
from golem.robots.model.table import JOINT_NAMES
from golem.types import SIDES, UPPER, Array, Side

LIMIT_MARGIN = 0.001
"""Distance kept from the range that the safety gate allows [rad]."""


class PlanningRobot:
    """What of the robot does not change from plan to plan: spheres, grasp frames, masses, the range of the joints.

    Attributes:
        lower, upper: (15,) range of the joints that is planned in [rad].
        hands: of each side, the body of the kernel that carries it and the (4, 4) grasp frame in that body.
        masses: (16, 4), see `plan_kernel.Space`.
    """

    def __init__(self, robot: SphereRobot | None = None) -> None:
        """Lay out the tables of `robot`, by default the H1-2 with MAGPIE hands."""
        self._robot = robot or shipped_spheres()
        self._models: dict[tuple[tuple[Side, bytes], ...], CollisionModel] = {}
        gate = SafetyLimits.from_profile()
        self.lower: Array = gate.lower[UPPER] + LIMIT_MARGIN
        self.upper: Array = gate.upper[UPPER] - LIMIT_MARGIN
        model = self.model()
        n = len(model.joints)
        R, p = np.empty((n + 1, 9)), np.empty((n + 1, 3))
        sphere_kernel.place(np.zeros(n), model.ints, model.floats, R, p)
        T_base_body = np.tile(np.eye(4), (n + 1, 1, 1))
        T_base_body[:, :3, :3], T_base_body[:, :3, 3] = R.reshape(-1, 3, 3), p
        T_body_base = np.linalg.inv(T_base_body)
        full = pinocchio_model.build(hands=True)
        data = full.createData()
        pin.framesForwardKinematics(full, data, pin.neutral(full))
        self.hands: dict[Side, tuple[int, Array]] = {}
        for side, body in zip(SIDES, (8, 15), strict=True):
            frame = full.getFrameId(f"{side}_gripper")
            self.hands[side] = body, T_body_base[body] @ data.oMf[frame].homogeneous
        self.masses: Array = np.zeros((n + 1, 4))
        bodies = {name: j + 1 for j, name in enumerate(model.joints)}
        for i, inertia in enumerate(full.inertias):
            body = bodies.get(full.names[i], 0)
            com = T_body_base[body] @ np.append(data.oMi[i].act(inertia.lever), 1.0)
            self.masses[body, :3] += inertia.mass * com[:3]
            self.masses[body, 3] += inertia.mass
        self.masses[:, :3] /= self.masses[:, 3:]
        self.masses[:, 3] /= self.masses[:, 3].sum()

    def model(self, held: Sequence[Held] = ()) -> CollisionModel:
        """Return the spheres of the robot, holding what it holds; those of what was held last are kept."""
        key: tuple[tuple[Side, bytes], ...] = tuple((one.side, np.asarray(one.balls, float).tobytes()) for one in held)
        if key not in self._models:
            robot = self._robot
            for one in held:
                balls = np.asarray(one.balls, float).reshape(-1, 4)
                centres = balls[:, :3] @ T_HAND_GRIPPER[:3, :3].T + T_HAND_GRIPPER[:3, 3]
                robot = holding(robot, hand_name(one.side), Packing(centres, balls[:, 3]), f"{one.side}_held")
            if len(self._models) > 8:
                self._models.clear()
            self._models[key] = CollisionModel(robot, JOINT_NAMES[UPPER])
        return self._models[key]


class JointSpace:
    """The postures that one request allows by its `rules`; `space` is what the kernel reads."""

    def __init__(
        self,
        robot: PlanningRobot,
        q: Array,
        world: World | None = None,
        rules: Sequence[Rule] = (),
        held: Sequence[Held] = (),
        margins: tuple[float, float] = (0.0, 0.01),
    ) -> None:
        """Lay out the tables for joints that are at `q` (15,) at the start [rad]: `Balanced` counts from there.

        The conservative spheres keep the distances `margins`, of the robot from itself and from the world [m].
        """
        self.robot, self.rules = robot, tuple(rules)
        model = robot.model(held)
        rows = np.zeros((len(self.rules), plan_kernel.ROW))
        for row, rule in zip(rows, self.rules, strict=True):
            side: Side = "left" if isinstance(rule, Balanced) else rule.side
            row[:] = rule.row(*robot.hands[side], self.centre_of_mass(q))
        tables, bounds = (world or World()).tables, (robot.lower, robot.upper)
        self.space = Space(model.ints, model.floats, tables, *bounds, rows, robot.masses, np.array(margins))

    def shrunk(self, margins: tuple[float, float]) -> JointSpace:
        """Return the same space with other margins [m]."""
        other = object.__new__(JointSpace)
        other.robot, other.rules = self.robot, self.rules
        other.space = self.space._replace(margins=np.array(margins))
        return other

    def verdict(self, q: Array) -> int:
        """Return 0 if the posture `q` (15,) is free, else why not; see `reason`."""
        return int(plan_kernel.verdict(np.ascontiguousarray(q, float), self.space))

    def verdicts(self, Q: Array) -> NDArray[np.int64]:
        """Return (m,) the verdict on each row of `Q` (m, 15)."""
        out = np.empty(len(Q), np.int64)
        plan_kernel.verdicts(np.ascontiguousarray(Q, float), self.space, out)
        return out

    def free_line(self, a: Array, b: Array, step: float) -> bool:
        """Return whether the line from `a` to `b` is free, `a` left out, in steps of `step` [rad in a joint]."""
        free, parts = plan_kernel.free_steps(a, b, step, self.space)
        return free == parts

    def hands(self, Q: Array) -> Array:
        """Return (m, 2, 3) where the grasp frames are in base_link at each row of `Q` (m, 15) [m], left and right."""
        bodies = np.array([self.robot.hands[side][0] for side in SIDES])
        offsets = np.array([self.robot.hands[side][1][:3, 3] for side in SIDES])
        out = np.empty((len(Q), 2, 3))
        plan_kernel.points_of(np.ascontiguousarray(Q, float), bodies, offsets, self.space, out)
        return out

    def reason(self, verdict: int, q: Array) -> str:
        """Return in words what a verdict says of the posture `q` (15,)."""
        if verdict == RANGE:
            over = np.maximum(self.space.lower - q, q - self.space.upper)
            j = int(over.argmax())
            return f"{JOINT_NAMES[UPPER][j]} is {over[j]:.3f} rad beyond the range that the safety gate allows"
        words = {FREE: "nothing is in the way", ITSELF: "the robot touches itself", WORLD: "something is in the way"}
        return words[verdict] if verdict < RULE else f"it breaks a rule: {self.rules[verdict - RULE]}"

    def centre_of_mass(self, q: Array) -> Array:
        """Return (3,) the robot's centre of mass in base_link at `q` (15,), with straight legs [m]."""
        model = self.robot.model()
        n = len(model.joints)
        R, p = np.empty((n + 1, 9)), np.empty((n + 1, 3))
        sphere_kernel.place(np.ascontiguousarray(q, float), model.ints, model.floats, R, p)
        m = self.robot.masses
        return m[:, 3] @ (np.einsum("nij,nj->ni", R.reshape(-1, 3, 3), m[:, :3]) + p)
