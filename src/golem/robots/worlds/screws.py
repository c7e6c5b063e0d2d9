"""Loosened screws: free bodies that stand in real bores, and the draw of their properties.

A bore is a ring of 12 boxes whose inner faces touch the circle of the bore, closed by a bottom on which the end of
the shank stands, so that the head stands proud by the protrusion: the passive stand-in for the thread or the sealant
that keeps a loosened screw where it is. The bore, not the screw, carries the tilt, so that a tilted screw is at rest.
No geom here has a contact margin: with a fraction of a millimetre of clearance it would be an interference fit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from golem.robots.worlds import parts
from golem.robots.worlds.layout import Kind
from golem.robots.worlds.parts import BOX, CYLINDER
from golem.types import Array

FACETS = 12
RING_OUTER = 0.0105
"""Outer face of the bore's boxes [m]; covers the corners of the square cut out of the rim (`layout.HOLE_CELL`)."""
SOLREF = (0.002, 1.0)
"""Contact time constant [s] and damping ratio of screw and bore."""
DRESSED_FLOOR = 0.004
"""Thickness of the bore's bottom [m]."""


@dataclass(frozen=True, slots=True)
class ScrewRanges:
    """Uniform ranges of what differs from screw to screw; assumed, after M5 and M6 cover screws.

    Attributes:
        friction: sliding friction coefficient of screw, bore and pad.
        clearance: bore diameter minus shank diameter [m].
        protrusion: shank length showing between cover and head [m].
        tilt: angle of the bore axis from the vertical [rad].
        shank_diameter, shank_length, head_diameter, head_height: [m].
        mass: [kg].
    """

    friction: tuple[float, float] = (0.15, 0.60)
    clearance: tuple[float, float] = (0.0001, 0.0006)
    protrusion: tuple[float, float] = (0.005, 0.012)
    tilt: tuple[float, float] = (0.0, np.deg2rad(3.0))
    shank_diameter: tuple[float, float] = (0.005, 0.006)
    shank_length: tuple[float, float] = (0.016, 0.025)
    head_diameter: tuple[float, float] = (0.010, 0.013)
    head_height: tuple[float, float] = (0.005, 0.007)
    mass: tuple[float, float] = (0.015, 0.030)

    def lower(self) -> ScrewRanges:
        """Return those of a varied work place: from 3 mm on, so that no gap sets loose heads off from tight ones."""
        low, high = self.protrusion
        return replace(self, protrusion=(min(low, 0.003) if low < high else low, high))

    def of(self, kind: Kind) -> ScrewRanges:
        """Return those of M6 flange nuts, whose shank is the stud above its seat, or of an M8 bolt; assumed."""
        if kind == "nut":
            low, high = self.protrusion
            return replace(
                self, protrusion=(0.8 * low, 0.8 * high), shank_diameter=(0.0058, 0.006),
                shank_length=(0.012, 0.016), head_diameter=(0.012, 0.014), mass=(0.004, 0.008),
            )  # fmt: skip
        if kind == "bolt":
            return replace(self, shank_diameter=(0.0078, 0.008), head_diameter=(0.015, 0.016), mass=(0.03, 0.045))
        return self


