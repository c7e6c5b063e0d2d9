"""How far from perfect the twin is: the realism profiles `ideal`, `bench` and `field`, and the draw of one episode.

Every number names its source: [paper] the GOLEM paper; [authors] measured by the authors, published with their code;
[vendor] the maker's figures; [C] computed from such figures; [assumption] nobody publishes it.

`field` is the authors' robot as they report it. `bench` is the same hardware after careful calibration and without
wind in the rope; all its figures are [assumption]s unless they say otherwise. `ideal` has no error at all.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from golem.errors import ConfigError, unknown_name
from golem.options import check_values, convert_all, read_yaml
from golem.robots.model.table import JOINT_INDEX
from golem.robots.sensors.cameras import CAMERAS
from golem.robots.sensors.depth import DepthErrors
from golem.robots.sensors.imu import ImuBias, ImuErrors
from golem.robots.worlds.screws import ScrewRanges
from golem.types import LEGS, NUM_JOINTS, UPPER, Array


@dataclass(frozen=True, slots=True)
class MotorErrors:
    """Magnitudes of the errors of a motor's report; zeros of the encoders are `arm_offset` and `leg_offset`.

    Attributes:
        encoder_step: least difference of two positions [rad].
        speed_noise: standard deviation of a speed, white at 500 Hz [rad/s].
        torque_noise: the same of a torque [N m].
        torque_gain: standard deviation of the share by which a joint's torques are wrong, constant over an episode.
        torque_gains: by joint the share about which it scatters; 0 where a joint is not named.
    """

    encoder_step: float = 0.0
    speed_noise: float = 0.0
    torque_noise: float = 0.0
    torque_gain: float = 0.0
    torque_gains: dict[str, float] = field(default_factory=dict[str, float])


def per_joint(values: object) -> Array:
    """Return the (27,) `values`, a mapping by joint, in motor order; 0 where a joint is not named.

    Raises:
        ConfigError: they are none, or one is no small number.
    """
    if not isinstance(values, dict):
        raise ConfigError(f"Zeros and torque gains are mappings by joint, not {values!r}.")
    out = np.zeros(NUM_JOINTS)
    for name, value in values.items():
        if name not in JOINT_INDEX:
            raise unknown_name("joint", name, JOINT_INDEX)
        if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= 0.5:
            raise ConfigError(f"The zero or torque gain of {name} is a number from -0.5 to 0.5, not {value!r}.")
        out[JOINT_INDEX[name]] = value
    return out


TONES = 4
"""Sinusoids per axis."""
BAND = (0.2, 0.8)
"""Frequencies [Hz]; assumption: a pendulum of 4 m to 1 m (0.25 to 0.5 Hz), with a margin."""


@dataclass(frozen=True, slots=True)
class Sway:
    """A sum of sinusoids per axis; a function of time alone.

    Attributes:
        amplitude: of every sinusoid [m].
        omega: (2, TONES) angular frequencies [rad/s].
        phase: (2, TONES) [rad].
    """

    amplitude: float
    omega: Array
    phase: Array

    def offset(self, t: float) -> Array:
        """Return the (2,) displacement x, y from the undisturbed place at time `t` [s], in metres."""
        return self.amplitude * np.sin(self.omega * t + self.phase).sum(axis=1)


def draw_sway(radial_rms: float, rng: np.random.Generator) -> Sway:
    """Draw a sway whose radial displacement has the given RMS [m] over a long time."""
    omega = 2 * np.pi * rng.uniform(*BAND, size=(2, TONES))
    phase = rng.uniform(0, 2 * np.pi, size=(2, TONES))
    # Each of the 2 TONES sinusoids contributes amplitude^2 / 2 to the mean square radius.
    return Sway(radial_rms / np.sqrt(TONES), omega, phase)


@dataclass(frozen=True, slots=True)
class ExtrinsicErrors:
    """Distribution of a camera's calibration error, constant over an episode.

    The rotation vector's length is normal about `rotation` with a fifth of it as deviation, the translation's length
    uniform in `translation`; both directions are isotropic. With `min_error`, a draw that displaces the point
    `reference` ahead of the camera by less is rejected.

    Attributes:
        rotation: mean rotation angle [rad].
        translation: range of the translation's length [m].
        min_error: smallest displacement of the reference point [m].
        reference: distance of the reference point on the optical axis [m].
    """

    rotation: float = 0.0
    translation: tuple[float, float] = (0.0, 0.0)
    min_error: float = 0.0
    reference: float = 1.0


@dataclass(frozen=True, slots=True)
class RealismProfile:
    """Magnitudes of everything that separates the twin from a perfect robot.

    Attributes:
        name: `"ideal"`, `"bench"` or `"field"`; of a file's, that of the profile it begins with.
        head, palm: calibration error of the head camera and of each palm camera.
        depth: errors of stereo depth, all cameras.
        focal, principal: standard deviation of the focal lengths, as a share, and of the principal point [px], against
            what a camera says of itself.
        colour_noise: noise of the colour images, in multiples of what `auto_exposure` has.
        arm_offset, leg_offset: standard deviation of the encoder zero of torso and arm joints, of leg joints [rad].
        zeros: by joint the zero about which it scatters [rad]; 0 where a joint is not named.
        actuator_delay: time from a motor command's publication to the torque [s].
        motors: errors of what the motors report.
        leg_friction, arm_friction: range of each joint's dry friction, legs and then torso and arms [N m]; None leaves
            that of the model.
        imu: errors of the IMU.
        hoist_sway: radial RMS of the base's horizontal sway in the hoist [m]; a robot that stands sways by itself.
        screws: ranges of the loosened screws.
    """

    name: str
    head: ExtrinsicErrors = ExtrinsicErrors()
    palm: ExtrinsicErrors = ExtrinsicErrors()
    depth: DepthErrors = DepthErrors()
    focal: float = 0.0
    principal: float = 0.0
    colour_noise: float = 0.0
    arm_offset: float = 0.0
    leg_offset: float = 0.0
    zeros: dict[str, float] = field(default_factory=dict[str, float])
    actuator_delay: float = 0.0
    motors: MotorErrors = MotorErrors()
    leg_friction: tuple[float, float] | None = None
    arm_friction: tuple[float, float] | None = None
    imu: ImuErrors = ImuErrors()
    hoist_sway: float = 0.0
    screws: ScrewRanges = field(default_factory=ScrewRanges)

    @property
    def lives(self) -> bool:
        """Whether the last digits of its sensors move while the robot rests: the IMU's noise sees to all of them."""
        return self.imu.gyro_noise > 0.0


