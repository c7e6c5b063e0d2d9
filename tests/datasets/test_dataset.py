from __future__ import annotations

import errno
import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.datasets.conftest import PLAIN, SMALL, frames, write

from golem.capabilities.policies.vectors import STATE
from golem.datasets import commands, swap
from golem.datasets import episode_writer as writing
from golem.datasets.commands import findings as check
from golem.datasets.episode_writer import LONGEST, DatasetWriter
from golem.datasets.schema import DatasetError, Recipe
from golem.datasets.store import DatasetFolder
from golem.errors import ConfigError, GolemError, OutputError

pq = pytest.importorskip("pyarrow.parquet")


def told(root: Path) -> list[str]:
    return [*check(DatasetFolder(root))]


def same_actions(data: DatasetFolder, index: int, seed: int, recipe: Recipe = SMALL) -> bool:
    episode = data.episode(index)
    wanted = [frame["action"] for frame in frames(episode.length, seed, recipe)]
    return np.array_equal(data.values(episode, "action"), np.array(wanted, np.float32))


def test_what_was_written_is_read(dataset: Path) -> None:
    data = DatasetFolder(dataset)
    assert [e.length for e in data.episodes] == [20, 70, 5] and data.tasks == ["Take a screw."]
    assert all(same_actions(data, k, k) for k in range(3))
    rows = frames(70, 1)
    depth = data.values(data.episode(1), "observation.depth.right_hand")
    assert np.array_equal(depth, np.array([row["observation.depth.right_hand"] for row in rows]))
    assert np.array_equal(data.values(data.episode(2), "index"), np.arange(90, 95))
    # Within one frame: each is one level lighter than the one before, by three of 255.
    levels = [float(p.mean()) for p in data.pictures(data.episode(1), "observation.images.right_hand")]
    assert np.abs(np.array(levels) - (40 + 3 * np.arange(70)).clip(0, 255)).max() < 3.0
    assert data.features["observation.state"].names == list(STATE)
    assert data.about["units"]["observation.state"] == list(STATE.values())


def test_statistics_are_those_of_all_frames(dataset: Path) -> None:
    data = DatasetFolder(dataset)
    stats = json.loads((dataset / "meta/stats.json").read_text())
    every = np.concatenate([data.values(e, "action") for e in data.episodes])
    for name, value in {"mean": every.mean(0), "std": every.std(0), "min": every.min(0), "max": every.max(0)}.items():
        np.testing.assert_allclose(stats["action"][name], value, atol=1e-6)
    assert np.shape(stats["observation.images.right_hand"]["mean"]) == (3, 1, 1)


