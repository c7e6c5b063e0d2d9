"""How far from perfect the twin is: the realism profiles `ideal`, `bench` and `field`, and the draw of one episode."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from golem.errors import ConfigError, unknown_name
from golem.options import check_values, convert_all, fill, read_yaml, require
from golem.package_data import load_data
from golem.robots.model.spatial import transform
from golem.robots.model.table import JOINT_INDEX
from golem.robots.sensors.cameras import CAMERAS
from golem.robots.sensors.depth import DepthErrors
from golem.robots.sensors.imu import ImuBias, ImuErrors
from golem.robots.worlds.conditions import Conditions
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
    """Return `values` by joint in motor order, (27,), 0 for those not named. Raises ConfigError: no small numbers."""
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
        backlash: play of each joint's gears, from end to end [rad]; the encoder is on the motor's side.
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
    backlash: float = 0.0
    imu: ImuErrors = ImuErrors()
    hoist_sway: float = 0.0
    screws: ScrewRanges = field(default_factory=ScrewRanges)

    @property
    def lives(self) -> bool:
        """Whether the last digits of its sensors move while the robot rests: the IMU's noise sees to all of them."""
        return self.imu.gyro_noise > 0.0

    def under(self, c: Conditions) -> RealismProfile:
        """Return it with the factors `palm` and `arm_friction` of a work place's conditions, and their `backlash`."""
        low, high = self.palm.translation
        palm = replace(self.palm, rotation=c.palm * self.palm.rotation, translation=(c.palm * low, c.palm * high))
        rubs = self.arm_friction and (c.arm_friction * self.arm_friction[0], c.arm_friction * self.arm_friction[1])
        return replace(self, palm=palm, arm_friction=rubs, backlash=self.backlash + c.backlash * GEARS)


GEARS = 0.003839724354387525
"""Backlash of a leg's gears, 0.22 deg from end to end [rad].

[C] +-0.11 deg were measured at the PULSE115-60, a quasi-direct drive for legged robots (Perez-Diaz et al., Design and
Experimental Characterisation of a Novel Quasi-Direct Drive Actuator for Highly Dynamic Robotic Applications, 2024).
[assumption] the H1-2's gears have as much; nobody publishes theirs. No profile has it: see docs/decisions/twin.md.
"""

PROFILES: dict[str, RealismProfile] = {
    name: fill(f"key of {name}", RealismProfile, {"name": name, **rows})
    for name, rows in load_data(__package__, "profiles.yaml").items()
}
"""Every profile by name; `profiles.yaml`, beside this file, names the source of each number."""
D400 = PROFILES["field"].depth
"""What a RealSense's depth gets wrong."""
MOTORS = PROFILES["field"].motors
"""What a motor's report gets wrong."""
OF_A_FILE = (
    "arm_offset",
    "leg_offset",
    "zeros",
    "actuator_delay",
    "motors",
    "leg_friction",
    "arm_friction",
    "backlash",
)
"""What a file may say of one robot: what `golem identify` finds."""


def load_profile(name: str) -> RealismProfile:
    """Return a profile. Raises ConfigError: there is no profile of that name, or the file is none.

    Args:
        name: `"ideal"`, `"bench"` or `"field"`, or a YAML file with the `base`, one of these, and keys of `OF_A_FILE`.
            `NAME:PART+PART` is NAME with some attributes of `RealismProfile` as `ideal` has them, e.g. `field:head`.
    """
    if name in PROFILES:
        return PROFILES[name]
    start, colon, parts = name.rpartition(":")
    if colon:
        ideal, known = PROFILES["ideal"], [f.name for f in fields(RealismProfile) if f.name != "name"]
        for part in parts.split("+"):
            if part not in known:
                raise unknown_name("part of a profile", part, known)
        return replace(load_profile(start), **{part: getattr(ideal, part) for part in parts.split("+")})
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
    least = {key: getattr(profile, key) for key in ("arm_offset", "leg_offset", "actuator_delay", "backlash")}
    for key in ("leg_friction", "arm_friction"):
        low, high = getattr(profile, key) or (0.0, 0.0)
        least |= {f"{key}'s lower end": low, f"{key}'s width": high - low}
    require(f"profile {name}: ", *((what, value, value >= 0.0, "0 or more") for what, value in least.items()))
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
    """Draw the errors of one episode; each kind draws from a child of `rng`, e.g. `stream(seed, "episode")`."""
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
        R = Rotation.from_rotvec(angle * _direction(rng)).as_matrix()
        T = transform(rng.uniform(*errors.translation) * _direction(rng), R)
        if np.linalg.norm(T[:3, :3] @ ahead + T[:3, 3] - ahead) >= errors.min_error:
            return T


def _direction(rng: np.random.Generator) -> Array:
    v = rng.standard_normal(3)
    return v / np.linalg.norm(v)
