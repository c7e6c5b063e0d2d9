"""`golem demo --pack`: the robot empties an edge of a real pack by a gantry's list, as one trial of rung `pack`."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from golem.dashboard.film import Film
from golem.demo import DemoConfig
from golem.evaluation.base import TrialSpec, make_rung
from golem.evaluation.harness.run_folder import make_folder
from golem.evaluation.harness.trials import run_trial
from golem.evaluation.rung_table import RUNGS
from golem.evaluation.rungs.whole_pack import WholePackOptions
from golem.output_file import write_file
from golem.robots.mujoco.balance import BalanceRecorder
from golem.run import Narrator

OPTIONS = WholePackOptions(layout="nominal", world="ioniq5", part="edge")
METHOD = "visual_servo"
LEGS = "{use: handover, walk: {use: almi}, stand: {use: wbc}}"
"""They walk, and stand lower than their own height where the pack is low."""
SPEED, FPS = 8.0, 1.5
"""Robot time per time of the film, and pictures per second of robot time."""


class PackFilm:
    """Films what is shown to it; an `Onlooker`."""

    period = 1.0 / FPS

    def __init__(self) -> None:
        self._film: Film | None = None

    def __call__(self, running: Any, robot: Any) -> None:
        """Look on from now on."""
        self._running, self._narrator = running, Narrator(running)
        self._recorder = BalanceRecorder(robot)
        self._film = Film(robot, fps=FPS, recorder=self._recorder, speed=SPEED)
        running.executor.add(self)

    def step(self, t: float) -> None:
        """Take a picture at `t` [s]; a node of the executor."""
        self._narrator()
        self._recorder(t)
        if self._film is not None:
            self._film.frame(self._running)

    def save(self, path: Path) -> Sequence[Path]:
        """Write the film, if there is one, and return its files; errors as of `Film.save`."""
        if self._film is None:
            return ()
        self._film.close()
        return self._film.save(path)


def run_pack_demo(config: DemoConfig) -> bool:
    """Let the robot empty the edge, print what happens, and write film and figures to `config.out`.

    Returns:
        Whether every loosened fastener of the edge is in a tray, by the simulator's truth.

    Raises:
        ConfigError: an option is wrong.
        OutputError: the folder cannot be written.
    """
    make_folder(config.out)
    seed = config.seed or 0
    rung, film = make_rung(RUNGS["pack"], asdict(OPTIONS)), PackFilm()
    rung.onlooker = film
    spec = TrialSpec(rung.name, METHOD, config.profile, seed, 0, {"lower_body": LEGS}, asdict(OPTIONS))
    print(
        "The robot stands before the pack of an Ioniq 5, its rim 0.857 m high. A gantry has loosened what is along\n"
        f"the near edge, and says so in a list. One claim in {1 / OPTIONS.wrong:.0f} is wrong "
        f"(profile {config.profile}, seed {seed}). This takes minutes.",
        flush=True,
    )
    outcome = run_trial(rung, spec)
    loosened, share = outcome.series.get("loosened", 0.0), outcome.series.get("loosened_in_tray", 0.0)
    verdict = "Done" if outcome.success else "Failed"
    print(f"{verdict}: {share * loosened:.0f} of {loosened:.0f} loosened fasteners are in trays. {outcome.detail}")
    for path in film.save(config.out / "pack.webp"):
        print(f"Film:   {path}")
    facts = {"profile": config.profile, "seed": seed, "success": outcome.success, "said": outcome.detail}
    write_file(config.out / "pack.json", json.dumps({**facts, **outcome.timings, **outcome.series}, indent=2) + "\n")
    return outcome.success
