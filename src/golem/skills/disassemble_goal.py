"""What `disassemble` is asked, and what it found out."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from golem.errors import ConfigError
from golem.options import require
from golem.skills.dock import DockGoal, DockReport
from golem.skills.kept_file import check_file_name
from golem.skills.pick_config import PickGoal, PickReport

Loosened = Literal["all", "list", "gantry", "unknown"]


@dataclass(frozen=True, slots=True)
class DisassembleGoal:
    """What to take out.

    Attributes:
        count: objects to pick where there is no list.
        docks: how often the robot may look for another stance then, the first time included; 0 stays where it is.
        dock: how it docks then.
        pick: what it picks then, with which hand.
        list: a CSV file of all fasteners of the pack, in the folder of the skill: they are taken out one by one. Empty:
            none, or that of the `job`.
        job: the file that keeps what was done, `.sqlite`, in that folder; a job that is there is gone on with. Empty:
            called as the list.
        loosened: which of the list are loose: `all`; those that the `list` says, no others being tried; those that a
            `gantry` beside the robot is done with; or `unknown`: each is tried, and one that is tight is tried again
            only if the list says that it is loose.
        side: of the pack at which the robot stands when it begins or goes on.
        screws, nuts: classes of what screws and nuts are put into; the next one where one is full.
    """

    count: int = 1
    docks: int = 3
    dock: DockGoal = field(default_factory=DockGoal)
    pick: PickGoal = field(default_factory=lambda: PickGoal(side="either"))
    list: str = ""
    job: str = ""
    loosened: Loosened = "all"
    side: Literal["near", "left", "far", "right"] = "near"
    screws: tuple[str, ...] = ("tray",)
    nuts: tuple[str, ...] = ("tray",)

    def __post_init__(self) -> None:
        require(
            "goal of disassembling: ",
            ("count", self.count, 1 <= self.count <= 100, "from 1 to 100"),
            ("docks", self.docks, 0 <= self.docks <= 20, "from 0 to 20"),
        )
        check_file_name(self.list, ".csv")
        check_file_name(self.job, ".sqlite")
        if not (self.screws and self.nuts and all((*self.screws, *self.nuts))):
            raise ConfigError("Disassembling names the classes of what screws and nuts are put into, such as tray.")


@dataclass
class DisassembleReport:
    """What was done.

    Attributes:
        picked: objects in the container.
        docks: how the robot stood after every docking, in order.
        picks: what every pick found out, in order.
        fates: what became of every fastener of the list, in its order, as `job_file.Fate`.
        stops: stops of the first plan.
        planned: way of the first plan [m].
        inventory: path of the page about it all.
    """

    picked: int = 0
    docks: list[DockReport] = field(default_factory=list[DockReport])
    picks: list[PickReport] = field(default_factory=list[PickReport])
    fates: list[str] = field(default_factory=list[str])
    stops: int = 0
    planned: float = 0.0
    inventory: str = ""
