"""Maps on disk: what is written is read again, whatever ROS writes is read, and broken files are named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from golem.capabilities.mapping.map_file import StoredMap, load_map, save_map
from golem.errors import ConfigError, OutputError
from golem.types import PlanarPose


def a_map() -> StoredMap:
    cells = np.array([[0, 100, -1], [-1, 0, 0]], np.int8)
    cloud = np.array([[0.1, 0.2, 0.3]], np.float32).astype(np.float64)
    return StoredMap(PlanarPose(-1.0, 2.0, 0.1), 0.05, cells, cloud, np.array([[0.5, 0.25]]))


def test_a_map_is_read_as_it_was_written(tmp_path: Path) -> None:
    save_map(tmp_path / "new" / "hall", a_map())
    read = load_map(tmp_path / "new" / "hall.yaml")
    assert (read.cells == a_map().cells).all() and read.origin == a_map().origin
    assert read.resolution == 0.05 and (read.cloud == a_map().cloud).all() and (read.walls == a_map().walls).all()
    facts = yaml.safe_load((tmp_path / "new" / "hall.yaml").read_text())
    assert facts["free_thresh"] == 0.196 and facts["mode"] == "trinary" and facts["image"] == "hall.pgm"
    pgm = (tmp_path / "new" / "hall.pgm").read_bytes()
    assert pgm == b"P5\n3 2\n255\n" + bytes([205, 254, 254, 254, 0, 205])  # the last row of cells comes first


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 9), st.integers(1, 9), st.data())
def test_any_cells_come_back(rows: int, columns: int, data: st.DataObject) -> None:
    import tempfile

    values = data.draw(st.lists(st.sampled_from([-1, 0, 100]), min_size=rows * columns, max_size=rows * columns))
    cells = np.array(values, np.int8).reshape(rows, columns)
    with tempfile.TemporaryDirectory() as folder:
        one = a_map()
        save_map(Path(folder) / "m", StoredMap(one.origin, 0.1, cells, one.cloud, one.walls))
        assert (load_map(Path(folder) / "m").cells == cells).all()


def test_a_map_of_ros_without_voxels_is_read(tmp_path: Path) -> None:
    (tmp_path / "m.pgm").write_bytes(b"P5\n2 1\n255\n" + bytes([0, 254]))
    (tmp_path / "m.yaml").write_text("image: m.pgm\nresolution: 0.1\norigin: [0, 0, 0]\nnegate: 0\n")
    read = load_map(tmp_path / "m.yaml")
    assert read.cells.tolist() == [[100, 0]] and len(read.cloud) == len(read.walls) == 0


BROKEN = {
    "not yaml": "image: [",
    "no image": "resolution: 0.1\n",
    "no resolution": "image: m.pgm\norigin: [0, 0, 0]\n",
    "negative resolution": "image: m.pgm\nresolution: -1\norigin: [0, 0, 0]\n",
    "nan origin": "image: m.pgm\nresolution: 0.1\norigin: [.nan, 0, 0]\n",
    "mode": "image: m.pgm\nresolution: 0.1\norigin: [0, 0, 0]\nmode: fancy\n",
    "image away": "image: away.pgm\nresolution: 0.1\norigin: [0, 0, 0]\n",
    "image empty": "image: empty.pgm\nresolution: 0.1\norigin: [0, 0, 0]\n",
    "a list": "- 1\n",
}


def test_a_folder_is_no_map(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigError, match=r"The map '\..*' cannot be read: No such file or directory\."):
        load_map(Path("."))


@pytest.mark.parametrize("what", BROKEN)
def test_a_broken_map_is_refused_in_a_sentence(what: str, tmp_path: Path) -> None:
    (tmp_path / "m.pgm").write_bytes(b"P5\n2 1\n255\n" + bytes([0, 254]))
    (tmp_path / "empty.pgm").write_bytes(b"")
    (tmp_path / "m.yaml").write_text(BROKEN[what])
    with pytest.raises(ConfigError, match="map") as refusal:
        load_map(tmp_path / "m.yaml")
    assert "\n" not in str(refusal.value) and len(str(refusal.value)) < 400


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 nonsense", b"\x00" * 50])
def test_broken_voxels_are_refused(content: bytes, tmp_path: Path) -> None:
    save_map(tmp_path / "m", a_map())
    (tmp_path / "m.npz").write_bytes(content)
    with pytest.raises(ConfigError, match="voxels"):
        load_map(tmp_path / "m")


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot be written"):
        save_map(tmp_path / "file" / "m", a_map())


FACTS = "image: {image}\nresolution: {resolution}\norigin: [0, 0, 0]\n"


def written(folder: Path, image: str, extra: str = "", resolution: str = "0.05") -> Path:
    (folder / "m.yaml").write_text(FACTS.format(image=image, resolution=resolution) + extra)
    return folder / "m.yaml"


@pytest.mark.parametrize(
    ("mode", "extra", "cells"),
    [
        # black, grey 128, white; then the same half, fully, not transparent
        ("trinary", "", [[-1, -1, 0], [100, -1, 0]]),
        ("scale", "mode: scale\n", [[-1, -1, 0], [100, 67, 0]]),
        ("negated", "negate: 1\n", [[-1, -1, 100], [0, -1, 100]]),
        ("negated, as a truth value", "negate: true\nmode: scale\n", [[-1, -1, 100], [0, 67, 100]]),
        ("raw", "mode: raw\n", [[0, -1, -1], [0, -1, -1]]),
    ],
)
def test_what_is_transparent_is_unknown(mode: str, extra: str, cells: list[list[int]], tmp_path: Path) -> None:
    grey = np.array([[0, 128, 255], [0, 128, 255]], np.uint8)
    alpha = np.array([[255, 255, 255], [127, 0, 255]], np.uint8)
    expected = cells
    for name, image in (
        ("la.png", Image.fromarray(np.dstack([grey, alpha]), "LA")),
        ("rgba.png", Image.fromarray(np.dstack([grey, grey, grey, alpha]), "RGBA")),
    ):
        image.save(tmp_path / name)
        file = written(tmp_path, name, "occupied_thresh: 0.65\nfree_thresh: 0.196\n" + extra)
        assert load_map(file).cells.tolist() == expected, name


def test_a_threshold_itself_is_free_or_occupied(tmp_path: Path) -> None:
    # 1 - 204 / 255 = 0.2 and 1 - 102 / 255 = 0.6
    (tmp_path / "m.pgm").write_bytes(b"P5\n4 1\n255\n" + bytes([204, 203, 102, 103]))
    file = written(tmp_path, "m.pgm", "occupied_thresh: 0.6\nfree_thresh: 0.2\n")
    assert load_map(file).cells.tolist() == [[0, -1, 100, -1]]


@pytest.mark.parametrize(
    "content",
    [
        b"P5\n4 1\n100\n" + bytes([0, 50, 80, 100]),
        b"P2\n# a comment\n4 1\n15\n0 8 12 15\n",
        b"P5\n4 1\n65535\n" + bytes([0, 0, 0x80, 0, 0xCC, 0xCC, 0xFF, 0xFF]),
        b"P5\n4 1\n1000\n" + bytes([0, 0, 0x01, 0xF4, 0x03, 0x20, 0x03, 0xE8]),
    ],
    ids=["P5 to 100", "P2 to 15", "P5 to 65535", "P5 to 1000"],
)
def test_white_is_the_largest_value_that_a_pgm_names(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "m.pgm").write_bytes(content)
    file = written(tmp_path, "m.pgm", "occupied_thresh: 0.65\nfree_thresh: 0.25\n")
    assert load_map(file).cells.tolist() == [[100, -1, 0, 0]]


@pytest.mark.parametrize("text", ["5e-2", "5.0e-2", "0.5E-1", ".5e-1", "+5e-02", "0.05"])
def test_numbers_may_be_scientific(text: str, tmp_path: Path) -> None:
    (tmp_path / "m.pgm").write_bytes(b"P5\n2 1\n255\n" + bytes([0, 254]))
    assert load_map(written(tmp_path, "m.pgm", resolution=text)).resolution == pytest.approx(0.05)


@pytest.mark.parametrize(
    ("extra", "match"),
    [
        ("occupied_thresh: 65\nfree_thresh: 20\n", "shares from 0 to 1"),
        ("occupied_thresh: 0.2\nfree_thresh: 0.6\n", "the first no larger than the second"),
        ("free_thresh: -0.1\n", "shares from 0 to 1"),
        ("negate: black\n", "it is 0 or 1"),
        ("a: &a [x]\nb: [*a, *a]\n", "aliases are not allowed"),
    ],
)
def test_what_would_make_every_wall_free_is_refused(extra: str, match: str, tmp_path: Path) -> None:
    (tmp_path / "m.pgm").write_bytes(b"P5\n2 1\n255\n" + bytes([0, 254]))
    with pytest.raises(ConfigError, match=match):
        load_map(written(tmp_path, "m.pgm", extra))
