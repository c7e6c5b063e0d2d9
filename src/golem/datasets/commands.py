"""`golem dataset`: record demonstrations, and export, check, change and join data sets in LeRobot's format v3.0."""

from __future__ import annotations

import json
import math
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from tyro.conf import OmitArgPrefixes, Positional, arg

from golem.datasets.sampling import MessageRecorder, StackRecorder, recipe, write_bag
from golem.datasets.schema import Recipe
from golem.errors import ConfigError, OutputError
from golem.middleware.dds.domain import DdsConfig

if TYPE_CHECKING:
    from golem.evaluation.base import TrialSpec


@dataclass(frozen=True)
class PictureOptions:
    """What is recorded of the cameras."""

    fps: int = 15
    """Frames per second of robot time."""
    cameras: tuple[str, ...] = ()
    """Cameras whose pictures are recorded: head, left_hand, right_hand."""
    width: int = 0
    """Width of the pictures [px]; 0 is as the camera has it."""
    depth: bool = False
    """With depth, as uint16 in mm."""
    masks: tuple[str, ...] = ()
    """Labels whose masks are recorded where a skill looks for them."""

    def recipe(self) -> Recipe:
        """Return what that is."""
        return recipe(self.fps, self.cameras, self.width, self.depth, self.masks)


@dataclass(frozen=True)
class RecordDatasetConfig:
    """Record trials of a rung as demonstrations: an episode per success. A data set that is there goes on."""

    dataset: Positional[Path]
    """Folder of the data set."""
    rung: str = "tether"
    """Rung of the ladder."""
    method: str = "visual_servo"
    """Who demonstrates."""
    n: Annotated[int, arg(aliases=("-n",))] = 10
    """Trials."""
    seed: int = 1000
    """Seed; a comparison on the ladder must have another, by default it has 0."""
    profile: str = "field"
    """Realism of sensors and world: ideal, bench or field."""
    use: tuple[str, ...] = ()
    """Replace other modules of the stack, as in golem ladder."""
    stages: tuple[str, ...] = ()
    """Record these stages of the skill alone, e.g. servo grasp."""
    failures: bool = False
    """Keep lost trials, too."""
    task: str = "Take a loose screw and drop it in the tray."
    """What is done, as a sentence."""
    pictures: OmitArgPrefixes[PictureOptions] = field(default_factory=PictureOptions)


@dataclass(frozen=True)
class ExportDatasetConfig:
    """Export a bag, or the trials of a run folder, which are run again, as episodes of a data set."""

    source: Positional[Path]
    """Folder of a bag, an MCAP file, or a run folder of golem ladder."""
    dataset: Positional[Path]
    """Folder of the data set; one that is there goes on."""
    trials: tuple[str, ...] = ()
    """Of a run folder: METHOD:INDEX; default: all that succeeded."""
    task: str = "Take a loose screw and drop it in the tray."
    """What is done, as a sentence."""
    pictures: OmitArgPrefixes[PictureOptions] = field(default_factory=PictureOptions)


@dataclass(frozen=True)
class LiveDatasetConfig:
    """Record a domain as one episode of a data set, until Ctrl-C; what is not finished is not in it."""

    dataset: Positional[Path]
    """Folder of the data set; one that is there goes on."""
    seconds: float = math.inf
    """Time to record."""
    task: str = "Take a loose screw and drop it in the tray."
    """What is done, as a sentence."""
    pictures: OmitArgPrefixes[PictureOptions] = field(default_factory=PictureOptions)
    dds: OmitArgPrefixes[DdsConfig] = field(default_factory=DdsConfig)


@dataclass(frozen=True)
class ImportDatasetConfig:
    """Write an episode of a data set of this robot as a bag, which `robot: {use: replay}` and ROS 2 tools read."""

    dataset: Positional[Path]
    """Folder of the data set."""
    bag: Positional[Path]
    """Folder to create."""
    episode: int = 0
    """Which one."""


@dataclass(frozen=True)
class CheckDatasetConfig:
    """Check a data set: frame times, gaps, ranges, stuck sensors, and its videos against its table."""

    dataset: Positional[Path]
    """Folder of the data set."""


@dataclass(frozen=True)
class DeleteDatasetConfig:
    """Delete episodes; those that stay are numbered anew."""

    dataset: Positional[Path]
    """Folder of the data set."""
    episodes: Positional[tuple[int, ...]]
    """Their numbers."""


