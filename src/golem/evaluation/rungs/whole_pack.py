"""Rung `pack`: take everything that a gantry has loosened out of a pack, alone, from first look to inventory."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal

import numpy as np

from golem.evaluation.base import DONE, Outcomes, TrialOutcome, TrialSpec
from golem.evaluation.episodes.episode import Episode, episode_seed
from golem.evaluation.episodes.gantry_cell import GantryCell
from golem.evaluation.episodes.oracle import ContactWatch, Oracle, Whereabouts, whereabouts
from golem.evaluation.episodes.pick_watch import PickTouches
from golem.evaluation.metrics.text_table import TextTable
from golem.evaluation.rungs.calibrated_robot import calibrated
from golem.evaluation.rungs.pick_screw import SETTLE
from golem.evaluation.rungs.var_stand import STILL, VarStandRung
from golem.robots.mujoco.scene import Scene
from golem.robots.worlds.conditions import REACH_Y, LayoutKind
from golem.robots.worlds.layout import KINDS, PackLayout
from golem.skills.disassemble import JOB, Disassemble
from golem.skills.disassemble_goal import DisassembleGoal, DisassembleReport, Loosened
from golem.skills.job_file import Fate
from golem.skills.kept_file import KeptFileConfig
from golem.skills.pick_config import PickGoal
from golem.slots import KEYS
from golem.types import Array

AWAY = 0.5
"""Distance behind the nominal stance at which the robot begins [m]."""
EDGE = 0.05
"""Fasteners this near to the near edge belong to it [m]."""
HEAD = 0.006
"""Height of a head above its place [m]."""
TIP = 0.03
"""Height of a gantry's tip above the place whose fastener it loosens [m]."""
LOOK = 0.2
"""Time between two looks at where the robot is [s]."""
UNCLAIMED = "unclaimed"
"""What became of a loosened fastener that the gantry calls tight, and that nobody asked for."""
BLAME = {
    Fate.MISSING.value: "localizer",
    Fate.NOT_FOUND.value: "localizer",
    Fate.OUT_OF_REACH.value: "skill",
    Fate.OPEN.value: "skill",
    UNCLAIMED: "list",
}
"""Slot that loses a fastener of a fate; the others are lost by the grasp method."""


@dataclass(frozen=True)
class WholePackOptions:
    """The pack, and what the gantry says."""

    layout: LayoutKind = "varied"
    """nominal or varied; see the rung `stand`."""
    sweep: str = ""
    """As on the rung `stand`."""
    world: Literal["pack", "ioniq5"] = "pack"
    """The pack; see the rung `stand`."""
    part: Literal["whole", "edge"] = "whole"
    """whole: the gantry has been all round. edge: along the near edge only."""
    wrong: float = 0.05
    """Share of the fasteners of which the gantry says the wrong thing."""
    place: float = 0.002
    """Deviation of a place in the list along each axis [m]."""
    kind: float = 0.0
    """Share of the fasteners that the list calls by another class."""
    calibrated: str = ""
    """Folder of calibrations: the robot is calibrated first, by `calibrate` and `calibrate_hands`; empty: it is not."""
    gantry: bool = False
    """Whether the gantry works beside the robot, a fastener in 20 s, and has not been there before."""