@dataclass(frozen=True, slots=True)
class ScrewDraw:
    """One loosened screw and its bore.

    Attributes:
        slot: index of its place, as in `PackLayout.fasteners`.
        hexagonal: hexagon with flange (True) or cylinder head.
        kind: what it is; see `ScrewRanges.of` for what the lengths of a nut mean.
        tilt: angle of the bore axis from the vertical [rad].
        tilt_azimuth: direction the head leans to, from the x axis [rad].
        friction, clearance, protrusion, shank_diameter, shank_length, head_diameter, head_height, mass: as in
            `ScrewRanges`.
    """

    slot: int
    friction: float
    clearance: float
    protrusion: float
    tilt: float
    tilt_azimuth: float
    shank_diameter: float
    shank_length: float
    head_diameter: float
    head_height: float
    mass: float
    hexagonal: bool
    kind: Kind = "screw"

    @property
    def name(self) -> str:
        """Name of its body and free joint."""
        return f"{self.kind}_{self.slot:02d}"

    @property
    def engaged(self) -> float:
        """Length of shank inside the bore at rest [m]."""
        return self.shank_length - self.protrusion

    @property
    def bore_radius(self) -> float:
        """Radius of the circle the bore's facets touch [m]."""
        return (self.shank_diameter + self.clearance) / 2

    def axis(self) -> Array:
        """Return the (3,) unit vector along the bore, out of the cover, in the pack frame."""
        s, c = np.sin(self.tilt), np.cos(self.tilt)
        return np.array([s * np.cos(self.tilt_azimuth), s * np.sin(self.tilt_azimuth), c])

    def quat(self) -> list[float]:
        """Return the orientation (wxyz) of bore and screw in the pack frame: z along `axis`."""
        half = self.tilt / 2
        a = self.tilt_azimuth
        return [np.cos(half), -np.sin(half) * np.sin(a), np.sin(half) * np.cos(a), 0.0]


def draw_screws(
    rng: np.random.Generator, ranges: ScrewRanges, slots: Sequence[int], kind: Callable[[int], Kind] = lambda _: "screw"
) -> list[ScrewDraw]:
    """Draw one loosened fastener of its `kind` for each of `slots`; the same generator state gives the same."""

    def uniform(span: tuple[float, float]) -> float:
        return float(rng.uniform(*span))

    draws: list[ScrewDraw] = []
    for slot in slots:
        r = ranges.of(kind(slot))
        draws.append(
            ScrewDraw(
                slot=slot,
                friction=uniform(r.friction),
                clearance=uniform(r.clearance),
                protrusion=uniform(r.protrusion),
                tilt=uniform(r.tilt),
                tilt_azimuth=uniform((-np.pi, np.pi)),
                shank_diameter=uniform(r.shank_diameter),
                shank_length=uniform(r.shank_length),
                head_diameter=uniform(r.head_diameter),
                head_height=uniform(r.head_height),
                mass=uniform(r.mass),
                hexagonal=bool(rng.random() < 0.7),
                kind=kind(slot),
            )
        )
    return draws


def add_bore(parent: mujoco.MjsBody, draw: ScrewDraw, mouth: Sequence[float]) -> None:
    """Add the bore of `draw` as a static body whose mouth is centred at `mouth` (x, y, z in the parent frame)."""
    body = parent.add_body(name=f"bore_{draw.slot:02d}", pos=list(mouth), quat=draw.quat())
    # The mouth's facets end below the rim plane by what the tilt lifts them, so that no edge stands out.
    lift = RING_OUTER * np.sin(draw.tilt)
    depth = draw.engaged + DRESSED_FLOOR
    half_width = RING_OUTER * np.tan(np.pi / FACETS)
    inner = draw.bore_radius
    for k in range(FACETS):
        a = 2 * np.pi * k / FACETS
        mid = (inner + RING_OUTER) / 2
        parts.collider(
            body,
            BOX,
            ((RING_OUTER - inner) / 2, half_width, (depth - lift) / 2),
            (mid * np.cos(a), mid * np.sin(a), -(depth + lift) / 2),
            quat=(np.cos(a / 2), 0.0, 0.0, np.sin(a / 2)),
            friction=draw.friction,
            solref=SOLREF,
        )
    half = DRESSED_FLOOR / 2
    size, pos = (inner * 1.2, inner * 1.2, half), (0.0, 0.0, -draw.engaged - half)
    parts.collider(body, BOX, size, pos, friction=draw.friction, solref=SOLREF)