NOMINAL_SCREWS = ScrewRanges(
    friction=(0.35, 0.35), clearance=(0.0003, 0.0003), protrusion=(0.008, 0.008), tilt=(0.0, 0.0)
)  # fmt: skip
"""Middle of the ranges of `ScrewRanges`, upright; sizes still differ from screw to screw."""

D400 = DepthErrors(
    # [vendor] about 0.08 px RMS is the usual sub-pixel figure of a tuned D400 on a textured target.
    subpixel=0.08,
    # [assumption] block matching smears the noise over its window: half of the variance, patches of 8 px.
    correlated=0.5,
    patch=8,
    # [vendor] the D4 processor reports disparity in 1/32 px.
    disparity_step=1 / 32,
    # [assumption] surfaces seen flatter than this return nothing, and half of a specular one.
    grazing=np.deg2rad(70.0),
    specular_loss=0.5,
    occlusion=True,
)

MOTORS = MotorErrors(
    # [assumption] 15 bits per turn of the output, as of the vendor's smaller motors; nobody publishes the H1-2's.
    encoder_step=2.0 * np.pi / 2**15,
    # [assumption] what a filtered derivative of such an encoder leaves.
    speed_noise=0.01,
    # [assumption] ripple of the currents' measurement, and a torque constant known to 3 %.
    torque_noise=0.2,
    torque_gain=0.03,
)

IMU = ImuErrors(
    # [assumption] class figures of an industrial MEMS unit; the H1-2's is not published. White noise per sample at
    # 500 Hz: 0.014 deg/s/sqrt(Hz) and 0.18 mg/sqrt(Hz) over 250 Hz.
    gyro_noise=0.0039,
    acc_noise=0.028,
    # [assumption] what is left after the start-up average: 0.1 deg/s, 5 mg.
    gyro_bias=0.0017,
    acc_bias=0.05,
    # [assumption] roll and pitch of the vendor's filter, mounting included; heading is zeroed at the start.
    tilt=np.deg2rad(0.3),
    attitude_noise=np.deg2rad(0.03),
)