class WholePackRung(VarStandRung):
    """Take out what is loose, by a list of the pack in which some claims are wrong.

    A trial is a success where every loosened fastener is in the tray; `loosened_in_tray` is their share. What is not
    there is blamed on the module by what the robot says of it: `lost_NAME` counts them.
    """

    name = "pack"
    Options = WholePackOptions
    options: Any
    default_n = 10
    varied = {}

    @property
    def _goal(self) -> PickGoal:
        return PickGoal(side="either")

    def run(self, spec: TrialSpec, artefacts: Path | None) -> TrialOutcome:
        stack = self._stack(spec.method, spec.profile, spec.overrides).with_options(
            "robot", layout=self.options.layout, conditions=dict(spec.case), stance=[AWAY, 0.0, 0.0],
            world=self.options.world, obstacles=0, reach_y=REACH_Y, gantry=self.options.gantry,
        )  # fmt: skip
        folder, seed = TemporaryDirectory(), episode_seed(spec.seed, spec.index)
        if self.options.calibrated:
            stack = calibrated(stack, seed, self.options.calibrated)
        with folder, closing(Episode(stack, seed, self.onlooker)) as episode:
            scene, robot = episode.robot.scene, episode.robot
            part = asked_for(scene.layout, self.options)
            claims = write_claims(Path(folder.name) / "pack.csv", scene, self.options, spec.rng("claims"))
            with closing(Oracle(robot)) as oracle:
                episode.stand(STILL)
                touches = PickTouches(robot, oracle.fasteners(), oracle.T_world_odom)
                contacts, at, walked, due = ContactWatch(robot), robot.truth.pose(), 0.0, 0.0

                def look() -> bool:
                    nonlocal at, walked, due
                    touches()
                    if gantry is not None and episode.t >= gantry.due:
                        gantry(episode.t)
                    contacts(episode.t)
                    if episode.t >= due:
                        now, due = robot.truth.pose(), episode.t + LOOK
                        at, walked = now, walked + math.hypot(now.x - at.x, now.y - at.y)
                    return episode.result is not None

                def wake() -> float:
                    return min(touches.due(), contacts.due(), due, gantry.due if gantry else math.inf)

                start = episode.t
                # Of a whole pack everything is tried, since some of what the list calls tight is loose.
                some: Loosened = "list" if self.options.part == "edge" else "unknown"
                goal = DisassembleGoal(list="pack.csv", loosened="gantry" if self.options.gantry else some)
                visits = [(claim_name(slot), place_above(scene.layout, slot)) for slot, claimed in claims if claimed]
                gantry = GantryCell(robot, episode.running.bus, visits, start) if self.options.gantry else None
                episode.start(Disassemble(KeptFileConfig(folder.name)), goal)
                episode.run(JOB, look, wake)
                took, result, loss = episode.t - start, episode.result, episode.loss
                episode.run(SETTLE)
                found = result.value if result is not None and isinstance(result.value, DisassembleReport) else None
                fates = found.fates if found is not None else [Fate.OPEN] * len(claims)
                series = judged(
                    claims, [Fate(fate) for fate in fates], [w for w in whereabouts(robot) if w.slot in part]
                )
                series |= {**touches.series(), "contacts": float(len(contacts.touched)), "distance": walked}
                series |= {"dockings": float(len(found.docks)), "planned": found.planned} if found is not None else {}
                success = loss is None and series["loosened_in_tray"] == 1.0
                stage = DONE if success else loss.stage if loss is not None else "pack"
                worst = max(BLAME.values() if loss else lost_by(series), key=lost_by(series).count, default=None)
                slot = None if success else "lower_body" if loss is not None else worst
                named = {"skill": "disassemble", "list": "gantry"}
                module = f"{slot}: {stack.choice(slot).use}" if slot in KEYS else slot and f"{slot}: {named[slot]}"
                said = loss.detail if loss is not None else "" if result is None else result.reason
                return TrialOutcome(success, stage, module, said, {"total": took}, series, oracle.picture())

    def tables(self, outcomes: Outcomes) -> Sequence[TextTable]:
        rows: list[tuple[str, ...]] = []
        for method, trials in outcomes.items():
            count = Counter[str]()
            for _, outcome in trials:
                count.update({k[5:]: round(v) for k, v in outcome.series.items() if k.startswith("lost_")})
            rows += [(method, fate, str(n), BLAME.get(fate, "grasp_method")) for fate, n in count.most_common()]
        note = "By what the robot says of them; `in_tray` are those of which it wrongly says that they are there."
        return [
            TextTable("Loosened fasteners in no tray", ("method", "said", "fasteners", "blamed"), tuple(rows), note)
        ]