@dataclass(frozen=True)
class SplitDatasetConfig:
    """Split a data set in two: the first takes a share of the episodes, drawn by a seed."""

    dataset: Positional[Path]
    """Folder of the data set; it stays."""
    first: Positional[Path]
    """Folder to create."""
    second: Positional[Path]
    """Folder to create."""
    share: float = 0.8
    """Share of the episodes that the first one gets."""
    seed: int = 0
    """Of the draw."""


@dataclass(frozen=True)
class MergeDatasetConfig:
    """Merge data sets of the same features into a new one."""

    dataset: Positional[Path]
    """Folder to create."""
    sources: Positional[tuple[Path, ...]]
    """Folders of the data sets."""


def run_record(config: RecordDatasetConfig) -> int:
    """Record; return how many episodes were added.

    Raises:
        ConfigError: an option is wrong.
        DatasetError, OutputError, MissingExtra: see `DatasetWriter`.
    """
    from golem.evaluation.harness.ladder import LadderConfig, prepare

    if config.n < 1:
        raise ConfigError(f"-n is {config.n}; it must be 1 or more.")
    asked = LadderConfig(config.rung, (config.method,), config.n, config.profile, config.seed, use=config.use).whole()
    request, _ = prepare(asked)
    specs = request.wanted({})
    return _trials(config.dataset, specs, config.pictures.recipe(), config.task, config.stages, config.failures)


def _trials(
    root: Path, specs: Any, what: Recipe, task: str, stages: tuple[str, ...] = (), failures: bool = False
) -> int:
    """Run trials, and add those that succeed to the data set in `root`; returns how many."""
    from golem.datasets.episode_writer import DatasetWriter
    from golem.evaluation.base import RUNGS, make_rung
    from golem.evaluation.harness.trials import run_trial

    added = 0
    with closing(DatasetWriter(root, what, "golem, simulated")) as writer:
        for spec in specs:
            rung, recorders = make_rung(RUNGS[spec.rung], spec.options), list[StackRecorder]()

            def look(running: Any, robot: Any, to: list[StackRecorder] = recorders) -> None:
                to.append(StackRecorder(writer, what, running.bus, task, stages))
                running.executor.add(to[-1])

            rung.onlooker = look
            outcome = run_trial(rung, spec)
            if (outcome.success or failures) and recorders and recorders[-1].frames:
                number = writer.finish()
                print(f"Trial {spec.method}:{spec.index} is episode {number}.", flush=True)
                added += 1
            else:
                writer.discard()
                lost = outcome.detail if not outcome.success else "Nothing of it was to be recorded."
                print(f"Trial {spec.method}:{spec.index} is left out: {lost}", flush=True)
        print(f"{writer.episodes} episodes in {root}.", flush=True)
    return added


def run_export(config: ExportDatasetConfig) -> int:
    """Export; return how many episodes were added.

    Raises:
        BagError, ConfigError, DatasetError, OutputError, MissingExtra: as the parts say.
    """
    from golem.datasets.episode_writer import DatasetWriter

    what = config.pictures.recipe()
    if (config.source / "trials.jsonl").exists():
        return _trials(config.dataset, _specs(config), what, config.task)
    from golem.middleware.bags.reader import Bag

    bag = Bag(config.source)
    with closing(DatasetWriter(config.dataset, what, f"bag {config.source.name}")) as writer:
        sink = MessageRecorder(writer, what, config.task)
        for message in bag.messages(sink.topics):
            sink.write(message)
        number = writer.finish()
    print(f"{config.source} is episode {number} of {config.dataset}.")
    return 1


def _specs(config: ExportDatasetConfig) -> list[TrialSpec]:
    from golem.evaluation.harness.records import read_records

    records = {f"{r.method}:{r.index}": r for r in read_records(config.source / "trials.jsonl")}
    unknown = next((name for name in config.trials if name not in records), None)
    if unknown is not None:
        raise ConfigError(f"{config.source} has no trial {unknown}; it has {', '.join(list(records)[:5])}, ...")
    return [r.spec for k, r in records.items() if (k in config.trials if config.trials else r.success)]