PROFILES: dict[str, RealismProfile] = {
    "ideal": RealismProfile("ideal", screws=NOMINAL_SCREWS),
    "bench": RealismProfile(
        "bench",
        # [assumption] a hand-eye calibration with bundle adjustment on a rigid bench (the lab publishes no residuals).
        head=ExtrinsicErrors(rotation=np.deg2rad(0.5), translation=(0.003, 0.006)),
        palm=ExtrinsicErrors(rotation=np.deg2rad(0.25), translation=(0.0, 0.001), reference=0.1),
        depth=D400,
        # [assumption] what a factory calibration leaves at another temperature; no maker publishes it.
        focal=0.002,
        principal=1.0,
        colour_noise=1.0,
        # [C] 0.009 rad puts the hand 10 mm off on average; [assumption] that a kinematic calibration reaches that,
        # which is the authors' 9 mm in simulation.
        arm_offset=0.009,
        leg_offset=0.005,
        # [C] one period of the 500 Hz command stream.
        actuator_delay=0.002,
        motors=MOTORS,
        # [assumption] dry friction of planetary gears of that torque; nobody publishes it, and no two joints are alike.
        leg_friction=(0.3, 2.0),
        arm_friction=(0.1, 0.8),
        imu=IMU,
        # [paper] sway while standing in their simulation: 0.10 mm radial RMS. [assumption] the same in the hoist.
        hoist_sway=0.0001,
    ),
    "field": RealismProfile(
        "field",
        # [paper] single-shot detection through head calibration and depth is off by 5 cm or more. [assumption] split
        # as 2 deg and 20 to 30 mm; their isotropic draws give 36 mm at 1 m (median, 17 % above 5 cm) [C], so the
        # paper's bound decides: draws below it are rejected, which leaves 55 mm (median; 95 % below 66 mm) [C].
        head=ExtrinsicErrors(rotation=np.deg2rad(2.0), translation=(0.020, 0.030), min_error=0.05),
        # [assumption] a printed bracket and a hand-eye calibration: 0.5 deg and 2 mm, 2.2 mm at 100 mm [C].
        palm=ExtrinsicErrors(rotation=np.deg2rad(0.5), translation=(0.001, 0.003), reference=0.1),
        depth=D400,
        # [assumption] what a factory calibration leaves at another temperature; no maker publishes it.
        focal=0.002,
        principal=1.0,
        colour_noise=1.0,
        # [authors] mean reach error 35 mm on the robot against 9 mm in simulation: 34 mm of the robot's own. [C] the
        # hand moves 1.11 m per rad of equal, independent offset in torso and arm (mean over 3000 postures before the
        # chest), so 0.0306 rad. [assumption] that all of it is encoder zero.
        arm_offset=0.0306,
        # [assumption] legs are zeroed with the vendor's jig; no figure exists.
        leg_offset=0.010,
        # [C] one period of the command stream and one of the motor bus.
        actuator_delay=0.004,
        motors=MOTORS,
        # [assumption] dry friction of planetary gears of that torque; nobody publishes it, and no two joints are alike.
        leg_friction=(0.3, 2.0),
        arm_friction=(0.1, 0.8),
        imu=IMU,
        # [assumption] half of the standing robot's 4.6 mm radial RMS [paper]; nobody published that of the hoisted one.
        hoist_sway=0.0023,
    ),
}
"""Every profile by name."""


OF_A_FILE = ("arm_offset", "leg_offset", "zeros", "actuator_delay", "motors", "leg_friction", "arm_friction")
"""What a file may say of one robot: what `golem identify` finds."""


