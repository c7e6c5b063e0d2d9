"""`golem dataset check`: what is wrong with a data set, before somebody trains on it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from golem.capabilities.policies.vectors import ACTION, STATE
from golem.datasets.schema import DatasetError
from golem.datasets.store import DatasetFolder, RecordedEpisode
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