def test_a_sound_data_set_has_no_findings(dataset: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert commands.check(dataset)
    assert "3 episodes, 95 frames at 15 fps: no findings." in capsys.readouterr().out


def test_a_data_set_goes_on(dataset: Path) -> None:
    write(dataset, (7,))
    assert [e.length for e in DatasetFolder(dataset).episodes] == [20, 70, 5, 7] and told(dataset) == []


def test_a_long_episode_goes_on_as_the_next_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(writing, "LONGEST", 2.0)  # 30 frames
    data = DatasetFolder(write(tmp_path / "set", (60, 31)))
    assert [e.length for e in data.episodes] == [30, 30, 30, 1] and told(data.root) == []


def test_times_of_the_longest_episode_are_within_the_tolerance() -> None:
    at = np.arange(round(LONGEST * 30)) / 30
    assert np.abs(at.astype(np.float32) - at).max() < commands.TIME


def test_one_that_was_recorded_otherwise_does_not(dataset: Path) -> None:
    with pytest.raises(DatasetError, match="recorded otherwise"):
        DatasetWriter(dataset, PLAIN)


def test_masks_of_other_labels_do_not_go_on_and_are_not_merged(dataset: Path, tmp_path: Path) -> None:
    other = replace(SMALL, masks=("tray", "screw"))  # its screws are 2, and not 1
    with pytest.raises(DatasetError, match="has --masks screw,"):
        DatasetWriter(dataset, other)
    DatasetWriter(dataset, SMALL).close()
    with pytest.raises(ConfigError, match="of 'screw', those of .* of 'tray screw'"):
        commands.merge(tmp_path / "all", (dataset, write(tmp_path / "other", (3,), other)))


def test_two_writers_are_one_too_many(dataset: Path) -> None:
    first = DatasetWriter(dataset, SMALL)
    with pytest.raises(OutputError, match="Another process"):
        DatasetWriter(dataset, SMALL)
    first.close()
    DatasetWriter(dataset, SMALL).close()


def test_an_episode_that_is_not_finished_leaves_nothing(dataset: Path) -> None:
    writer = DatasetWriter(dataset, SMALL)
    writer.begin("x")
    writer.add(frames(1)[0])
    writer.close()
    assert sorted(p.name for p in dataset.parent.iterdir()) == [f".{dataset.name}.lock", dataset.name]
    with pytest.raises(DatasetError, match="without frames"):
        writer = DatasetWriter(dataset, SMALL)
        writer.begin("x")
        try:
            writer.finish()
        finally:
            writer.close()
    assert len(DatasetFolder(dataset).episodes) == 3


@pytest.mark.parametrize("wrong", ["nan", "shape", "missing"])
def test_a_frame_without_sense_is_refused(tmp_path: Path, wrong: str) -> None:
    writer, frame = DatasetWriter(tmp_path / "set", PLAIN), frames(1, 0, PLAIN)[0]
    if wrong == "nan":
        frame["action"][3] = np.nan
    elif wrong == "shape":
        frame["action"] = frame["action"][:3]
    else:
        del frame["action"]
    writer.begin("x")
    with pytest.raises(DatasetError, match="action"):
        writer.add(frame)
    writer.add(frames(1, 0, PLAIN)[0])
    assert writer.finish() == 0
    writer.close()


def test_delete(dataset: Path) -> None:
    commands.delete(dataset, (1,))
    data = DatasetFolder(dataset)
    assert [e.length for e in data.episodes] == [20, 5] and same_actions(data, 1, 2)
    assert told(dataset) == []
    with pytest.raises(DatasetError, match="episodes 0 to 1, no 7"):
        commands.delete(dataset, (7,))
    with pytest.raises(DatasetError, match="without episodes"):
        commands.delete(dataset, (0, 1))
    assert told(dataset) == []


def test_split_and_merge(dataset: Path, tmp_path: Path) -> None:
    commands.split(dataset, tmp_path / "a", tmp_path / "b", share=0.67)
    assert [len(DatasetFolder(tmp_path / name).episodes) for name in "ab"] == [2, 1]
    other = write(tmp_path / "other", (4,), task="Drop it.")
    commands.merge(tmp_path / "all", (tmp_path / "a", other, tmp_path / "b"))
    data = DatasetFolder(tmp_path / "all")
    assert sum(e.length for e in data.episodes) == 99 and data.tasks == ["Take a screw.", "Drop it."]
    assert told(tmp_path / "all") == told(tmp_path / "a") == []
    with pytest.raises(GolemError, match="other features"):
        commands.merge(tmp_path / "x", (dataset, write(tmp_path / "plain", (3,), PLAIN)))
    with pytest.raises(OutputError, match="exists already"):
        commands.merge(tmp_path / "all", (dataset,))
    with pytest.raises(OutputError, match="b exists already"):
        commands.split(dataset, tmp_path / "new", tmp_path / "b")
    with pytest.raises(GolemError, match="name two new folders"):
        commands.split(dataset, tmp_path / "new", tmp_path / "a" / ".." / "new")
    assert not (tmp_path / "new").exists()


def full(*_: Any, **__: Any) -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


class Greedy:
    """An encoder that keeps a picture to itself."""

    def __init__(self, stream: Any) -> None:
        self._stream = stream

    def encode(self, frame: Any) -> Any:
        packets = self._stream.encode(frame)
        return packets if frame is not None else packets[1:]


def test_an_episode_whose_encoder_keeps_a_picture_is_not_written(tmp_path: Path) -> None:
    writer = DatasetWriter(tmp_path / "set", SMALL, "test")
    writer.begin("Take a screw.")
    for frame in frames(20):
        writer.add(frame)
    for video in writer._videos.values():  # pyright: ignore[reportPrivateUsage]
        video._stream = Greedy(video._stream)  # pyright: ignore[reportPrivateUsage]
    with pytest.raises(OutputError, match="the encoder gave 19 of 20 pictures"):
        writer.finish()
    assert writer.episodes == 0
    writer.begin("Take a screw.")
    for frame in frames(20):
        writer.add(frame)
    writer.finish()
    writer.close()
    assert not told(tmp_path / "set")


@pytest.mark.parametrize("where", ["video", "data", "commit", "sync"])
def test_a_full_disk_costs_the_episode_and_no_other(dataset: Path, where: str, monkeypatch: pytest.MonkeyPatch) -> None:
    target, name = {
        "video": (writing.Video, "add"),
        "data": (pq.ParquetWriter, "write_table"),
        "commit": (writing, "_write_json"),
        "sync": (swap, "sync"),
    }[where]
    writer = DatasetWriter(dataset, SMALL)
    writer.begin("x")
    monkeypatch.setattr(target, name, full)
    with pytest.raises(OutputError, match="No space left"):
        for frame in frames(writing.BATCH):
            writer.add(frame)
        writer.finish()
    monkeypatch.undo()
    assert len(DatasetFolder(dataset).episodes) == 3 and told(dataset) == []
    writer.begin("again")
    writer.add(frames(1)[0])
    assert writer.finish() == 3
    writer.close()


def test_a_file_system_that_exchanges_nothing(dataset: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Old:
        def __init__(self, *_: Any, **__: Any) -> None:
            pass

    monkeypatch.setattr(swap.ctypes, "CDLL", Old)
    write(dataset, (7,))
    assert len(DatasetFolder(dataset).episodes) == 4
    # Killed between its two steps.
    os.rename(dataset, swap.beside(dataset, "old"))
    with swap.held(dataset):
        pass
    assert len(DatasetFolder(dataset).episodes) == 4


def test_other_data_sets_are_told_apart(dataset: Path, tmp_path: Path) -> None:
    path = dataset / "meta/info.json"
    info = json.loads(path.read_text())
    with pytest.raises(DatasetError, match="no data set"):
        DatasetFolder(tmp_path / "nothing")
    path.write_text(json.dumps(info | {"codebase_version": "v2.1"}))
    with pytest.raises(DatasetError, match=r"version v2.1, not v3.0.*converts"):
        DatasetFolder(dataset)
    path.write_text(json.dumps(info | {"total_frames": 1}))
    with pytest.raises(DatasetError, match="ended halfway"):
        DatasetFolder(dataset)
    path.write_text("{")
    with pytest.raises(DatasetError, match="cannot be read"):
        DatasetFolder(dataset)
    path.write_text(json.dumps({k: v for k, v in info.items() if k != "features"}))
    with pytest.raises(DatasetError, match="damaged"):
        DatasetFolder(dataset)
    path.write_text(json.dumps(info))
    with pytest.raises(DatasetError, match="of another robot"):
        DatasetFolder(dataset).require("observation.state", like={"observation.state": ["main_shoulder_pan"]})
    with pytest.raises(DatasetError, match="has no observation.images.head"):
        DatasetFolder(dataset).require("observation.images.head")


FEATURE = {"dtype": "float32", "shape": [3], "names": None}


@pytest.mark.parametrize(
    "change",
    [
        *({"features": value} for value in (None, "x", [1], -1, {"a": 1})),
        *({"features": {"action": FEATURE | wrong}} for wrong in (
            {"shape": "x"}, {"shape": [-1]}, {"shape": []}, {"shape": 3}, {"names": 5}, {"dtype": "video"})),
        {"features": {"observation.images.left": {"dtype": "video", "shape": [48, 64, 3], "names": None}}},
        *({"fps": value} for value in (None, "fast", 0, -1, float("inf"), [15])),
        *({"data_path": value} for value in ([1], -1, "{", "data/{episode_chunk:03d}.parquet")),
        *({"video_path": value} for value in (None, [1], -1, "{", "videos/{episode_index:06d}.mp4")),
    ],
    ids=str,
)  # fmt: skip
def test_metadata_without_sense_is_damaged(dataset: Path, change: dict[str, object]) -> None:
    path = dataset / "meta/info.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(DatasetError, match="metadata of the data set .* is damaged"):
        DatasetFolder(dataset)


@pytest.mark.parametrize("column", ["data/chunk_index", "videos/observation.images.right_hand/from_timestamp"])
def test_episodes_that_do_not_say_where_they_are_are_damaged(dataset: Path, column: str) -> None:
    file = next((dataset / "meta/episodes").rglob("*.parquet"))
    pq.write_table(pq.read_table(file).drop_columns([column]), file)
    with pytest.raises(DatasetError, match=f"damaged: KeyError.*{column}"):
        DatasetFolder(dataset)


@pytest.mark.parametrize("column", ["timestamp", "frame_index", "index", "task_index", "action"])
def test_a_table_without_a_column_is_a_finding(dataset: Path, column: str) -> None:
    file = dataset / "data/chunk-000/file-001.parquet"
    pq.write_table(pq.read_table(file).drop_columns([column]), file)
    [found] = told(dataset)
    assert found.startswith("Episode 1: ") and "\n" not in found
    assert (f"cannot be read from {file}: No match for" if column == "action" else f"{file} has no {column};") in found


@pytest.mark.parametrize("values", [[0.1], None, "x"])
def test_frames_of_another_shape_are_a_finding(dataset: Path, values: object) -> None:
    import pyarrow as pa

    file = dataset / "data/chunk-000/file-001.parquet"
    table = pq.read_table(file)
    at = table.column_names.index("action")
    pq.write_table(table.set_column(at, "action", pa.array([values] * table.num_rows)), file)
    assert told(dataset) == ["Episode 1: action of episode 1 is not (25,), as info.json says."]


@pytest.mark.parametrize("cut", [0.0, 0.5, 0.9])
def test_a_torn_video_is_a_finding(dataset: Path, cut: float) -> None:
    file = dataset / "videos/observation.images.right_hand/chunk-000/file-001.mp4"
    file.write_bytes(file.read_bytes()[: int(cut * file.stat().st_size)] if cut else b"[1]")
    [found] = told(dataset)
    assert found.startswith("Episode 1: The video ")


def test_a_data_set_without_frames(dataset: Path) -> None:
    for file in (dataset / "meta/episodes").rglob("*.parquet"):
        pq.write_table(pq.read_table(file).slice(0, 0), file)
    with pytest.raises(DatasetError, match="no frames"):
        DatasetFolder(dataset)


def test_missing_and_short_videos_are_found(dataset: Path) -> None:
    videos = dataset / "videos/observation.images.right_hand/chunk-000"
    (videos / "file-000.mp4").unlink()
    (videos / "file-001.mp4").write_bytes((videos / "file-002.mp4").read_bytes())
    found = told(dataset)
    assert len(found) == 2 and "cannot be read" in found[0] and "ends after 5 of the 70" in found[1]
    with pytest.raises(DatasetError, match="missing"):
        commands.delete(dataset, (2,))


def plant(dataset: Path, fault: str) -> None:
    """Put a fault into the table of episode 1."""
    file = dataset / "data/chunk-000/file-001.parquet"
    table = pq.read_table(file)
    rows = table.to_pydict()
    if fault == "time":
        rows["timestamp"][5] += 0.02
    elif fault == "gap":
        for name in ("frame_index", "index"):
            rows[name][10:] = [k + 1 for k in rows[name][10:]]
    elif fault == "nan":
        rows["observation.state"][3][0] = float("nan")
    elif fault == "range":
        rows["action"][3][1] = 9.0
    elif fault == "stuck":
        for k in range(70):
            rows["observation.state"][k][4], rows["command.joints"][k][4] = 0.25, 0.01 * k
    import pyarrow as pa

    pq.write_table(pa.Table.from_pydict(rows, schema=table.schema), file)


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("time", "frame 5 is 20.0 ms off its time"),
        ("gap", "frame 10 has frame_index 11, not 10"),
        ("nan", "observation.state of frame 3 is not finite at left_hip_yaw.pos"),
        ("range", "left_palm.y is 9, beyond 1.5"),
        ("stuck", "is stuck at 0.2500 from 0.0 s on"),
    ],
)
def test_faults_are_found_where_they_are(dataset: Path, fault: str, words: str) -> None:
    plant(dataset, fault)
    found = told(dataset)
    assert any(words in each and each.startswith("Episode 1:") for each in found)
    assert not any(each.startswith(("Episode 0", "Episode 2")) for each in found)


def test_a_frozen_camera_is_found(tmp_path: Path) -> None:
    writer = DatasetWriter(tmp_path / "set", SMALL)
    writer.begin("x")
    for frame in frames(40):
        frame["observation.images.right_hand"][:] = 80
        writer.add(frame)
    writer.finish()
    writer.close()
    assert any("shows one picture from" in each for each in told(tmp_path / "set"))