def loosened(
    spec: mujoco.MjSpec, draw: ScrewDraw, spot: Sequence[float], T_world_pack: Array, *, sleep: bool = True
) -> mujoco.MjsBody:
    """Add the free body of `draw`, without geoms, proud of its `spot` (3,) in the pack frame `T_world_pack` (4, 4).

    The body frame lies on the axis of the shank at the underside of head or nut, z towards the top. With `sleep`,
    MuJoCo puts it to sleep while undisturbed (takes effect when the sleep flag is on).
    """
    mouth = T_world_pack @ (*spot, 1.0)
    pos = mouth[:3] + draw.protrusion * (T_world_pack[:3, :3] @ draw.axis())
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, T_world_pack[:3, :3].ravel())
    mujoco.mju_mulQuat(quat, quat.copy(), np.array(draw.quat()))
    body = spec.worldbody.add_body(name=draw.name, pos=pos.tolist(), quat=quat.tolist())
    body.sleep = mujoco.mjtSleepPolicy.mjSLEEP_ALLOWED if sleep else mujoco.mjtSleepPolicy.mjSLEEP_NEVER
    body.add_freejoint(name=draw.name)
    return body


def add_screw(
    spec: mujoco.MjSpec, draw: ScrewDraw, spot: Sequence[float], T_world_pack: Array, *, sleep: bool = True
) -> str:
    """Add the free body of `draw`, standing in its bore; see `loosened`. Returns the name of body and joint."""
    name, body = draw.name, loosened(spec, draw, spot, T_world_pack, sleep=sleep)
    head_volume = draw.head_diameter**2 * draw.head_height
    shank_volume = draw.shank_diameter**2 * draw.shank_length
    head_mass = draw.mass * head_volume / (head_volume + shank_volume)
    common = {"friction": draw.friction, "solref": SOLREF}
    parts.collider(
        body, CYLINDER, (draw.head_diameter / 2, draw.head_height / 2), (0, 0, draw.head_height / 2),
        name=f"{name}_head", mass=head_mass, **common,
    )  # fmt: skip
    parts.collider(
        body, CYLINDER, (draw.shank_diameter / 2, draw.shank_length / 2), (0, 0, -draw.shank_length / 2),
        name=f"{name}_shank", mass=draw.mass - head_mass, **common,
    )  # fmt: skip
    _add_looks(spec, body, draw, name)
    return name


def _add_looks(spec: mujoco.MjSpec, body: mujoco.MjsBody, draw: ScrewDraw, name: str) -> None:
    radius, height = draw.head_diameter / 2, draw.head_height
    if draw.hexagonal:
        flange = parts.lathe([(radius, 0.0), (radius, 0.0012), (radius * 0.82, 0.002)], sides=28)
        top = parts.hexagon(radius * 1.5, height)
    else:
        edge = 0.0008
        socket = [(radius * 0.5, height), (radius * 0.45, height * 0.4)]
        flange = parts.lathe([(radius, 0.0), (radius, height - edge), (radius - edge, height), *socket], sides=28)
        top = None
    parts.visual_mesh(body, parts.add_mesh(spec, f"{name}_flange", *flange), material="zinc", name=f"{name}_flange")
    if top is not None:
        parts.visual_mesh(body, parts.add_mesh(spec, f"{name}_hex", *top), material="zinc", name=f"{name}_hex")
    pitch = 0.001
    turns = int((draw.shank_length - 0.004) / pitch)
    r = draw.shank_diameter / 2
    profile = [(r * 0.7, -draw.shank_length), (r, -draw.shank_length + 0.001)]
    for k in range(turns):
        z = -draw.shank_length + 0.001 + k * pitch
        profile += [(r * 0.86, z + pitch / 2), (r, z + pitch)]
    profile.append((r * 0.95, 0.0))
    thread = parts.add_mesh(spec, f"{name}_thread", *parts.lathe(profile, sides=12))
    parts.visual_mesh(body, thread, material="steel", name=f"{name}_thread")