def run_live(config: LiveDatasetConfig) -> int:
    """Record; return the frames of the episode.

    Raises:
        DatasetError, OutputError, MissingExtra: see `DatasetWriter`; also if nothing was on the domain.
        DdsError: the domain cannot be joined.
    """
    from golem.datasets.episode_writer import DatasetWriter
    from golem.interfaces.recorded import public_topics
    from golem.middleware.bags.recorder import Recorder
    from golem.middleware.dds.connect import connect
    from golem.middleware.interrupt import interrupted
    from golem.runtime.live.exclusive_writers import identity

    what = config.pictures.recipe()
    with (
        closing(connect(config.dds, identity("record"))) as participant,
        interrupted() as stop,
        closing(DatasetWriter(config.dataset, what, f"domain {config.dds}")) as writer,
    ):
        sink = MessageRecorder(writer, what, config.task)
        with closing(Recorder(participant, sink)) as recorder:
            recorder.add(public_topics(sink.topics))
            print(f"Recording {config.dds} to {config.dataset}. Ctrl-C ends it.", flush=True)
            recorder.run(stop, lambda: None, config.seconds)
        frames = writer.length
        print(f"{frames} frames are episode {writer.finish()} of {config.dataset}.", flush=True)
    for name in sorted(recorder.overruns):
        print(f"{name}: more than could be kept; some were lost.")
    return frames


def run_import(config: ImportDatasetConfig) -> int:
    """Write the bag; return its messages.

    Raises:
        DatasetError: the data set is of another robot, or damaged.
        OutputError: the bag cannot be written.
    """
    from golem.capabilities.policies.vectors import EFFORT, STATE
    from golem.datasets.store import DatasetFolder

    data = DatasetFolder(config.dataset)
    data.require("observation.state", "observation.effort", like={"observation.state": [*STATE]})
    data.require("observation.effort", like={"observation.effort": [*EFFORT]})
    episode = data.episode(config.episode)
    frames = {name: data.values(episode, name) for name in ("observation.state", "observation.effort")}
    for name in data.videos:
        depth = name.replace(".images.", ".depth.")
        if depth in data.features:
            frames |= {name: np.array(list(data.pictures(episode, name))), depth: data.values(episode, depth)}
    written = write_bag(frames, data.fps, config.bag)
    print(f"{written} messages in {config.bag}.")
    return written


def run_check(config: CheckDatasetConfig) -> bool:
    """Print what is wrong; return whether nothing is.

    Raises:
        DatasetError: it cannot be read at all.
    """
    from golem.datasets.findings import check
    from golem.datasets.store import DatasetFolder

    data = DatasetFolder(config.dataset)
    found = list(check(data))
    for finding in found:
        print(finding)
    frames = sum(episode.length for episode in data.episodes)
    print(f"{len(data.episodes)} episodes, {frames} frames at {data.fps} fps: {len(found) or 'no'} findings.")
    return not found


def run_delete(config: DeleteDatasetConfig) -> None:
    """Delete; errors as for `rewritten`."""
    from golem.datasets.episode_writer import drafts, rewritten
    from golem.datasets.store import DatasetFolder

    data = DatasetFolder(config.dataset)
    gone = {data.episode(k).index for k in config.episodes}
    rewritten(data, config.dataset, drafts(data, [e.index for e in data.episodes if e.index not in gone]))
    print(f"{len(data.episodes) - len(gone)} episodes are left.")


def run_split(config: SplitDatasetConfig) -> None:
    """Split; errors as for `rewritten`."""
    from golem.datasets.episode_writer import drafts, rewritten
    from golem.datasets.store import DatasetFolder

    data = DatasetFolder(config.dataset)
    n, order = len(data.episodes), np.random.default_rng(config.seed).permutation(len(data.episodes))
    count = round(config.share * n)
    if not 0 < count < n:
        raise ConfigError(f"A share of {config.share:g} of {n} episodes leaves one part empty.")
    for root, chosen in ((config.first, order[:count]), (config.second, order[count:])):
        _refuse(root)
        rewritten(data, root, drafts(data, sorted(int(k) for k in chosen)))
        print(f"{len(chosen)} episodes in {root}.")


def run_merge(config: MergeDatasetConfig) -> None:
    """Merge; errors as for `rewritten`."""
    from golem.datasets.episode_writer import drafts, rewritten
    from golem.datasets.store import DatasetFolder

    _refuse(config.dataset)
    if not config.sources:
        raise ConfigError("Say which data sets to merge.")
    data = [DatasetFolder(root) for root in config.sources]
    for other in data[1:]:
        if (other.fps, json.dumps(other.info["features"])) != (data[0].fps, json.dumps(data[0].info["features"])):
            raise ConfigError(f"{other.root} has other features or another rate than {data[0].root}.")
    episodes = [draft for each in data for draft in drafts(each)]
    rewritten(data[0], config.dataset, episodes)
    print(f"{len(episodes)} episodes in {config.dataset}.")


def _refuse(root: Path) -> None:
    if root.exists():
        raise OutputError(f"{root} exists already; give another name.")
