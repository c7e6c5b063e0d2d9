"""Robot and world in one MuJoCo model."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import mujoco
import numpy as np

from golem.errors import ConfigError
from golem.robots.model import contact_shapes, magpie_model, mjcf
from golem.robots.model.looks import VISUAL_GROUP
from golem.robots.model.magpie_model import CELLS, PLATE, TAG_SIZE, cuff_tags
from golem.robots.model.spatial import quat_of
from golem.robots.model.table import BASE_LINK, JOINT_NAMES
from golem.robots.mujoco.config import IONIQ5, KITCHENS, PLANTS, WITH_PACK, WORKSHOPS, MujocoConfig
from golem.robots.sensors.profiles import RealismProfile
from golem.robots.sensors.streams import stream
from golem.robots.worlds import furnished, parts, terrain
from golem.robots.worlds.conditions import REACH_Y, Conditions, arranged, draw_conditions, draw_fasteners, world_stream
from golem.robots.worlds.fridge import Seal, seal_of
from golem.robots.worlds.furnished import Person
from golem.robots.worlds.hall import dress
from golem.robots.worlds.ioniq5 import Ioniq5Layout
from golem.robots.worlds.kitchen import KitchenLayout, add_kitchen, draw_counter, draw_kitchen, mirrored
from golem.robots.worlds.layout import GANTRY, PackLayout
from golem.robots.worlds.pack import PackNames, add_pack
from golem.robots.worlds.pack_part import add_clutter
from golem.robots.worlds.robocasa import add_robocasa
from golem.robots.worlds.screws import ScrewDraw, draw_screws
from golem.true_runs import true_runs
from golem.types import SIDES, Array, CameraInfo, PlanarPose

THICK = 0.002
"""Thickness of a plate [m]."""
PROUD = 0.0004
"""How far the print stands out of it [m]: enough for a depth buffer."""
BLACK, WHITE = (0.02, 0.02, 0.02, 1.0), (0.95, 0.95, 0.95, 1.0)


def add_tag_cuffs(spec: mujoco.MjSpec) -> None:
    """Clamp a cuff around each hand; it weighs nothing and touches nothing."""
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    cell = TAG_SIZE / CELLS
    for side in SIDES:
        hand = spec.body(magpie_model.hand_name(side))
        for number, T in cuff_tags(side).items():
            quat = quat_of(T[:3, :3]).tolist()
            plate = (T[:3, :3] @ (0.0, 0.0, THICK / 2.0) + T[:3, 3]).tolist()
            size = (PLATE / 2.0, PLATE / 2.0, THICK / 2.0)
            parts.visual(hand, mujoco.mjtGeom.mjGEOM_BOX, size, plate, material="", quat=quat, rgba=WHITE)
            bits = cv2.aruco.generateImageMarker(family, number, CELLS) < 128
            for row in range(CELLS):
                for begin, end in true_runs(bits[row]).tolist():
                    x = (0.5 * (begin + end) - CELLS / 2.0) * cell
                    y = (row + 0.5 - CELLS / 2.0) * cell
                    # Centred on the plate's face, so that half of it stands out.
                    place = (T[:3, :3] @ (x, y, 0.0) + T[:3, 3]).tolist()
                    size = (0.5 * (end - begin) * cell, 0.5 * cell, PROUD)
                    parts.visual(hand, mujoco.mjtGeom.mjGEOM_BOX, size, place, material="", quat=quat, rgba=BLACK)


COARSE_STEP = 0.002
"""Physics step while nothing delicate is touched [s]."""
FINE_STEP = 0.0005
"""Physics step while a screw moves or a finger is about to touch one [s]; the bores need it."""
STICTION = 100.0
"""How much stiffer friction is than contact where feet carry the robot (MuJoCo's `impratio`). At 1 the soles creep
apart under the legs' side load, 25 mm in 20 s of standing, which no odometry from planted feet can see; at 100 it is
a millimetre."""

ONLOOKER = CameraInfo("onlooker", 640, 480, fx=700.0, fy=700.0, cx=319.5, cy=239.5, near=0.0, far=60.0, rate=15.0)
"""A camera beside the pack, for pictures of what happened; in a world without a pack it goes along with the robot."""


@dataclass(frozen=True)
class Scene:
    """A compiled world with its robot.

    Attributes:
        names: what the pack added; nothing in a world without one.
        nominal: where it would under nominal conditions, for a robot at its place.
        draws: the loosened screws.
        conditions: what of the work place differs from the nominal one.
        kitchen: what stands in a kitchen; None elsewhere.
        seal: the gasket of its fridge.
    """

    model: mujoco.MjModel
    names: PackNames
    layout: PackLayout
    nominal: PackLayout
    draws: tuple[ScrewDraw, ...]
    people: tuple[Person, ...] = ()
    conditions: Conditions = Conditions()
    kitchen: KitchenLayout | None = None
    seal: Seal | None = None

    def move_people(self, data: mujoco.MjData) -> None:
        """Put everybody where they are at the time of `data`."""
        for person in self.people:
            data.mocap_pos[self.model.body(person.name).mocapid[0]] = person.position(data.time)


def nominal_layout(config: MujocoConfig, standing: float) -> PackLayout:
    """Return where pack and tray nominally stand under a robot whose base_link is at `standing` [m] where it stands."""
    raised, hangs = config.hoist.height - standing, config.support == "hoist"
    if config.world in IONIQ5:  # by the floor, so that it is as far below the hands in the hoist
        return Ioniq5Layout().raised(raised if hangs else 0.0)
    return PackLayout() if hangs else PackLayout().raised(-raised)


def build_scene(config: MujocoConfig, layout: PackLayout, profile: RealismProfile, seed: int) -> Scene:
    """Compile the world of one seed.

    Args:
        layout: where the pack nominally stands; x, y from where the robot should stand, z from the floor.
        profile: ranges of the screws.
        seed: draws screws or terrain.

    Raises:
        ConfigError: an option of `config` has no meaning, or its MJCF is no robot of this kind.
    """
    try:
        return _build(_robot(config), config, layout, profile, seed)
    except ValueError as error:
        if config.mjcf is None:
            raise
        why = " ".join(str(error).split())
        raise ConfigError(f"The robot '{config.mjcf}' does not fit into the world '{config.world}': {why}.") from error


def _build(spec: mujoco.MjSpec, config: MujocoConfig, layout: PackLayout, profile: RealismProfile, seed: int) -> Scene:
    draws: list[ScrewDraw] = []
    people: tuple[Person, ...] = ()
    kitchen: KitchenLayout | None = None
    names = PackNames((), np.zeros((0, 3)), ())
    layout_kind = config.layout if config.world in WITH_PACK else "nominal"
    conditions = draw_conditions(layout_kind, config.conditions, world_stream(seed), config.world)
    nominal, stance = layout, PlanarPose(*config.stance)
    if config.world in PLANTS:
        people = _add_terrain(spec, config, seed)
    if config.world in WITH_PACK:
        layout = arranged(layout, conditions)
        reach_y = config.reach_y if config.layout == "nominal" else REACH_Y
        places = draw_fasteners(layout, conditions, reach_y, stream(seed, "world/fasteners"))
        layout = replace(layout, empty_holes=(*layout.empty_holes, *places.missing))
        varied = config.layout == "varied"
        ranges = profile.screws.lower() if varied else profile.screws
        draws = draw_screws(stream(seed, "world/screws"), ranges, places.loose, layout.kind)
        layout = layout.seen_with(stance)
        tight = stream(seed, "world/tight") if varied else None
        names = add_pack(spec, layout, draws, stance=stance, workshop=config.world in WORKSHOPS, tight=tight)
        off = stream(seed, "world/hands")
        for side in SIDES:
            hand, way = spec.body(magpie_model.hand_name(side)), off.standard_normal(3)
            hand.pos = hand.pos + conditions.hand_offset * way / np.linalg.norm(way)
        add_clutter(spec, layout, round(conditions.clutter), stream(seed, "world/clutter"))
        dress(spec, conditions, stance)
        if config.gantry:
            _add_gantry(spec, layout)
        _add_onlooker(spec, layout)
    elif config.world in KITCHENS:
        kitchen = lay_kitchen(config, seed, layout.top_z - PackLayout().top_z)
        names = PackNames((), np.zeros((0, 3)), add_kitchen(spec, kitchen, (stance.x, stance.y)))
        _add_kitchen_onlooker(spec, kitchen, stance)
    elif config.world == "robocasa":
        found = add_robocasa(spec, config.robocasa, stance, stream(seed, "world/kitchen"))
        names, at = PackNames((), np.zeros((0, 3)), found), np.array([stance.x, stance.y, 0.0])
        _aim(spec.worldbody.add_camera(name=ONLOOKER.name), at + (-1.2, 0.9, 1.9), at + (0.4, 0.0, 0.9))
    else:
        people = _add_terrain(spec, config, seed)
        camera = spec.body(BASE_LINK).add_camera(name=ONLOOKER.name)
        camera.mode = mujoco.mjtCamLight.mjCAMLIGHT_TRACK
        _aim(camera, np.array([2.6, 2.0, 0.5]), np.zeros(3))
    if config.cone is not None:
        spec.option.cone = mujoco.mjtCone.__members__[f"mjCONE_{config.cone.upper()}"]
    if config.support == "ground":
        spec.option.impratio = STICTION
    spec.option.noslip_iterations = config.noslip
    spec.option.timestep = COARSE_STEP
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    model = spec.compile()
    seal = None if kitchen is None else seal_of(model, kitchen.fridge)
    return Scene(model, names, layout, nominal, tuple(draws), people, conditions, kitchen, seal)


def lay_kitchen(config: MujocoConfig, seed: int, raised: float = 0.0) -> KitchenLayout:
    """Return the kitchen of one seed, for a `config` whose world is one; `raised` as for `draw_kitchen`."""
    rng, varied = stream(seed, "world/kitchen"), config.layout == "varied"
    if config.world == "kitchen":
        return draw_kitchen(rng, raised, varied)
    kitchen = draw_counter(rng, raised, varied, config.sizes)
    return mirrored(kitchen) if config.mirrored else kitchen


def _robot(config: MujocoConfig) -> mujoco.MjSpec:
    """Return the robot that `config` describes, without a world."""
    if config.mjcf is not None:
        spec = foreign_robot(config.mjcf)
    else:
        spec = mjcf.robot_spec(
            torque=config.torque_profile, self_collision=config.self_collision is not False, feet=config.feet
        )
    for side in SIDES:
        for geom in spec.body(f"{side}_ankle_roll_link").geoms:
            # With a higher priority its friction is the pair's; otherwise the greater of the two would be.
            geom.priority = 1
            geom.friction[0] = config.friction
    for side, mass in zip(SIDES, config.payload, strict=True):
        if mass > 0.0:
            _add_payload(spec.body(magpie_model.hand_name(side)), mass)
    if config.tags:
        add_tag_cuffs(spec)
    return spec


def read_robot(path: Path) -> mujoco.MjSpec:
    """Return the robot of another MJCF file, its free joint called `base`, else as it is.

    Args:
        path: an H1-2 with the vendor's 27 motors, links, joints and `imu` site, angles in radians.

    Raises:
        ConfigError: it cannot be read, or is no such robot.
    """
    try:
        spec = mujoco.MjSpec.from_file(str(path))
    except (ValueError, OSError) as error:
        raise ConfigError(f"The robot's MJCF '{path}' cannot be read: {error}.") from error
    base = spec.body(BASE_LINK)
    motors = tuple(actuator.name for actuator in spec.actuators)
    known = spec.site("imu") is not None and motors == JOINT_NAMES and not spec.compiler.degree
    if not known or base is None or [j.type for j in base.joints] != [mujoco.mjtJoint.mjJNT_FREE]:
        raise ConfigError(
            f"'{path}' is not the robot: it takes the link {BASE_LINK} on a free joint, a site imu, angles in radians, "
            f"and the motors {JOINT_NAMES[0]} to {JOINT_NAMES[-1]} in the vendor's order."
        )
    base.joints[0].name = "base"
    return spec


def foreign_robot(path: Path) -> mujoco.MjSpec:
    """Return the robot of `read_robot`, and raise as it, with our hands, cameras, names; limbs touch the world only."""
    spec = read_robot(path)
    _strip_world(spec)
    for element in (*spec.sensors, *spec.cameras):
        spec.delete(element)
    for geom in spec.geoms:
        if geom.contype:
            geom.contype, geom.conaffinity, geom.group = (
                contact_shapes.BODY,
                contact_shapes.WORLD,
                mjcf.COLLISION_GROUP,
            )
        else:
            geom.group = VISUAL_GROUP
    mjcf.add_torso_sensors(spec)
    for side in SIDES:
        mjcf.add_hand(spec, side)
    return spec


def _strip_world(spec: mujoco.MjSpec) -> None:
    """Leave out all of a robot's file that stands around the robot, its ground for one: the world is ours."""
    world, base = spec.worldbody, spec.body(BASE_LINK)
    others = [body for body in world.bodies if body.name != base.name]
    for element in (*world.geoms, *world.lights, *world.sites, *others):
        spec.delete(element)
    used = {geom.material for geom in spec.geoms}
    for material in [m for m in spec.materials if m.name not in used]:
        spec.delete(material)
    used = {name for material in spec.materials for name in material.textures}
    for texture in [t for t in spec.textures if t.name not in used]:
        spec.delete(texture)


def _add_payload(hand: mujoco.MjsBody, mass: float) -> None:
    """Fix what weighs `mass` [kg] to a hand; it touches nothing, and no camera sees it."""
    held = magpie_model.payload(mass)
    hand.add_body(
        name=f"{hand.name}_payload",
        pos=held.com,
        ipos=[0.0, 0.0, 0.0],  # MuJoCo takes `pos` again where it is not said
        mass=held.mass,
        inertia=np.diag(held.inertia),
        explicitinertial=True,
    )


def _add_gantry(spec: mujoco.MjSpec, layout: PackLayout) -> None:
    """Add a gantry's tool, a spindle under its column, parked above the middle of the pack."""
    x, y, z = (layout.pose() @ (0.5 * layout.size_x, 0.0, 1.0, 1.0))[:3]
    body = spec.worldbody.add_body(name=GANTRY, mocap=True, pos=(x, y, z))
    spindle, column = mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_BOX
    body.add_geom(type=spindle, size=(0.02, 0.15, 0.0), pos=(0.0, 0.0, 0.15), rgba=(0.3, 0.3, 0.3, 1.0))
    body.add_geom(type=column, size=(0.06, 0.06, 0.4), pos=(0.0, 0.0, 0.7), rgba=(0.9, 0.6, 0.1, 1.0))


def _add_terrain(spec: mujoco.MjSpec, config: MujocoConfig, seed: int) -> tuple[Person, ...]:
    """Add the ground of a world other than the workshop, and return the people on it."""
    if config.world in ("furnished", *PLANTS):
        furnished.add_furnished_hall(spec, stream(seed, "world/furniture"), bare=config.world in PLANTS)
        furnished.add_course(spec, stream(seed, "world/course"), config.obstacles)
        return furnished.add_people(spec, stream(seed, "world/people"), config.people)
    if config.world == "corridor":
        furnished.add_corridor(spec)
    elif config.world == "slope":
        terrain.add_slope(spec, config.slope)
    elif config.world == "step":
        terrain.add_step(spec, config.step)
    elif config.world == "rubble":
        terrain.add_rubble(spec, config.rubble, stream(seed, "world/rubble"))
    else:
        terrain.add_open(spec)
    return ()


def _add_onlooker(spec: mujoco.MjSpec, layout: PackLayout) -> None:
    """Add a fixed camera that watches hands and near edge from the robot's left; no module of a stack sees it."""
    T = layout.pose()
    eye = (T @ (0.95, 0.75 - layout.center_y, 0.70, 1.0))[:3]
    target = (T @ (0.02, -0.15 - layout.center_y, 0.06, 1.0))[:3]
    _aim(spec.worldbody.add_camera(name=ONLOOKER.name), eye, target)


def _add_kitchen_onlooker(spec: mujoco.MjSpec, kitchen: KitchenLayout, stance: PlanarPose) -> None:
    """Add a fixed camera that watches robot, fridge and counter from the counter's side, behind the robot.

    Of a robot that works at a counter it shows front and hands, from below the cabinets on the wall.
    """
    fridge, at = kitchen.fridge, np.array([stance.x, stance.y, 0.0])
    side = 1.0 if fridge.handle_y < 0.0 else -1.0
    eye = np.array([-1.25, 1.35 * side, fridge.handle_z + 0.65])
    target = np.array([fridge.front - 0.05, 0.05 * side, fridge.handle_z - 0.22])
    if fridge.handle_y < kitchen.counter_start:
        eye, target = (
            np.array([1.20, 0.62, kitchen.counter_top + 0.55]),
            np.array([0.34, -0.02, kitchen.counter_top + 0.12]),
        )
    _aim(spec.worldbody.add_camera(name=ONLOOKER.name), eye + at, target + at)


def _aim(camera: mujoco.MjsCamera, eye: Array, target: Array) -> None:
    """Place `camera` at `eye` and let it look at `target`, (3,) each in its body's frame [m]."""
    back = (eye - target) / np.linalg.norm(eye - target)
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    camera.pos = eye.tolist()
    camera.alt.type = mujoco.mjtOrientation.mjORIENTATION_XYAXES
    camera.alt.xyaxes = np.concatenate([right, np.cross(back, right)]).tolist()