def load_profile(name: str) -> RealismProfile:
    """Return a profile.

    Args:
        name: `"ideal"`, `"bench"` or `"field"`, or a YAML file with the `base`, one of these, and keys of `OF_A_FILE`.

    Raises:
        ConfigError: there is no profile of that name, or the file is none.
    """
    if name in PROFILES:
        return PROFILES[name]
    if not name.endswith((".yaml", ".yml")):
        raise unknown_name("profile", name, PROFILES)
    try:
        rows = read_yaml(Path(name).read_text(encoding="utf-8"), name)
    except (OSError, ValueError) as error:
        raise ConfigError(f"The profile '{name}' cannot be read: {error}.") from error
    if not isinstance(rows, dict) or rows.get("base") not in list(PROFILES):
        raise ConfigError(f"{name}: a profile's file has a key 'base', one of {', '.join(PROFILES)}.")
    check_values(name, rows)
    base, others = PROFILES[rows.pop("base")], {f.name for f in fields(RealismProfile)} - {*OF_A_FILE}
    profile = replace(base, **convert_all(f"key of {name}", RealismProfile, rows, others))
    for values in (profile.zeros, profile.motors.torque_gains):
        per_joint(values)
    return profile


@dataclass(frozen=True, slots=True)
class EpisodeErrors:
    """The errors that stay what they are during one episode.

    Attributes:
        T_nominal_actual: per camera (4, 4), pose of the real optical frame in the optical frame that the robot's
            calibration claims.
        intrinsics: per camera (3,), its true focal length as a share of what it claims, and its principal point beside
            what it claims [px].
        joint_offset: (27,) reported minus true joint position [rad].
        friction: (27,) dry friction of the joints [N m]; NaN leaves that of the model.
        imu: bias of the IMU.
        hoist_sway: horizontal motion of the base in the hoist.
    """

    T_nominal_actual: dict[str, Array]
    intrinsics: dict[str, Array]
    joint_offset: Array
    friction: Array
    imu: ImuBias
    hoist_sway: Sway


def sample_episode(profile: RealismProfile, rng: np.random.Generator) -> EpisodeErrors:
    """Draw the errors of one episode.

    Args:
        profile: magnitudes.
        rng: e.g. `stream(seed, "episode")`; each kind of error draws from a child of it.
    """
    cameras, joints, imu, hoist, lenses, gears = rng.spawn(6)
    sigma = np.zeros(NUM_JOINTS)
    sigma[LEGS] = profile.leg_offset
    sigma[UPPER] = profile.arm_offset
    return EpisodeErrors(
        T_nominal_actual={
            name: _draw_extrinsic(profile.head if name == "head" else profile.palm, child)
            for name, child in zip(CAMERAS, cameras.spawn(len(CAMERAS)), strict=True)
        },
        intrinsics={
            name: np.array([1.0, 0.0, 0.0])
            + np.array([profile.focal, profile.principal, profile.principal]) * child.standard_normal(3)
            for name, child in zip(CAMERAS, lenses.spawn(len(CAMERAS)), strict=True)
        },
        joint_offset=per_joint(profile.zeros) + sigma * joints.standard_normal(NUM_JOINTS),
        friction=np.concatenate(
            [
                _spread(profile.leg_friction, LEGS.stop, gears),
                _spread(profile.arm_friction, NUM_JOINTS - LEGS.stop, gears),
            ]
        ),
        imu=profile.imu.draw_bias(imu),
        hoist_sway=draw_sway(profile.hoist_sway, hoist),
    )


def _spread(span: tuple[float, float] | None, count: int, rng: np.random.Generator) -> Array:
    return np.full(count, np.nan) if span is None else rng.uniform(*span, count)


def _draw_extrinsic(errors: ExtrinsicErrors, rng: np.random.Generator) -> Array:
    ahead = np.array([0.0, 0.0, errors.reference])
    while True:
        angle = errors.rotation * (1 + 0.2 * rng.standard_normal())
        T = np.eye(4)
        T[:3, :3] = Rotation.from_rotvec(angle * _direction(rng)).as_matrix()
        T[:3, 3] = rng.uniform(*errors.translation) * _direction(rng)
        if np.linalg.norm(T[:3, :3] @ ahead + T[:3, 3] - ahead) >= errors.min_error:
            return T


def _direction(rng: np.random.Generator) -> Array:
    v = rng.standard_normal(3)
    return v / np.linalg.norm(v)
