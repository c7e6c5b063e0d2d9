"""`golem dataset`: record demonstrations, and export, check, change and join data sets in LeRobot's format v3.0."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro
from tyro.conf import OmitArgPrefixes, Positional, arg

from golem.capabilities.policies.vectors import ACTION, STATE
from golem.datasets.episode_writer import DatasetWriter, drafts, rewritten
from golem.datasets.sampling import MessageRecorder, StackRecorder, recipe, write_bag
from golem.datasets.schema import VECTORS, DatasetError, Recipe
from golem.datasets.store import DatasetFolder, RecordedEpisode
from golem.errors import ConfigError, OutputError
from golem.middleware.dds.domain import DdsConfig
from golem.types import NUM_JOINTS, Array

TIME = 1e-4
"""How far a frame's time may be from its number [s]; LeRobot's own tolerance."""
REACH, JOINT, SPEED = 1.5, 4.0, 40.0
"""Beyond any palm [m from base_link], joint [rad] and its speed [rad/s] [own]."""
MOVED, STUCK = 0.05, 1.0
"""A joint that is told to move by so much [rad] is stuck if it reports the same number for so long [s] [own]."""


def findings(dataset: DatasetFolder) -> Iterator[str]:
    """Yield what is wrong with `dataset`, a sentence each."""
    first = 0
    for episode in dataset.episodes:
        try:
            yield from (f"Episode {episode.index}: {what}" for what in _frames(dataset, episode, first))
            for name in dataset.videos:
                yield from (f"Episode {episode.index}: {name}: {what}" for what in _video(dataset, episode, name))
        except DatasetError as error:
            yield f"Episode {episode.index}: {error}"
        first += episode.length
    used = {task for episode in dataset.episodes for task in episode.tasks}
    yield from (f"No episode does the task '{task}'." for task in sorted(set(dataset.tasks) - used))


def _frames(dataset: DatasetFolder, episode: RecordedEpisode, first: int) -> Iterator[str]:
    table, n = dataset.table(episode), episode.length
    numbers = {"frame_index": np.arange(n), "index": np.arange(first, first + n)}
    for name, wanted in numbers.items():
        got = table[name].to_numpy()
        if not np.array_equal(got, wanted):
            k = int(np.argmax(got != wanted))
            yield f"frame {k} has {name} {got[k]}, not {wanted[k]}."
    late = np.abs(table["timestamp"].to_numpy() - np.arange(n) / dataset.fps)
    if late.max() > TIME:
        k = int(np.argmax(late > TIME))
        yield f"frame {k} is {1e3 * late[k]:.1f} ms off its time; {int((late > TIME).sum())} frames are."
    tasks = table["task_index"].to_numpy()
    if not np.isin(tasks, [dataset.tasks.index(task) for task in episode.tasks if task in dataset.tasks]).all():
        yield f"its frames name task {tasks[0]}, which is none of its tasks."
    vectors = {k: f for k, f in dataset.features.items() if len(f.shape) == 1 and "float" in f.dtype}
    values = {name: dataset.values(episode, name).reshape(n, -1) for name in vectors}
    for name, x in values.items():
        if not np.isfinite(x).all():
            k, i = np.argwhere(~np.isfinite(x))[0]
            yield f"{name} of frame {k} is not finite at {(vectors[name].names or range(x.shape[1]))[i]}."
            return
    for name, entries in (("observation.state", [*STATE]), ("action", [*ACTION])):
        if name in values and list(vectors[name].names or ()) == entries:
            yield from _ranges(values[name], entries)
            if name == "observation.state" and "command.joints" in values:
                yield from _stuck(values[name][:, :NUM_JOINTS], values["command.joints"], dataset.fps)


def _ranges(x: Array, names: list[str]) -> Iterator[str]:
    for i, name in enumerate(names):
        bound = SPEED if name.endswith(".vel") else REACH if "palm." in name else JOINT
        if "force" not in name and (worst := float(np.abs(x[:, i]).max())) > bound:
            yield f"{name} is {worst:.3g}, beyond {bound:g}."


def _stuck(q: Array, command: Array, fps: int) -> Iterator[str]:
    """Find joints that report one number while they are told to move."""
    n = max(round(STUCK * fps), 2)
    for j, name in enumerate([*STATE][:NUM_JOINTS]):
        for k in range(0, len(q) - n + 1, n):
            if np.ptp(q[k : k + n, j]) == 0.0 and np.ptp(command[k : k + n, j]) > MOVED:
                yield f"{name} is stuck at {q[k, j]:.4f} from {k / fps:.1f} s on, while its target moves."
                break


def _video(dataset: DatasetFolder, episode: RecordedEpisode, name: str) -> Iterator[str]:
    height, width = dataset.features[name].shape[:2]
    state = dataset.values(episode, "observation.state") if "observation.state" in dataset.features else None
    same, n, last = 0, max(round(STUCK * dataset.fps), 2), np.zeros(0)
    for k, picture in enumerate(dataset.pictures(episode, name)):
        if picture.shape[:2] != (height, width):
            yield f"its pictures are {picture.shape[1]} x {picture.shape[0]}, not {width} x {height}."
            return
        same, last = same + 1 if np.array_equal(picture[::8, ::8], last) else 0, picture[::8, ::8]
        moved = state is None or np.abs(state[k] - state[max(k - n, 0)])[:NUM_JOINTS].max() > MOVED
        if same == n and moved:
            yield f"it shows one picture from {(k - n) / dataset.fps:.1f} s on, while the robot moves."
            return


TASK = "Take a loose screw and drop it in the tray."


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


Pictures = OmitArgPrefixes[PictureOptions]
_PLAIN = PictureOptions()


def record(
    dataset: Positional[Path],
    rung: str = "tether",
    method: str = "visual_servo",
    n: Annotated[int, arg(aliases=("-n",))] = 10,
    seed: int = 1000,
    profile: str = "field",
    use: tuple[str, ...] = (),
    stages: tuple[str, ...] = (),
    failures: bool = False,
    task: str = TASK,
    pictures: Pictures = _PLAIN,
) -> int:
    """Record trials of a rung as demonstrations: an episode per success. A data set that is there goes on.

    Args:
        dataset: folder of the data set.
        rung: of the ladder.
        method: who demonstrates.
        n: trials.
        seed: a comparison on the ladder must have another, by default it has 0.
        profile: ideal, bench or field.
        use: replace other modules of the stack, as in golem ladder.
        stages: record these stages of the skill alone, e.g. servo grasp.
        failures: keep lost trials, too.
        task: what is done, as a sentence.
        pictures: see there.
    """
    from golem.evaluation.harness.ladder import LadderConfig, prepare

    request, _ = prepare(LadderConfig(rung, (method,), n, profile, seed, use=use).whole())
    return _trials(dataset, request.wanted({}), pictures.recipe(), task, stages, failures)


def _trials(root: Path, specs: Any, what: Recipe, task: str, stages: tuple[str, ...], failures: bool) -> int:
    """Run trials, and add those that succeed to the data set in `root`; returns how many."""
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
            if (outcome.success or failures) and recorders and recorders[-1].begun:
                print(f"Trial {spec.method}:{spec.index} is episode {writer.finish()}.", flush=True)
                added += 1
            else:
                writer.discard()
                print(f"Trial {spec.method}:{spec.index} is left out: {outcome.detail}", flush=True)
        print(f"{writer.episodes} episodes in {root}.", flush=True)
    return added


def export(
    source: Positional[Path],
    dataset: Positional[Path],
    trials: tuple[str, ...] = (),
    task: str = TASK,
    pictures: Pictures = _PLAIN,
) -> int:
    """Export a bag, or the trials of a run folder, which are run again, as episodes of a data set.

    Args:
        source: folder of a bag, an MCAP file, or a run folder of golem ladder.
        dataset: folder of the data set; one that is there goes on.
        trials: of a run folder: METHOD:INDEX; default: all that succeeded.
        task: what is done, as a sentence.
        pictures: see there.
    """
    what = pictures.recipe()
    if (source / "trials.jsonl").exists():
        from golem.evaluation.harness.records import read_records

        records = {f"{r.method}:{r.index}": r for r in read_records(source / "trials.jsonl")}
        unknown = next((name for name in trials if name not in records), None)
        if unknown is not None:
            raise ConfigError(f"{source} has no trial {unknown}; it has {', '.join(list(records)[:5])}, ...")
        specs = [r.spec for name, r in records.items() if (name in trials if trials else r.success)]
        return _trials(dataset, specs, what, task, (), False)
    from golem.middleware.bags.reader import Bag

    bag = Bag(source)
    with closing(DatasetWriter(dataset, what, f"bag {source.name}")) as writer:
        sink = MessageRecorder(writer, what, task)
        for message in bag.messages(sink.topics):
            sink.write(message)
        print(f"{source} is episode {writer.finish()} of {dataset}.")
    return 1


def live(
    dataset: Positional[Path],
    seconds: float = math.inf,
    task: str = TASK,
    pictures: Pictures = _PLAIN,
    dds: OmitArgPrefixes[DdsConfig] = DdsConfig(),  # noqa: B008 - frozen
) -> int:
    """Record a domain as one episode of a data set, until Ctrl-C; what is not finished is not in it.

    Args:
        dataset: folder of the data set; one that is there goes on.
        seconds: time to record.
        task: what is done, as a sentence.
        pictures: see there.
        dds: the domain.
    """
    from golem.interfaces.recorded import public_topics
    from golem.middleware.bags.recorder import Recorder
    from golem.middleware.dds.connect import connect
    from golem.middleware.interrupt import interrupted
    from golem.runtime.live.exclusive_writers import identity

    what = pictures.recipe()
    with (
        closing(connect(dds, identity("record"))) as participant,
        interrupted() as stop,
        closing(DatasetWriter(dataset, what, f"domain {dds}")) as writer,
    ):
        sink = MessageRecorder(writer, what, task)
        with closing(Recorder(participant, sink)) as recorder:
            recorder.add(public_topics(sink.topics))
            print(f"Recording {dds} to {dataset}. Ctrl-C ends it.", flush=True)
            recorder.run(stop, lambda: None, seconds)
        frames = writer.length
        print(f"{frames} frames are episode {writer.finish()} of {dataset}.", flush=True)
    for name in sorted(recorder.overruns):
        print(f"{name}: more than could be kept; some were lost.")
    return frames


def to_bag(dataset: Positional[Path], bag: Positional[Path], episode: int = 0) -> int:
    """Write an episode of a data set of this robot as a bag, which `robot: {use: replay}` and ROS 2 tools read."""
    data, names = DatasetFolder(dataset), ("observation.state", "observation.effort")
    data.require(*names, like={name: [*VECTORS[name]] for name in names})
    chosen = data.episode(episode)
    frames = {name: data.values(chosen, name) for name in names}
    for name in data.videos:
        depth = name.replace(".images.", ".depth.")
        if depth in data.features:
            frames |= {name: np.array(list(data.pictures(chosen, name))), depth: data.values(chosen, depth)}
    written = write_bag(frames, data.fps, bag)
    print(f"{written} messages in {bag}.")
    return written


def check(dataset: Positional[Path]) -> bool:
    """Check a data set: frame times, gaps, ranges, stuck sensors, and its videos against its table."""
    data = DatasetFolder(dataset)
    found = list(findings(data))
    frames = sum(episode.length for episode in data.episodes)
    told = f"{len(data.episodes)} episodes, {frames} frames at {data.fps} fps: {len(found) or 'no'} findings."
    print(*found, told, sep="\n")
    return not found


def delete(dataset: Positional[Path], episodes: Positional[tuple[int, ...]]) -> None:
    """Delete episodes; those that stay are numbered anew."""
    data = DatasetFolder(dataset)
    gone = {data.episode(k).index for k in episodes}
    rewritten(data, dataset, drafts(data, [e.index for e in data.episodes if e.index not in gone]))
    print(f"{len(data.episodes) - len(gone)} episodes are left.")


def split(
    dataset: Positional[Path], first: Positional[Path], second: Positional[Path], share: float = 0.8, seed: int = 0
) -> None:
    """Split a data set in two new ones: the first takes a share of the episodes, drawn by a seed."""
    data = DatasetFolder(dataset)
    n = len(data.episodes)
    order, count = np.random.default_rng(seed).permutation(n), round(share * n)
    if not 0 < count < n:
        raise ConfigError(f"A share of {share:g} of {n} episodes leaves one part empty.")
    if first.resolve() == second.resolve():
        raise ConfigError(f"Both parts would be {first}; name two new folders.")
    _refuse(first, second)
    for root, chosen in ((first, order[:count]), (second, order[count:])):
        rewritten(data, root, drafts(data, sorted(int(k) for k in chosen)))
        print(f"{len(chosen)} episodes in {root}.")


def merge(dataset: Positional[Path], sources: Positional[tuple[Path, ...]]) -> None:
    """Merge data sets of the same features into a new one."""
    _refuse(dataset)
    if not sources:
        raise ConfigError("Say which data sets to merge.")
    data = [DatasetFolder(root) for root in sources]
    for other in data[1:]:
        if (other.fps, other.info["features"]) != (data[0].fps, data[0].info["features"]):
            raise ConfigError(f"{other.root} has other features or another rate than {data[0].root}.")
        if other.labels != data[0].labels:
            one, two = (" ".join(each.labels) for each in (data[0], other))
            raise ConfigError(f"The masks of {data[0].root} are of '{one}', those of {other.root} of '{two}'.")
    episodes = [draft for each in data for draft in drafts(each)]
    rewritten(data[0], dataset, episodes)
    print(f"{len(episodes)} episodes in {dataset}.")


def _refuse(*roots: Path) -> None:
    for root in roots:
        if root.exists():
            raise OutputError(f"{root} exists already; give another name.")


COMMANDS: dict[str, Callable[..., object]] = {
    **{each.__name__: each for each in (record, live, export, check, delete, split, merge)},
    "import": to_bag,
}


def run(name: str, words: Sequence[str]) -> object:
    """Run `golem dataset NAME` with the `words` that follow it."""
    return tyro.cli(COMMANDS[name], prog=f"golem dataset {name}", args=list(words))