def asked_for(layout: PackLayout, options: WholePackOptions) -> set[int]:
    """Return the places at which the gantry has been."""
    return {slot for slot, at in enumerate(layout.fasteners()) if options.part == "whole" or at[0] < EDGE}


def write_claims(
    file: Path, scene: Scene, options: WholePackOptions, rng: np.random.Generator
) -> list[tuple[int, bool]]:
    """Write the list of a pack as a gantry would; return the place and the claim of each of its fasteners."""
    layout, loose, places = scene.layout, {draw.slot for draw in scene.draws}, scene.layout.fasteners()
    rows, claims, asked = list[str](), list[tuple[int, bool]](), asked_for(layout, options)
    trays = layout.trays()
    apart = len({tray.kind for tray in trays}) > 1
    for tray in trays:
        x, y, z, _ = np.linalg.inv(layout.pose()) @ (tray.x, tray.y, tray.z, 1.0)
        rows.append(f"tray,{x:.4f},{y:.4f},{z:.4f},,,{tray.kind if apart else ''}")
    wrong = rng.random(len(places)) < options.wrong
    listed = places + options.place * rng.normal(size=places.shape)
    other = (rng.random(len(listed)) < options.kind) * rng.integers(1, len(KINDS), len(listed))
    for slot, (x, y, z) in enumerate(listed.tolist()):
        if slot not in layout.empty_holes or slot in loose:
            claimed = (slot in loose) != bool(wrong[slot]) and slot in asked
            claims.append((slot, claimed))
            kind = KINDS[(KINDS.index(layout.kind(slot)) + other[slot]) % len(KINDS)]
            rows.append(f"{kind},{x:.4f},{y:.4f},{z + HEAD:.4f},{int(claimed)},{claim_name(slot)},")
    file.write_text("\n".join(["class,x,y,z,loose,name,takes", *rows]), encoding="utf-8")
    return claims


def claim_name(slot: int) -> str:
    """Return what the gantry calls what is in a place."""
    return f"Part_{slot}"


def place_above(layout: PackLayout, slot: int) -> Array:
    """Return (3,) where the tip of a gantry's tool loosens what is in a place, in the world [m]."""
    return (layout.pose() @ (*layout.fasteners()[slot] + (0.0, 0.0, TIP), 1.0))[:3]


def judged(claims: Sequence[tuple[int, bool]], fates: Sequence[Fate], found: Sequence[Whereabouts]) -> dict[str, float]:
    """Return what became of the loosened fasteners, and which of the robot's words are wrong, as figures."""
    there = {one.slot: one.where == "tray" for one in found if one.loose}
    said = {slot: (claimed, fate) for (slot, claimed), fate in zip(claims, fates, strict=True)}
    asked = {s for s, (claimed, fate) in said.items() if claimed or fate is not Fate.OPEN}
    lost = Counter(said[s][1].value if s in asked else UNCLAIMED for s, inside in there.items() if not inside)
    wrong = [fate for slot, (claimed, fate) in said.items() if claimed and slot not in there]
    missed = [slot for slot, inside in there.items() if not inside and said[slot][0]]
    boasts = [slot for slot, (_, fate) in said.items() if fate is Fate.IN_TRAY and not there.get(slot, False)]
    series = {f"lost_{fate}": float(n) for fate, n in lost.items()}
    right = sum(one.right for one in found if one.loose)
    series |= {"loosened_in_tray": sum(there.values()) / max(len(there), 1), "wrong_in_tray": float(len(boasts))}
    series |= {"right_tray": right / max(len(there), 1)}
    series |= {"loosened": float(len(there)), "wrong_refusals": float(len(missed))}
    return series | ({"false_claims_found": sum(f is Fate.TIGHT for f in wrong) / len(wrong)} if wrong else {})


def lost_by(series: dict[str, float]) -> list[str]:
    """Return the slot that lost each fastener that is in no tray."""
    lost = [(k[5:], round(n)) for k, n in series.items() if k.startswith("lost_")]
    return [BLAME.get(fate, "grasp_method") for fate, n in lost for _ in range(n)]
