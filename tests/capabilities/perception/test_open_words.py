"""OWLv2, Grounding DINO and SAM as small networks of the real architecture, with random weights."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from golem.capabilities.perception import open_words
from golem.capabilities.perception.grounding_dino import GroundingDino
from golem.capabilities.perception.open_words import OpenWordsConfig, Sam
from golem.capabilities.perception.owlv2 import Owlv2
from golem.errors import ConfigError, MissingExtra
from golem.evaluation.conformance import samples

FRAME = samples.image(0.2)
SIZE = FRAME.rgb.shape[:2]


@pytest.fixture(scope="module")
def owl(hub: Any, letter_tokenizer: Callable[[Path, int], Any], tmp_path_factory: pytest.TempPathFactory) -> Path:
    import torch

    folder = tmp_path_factory.mktemp("owlv2")
    tokenizer = letter_tokenizer(folder, 16)
    pictures = hub.Owlv2ImageProcessor(size={"height": 64, "width": 64})
    hub.Owlv2Processor(image_processor=pictures, tokenizer=tokenizer).save_pretrained(folder)
    small = {"hidden_size": 16, "intermediate_size": 16, "num_hidden_layers": 1, "num_attention_heads": 2}
    config = hub.Owlv2Config(
        text_config={**small, "vocab_size": 80, "max_position_embeddings": 16, "bos_token_id": 52, "eos_token_id": 53},
        vision_config={**small, "image_size": 64, "patch_size": 16}, projection_dim=16,
    )  # fmt: skip
    torch.manual_seed(0)
    hub.Owlv2ForObjectDetection(config).save_pretrained(folder)
    return folder


@pytest.fixture(scope="module")
def dino(hub: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    import torch

    folder = tmp_path_factory.mktemp("dino")
    words = ["[PAD]", "[UNK]", "[CLS]", "[SEP]", "[MASK]", ".", "a", "mug", "bus", "bar"]
    (folder / "vocab.txt").write_text("\n".join(words))
    tokenizer = hub.BertTokenizer(str(folder / "vocab.txt"), model_max_length=32)
    pictures = hub.GroundingDinoImageProcessor(size={"shortest_edge": 128, "longest_edge": 192})
    hub.GroundingDinoProcessor(image_processor=pictures, tokenizer=tokenizer).save_pretrained(folder)
    heads = {"num_hidden_layers": 1, "num_attention_heads": 2, "hidden_size": 16, "intermediate_size": 16}
    config = hub.GroundingDinoConfig(
        backbone_config=hub.SwinConfig(
            image_size=64, embed_dim=8, depths=[1, 1, 1, 1], num_heads=[1, 1, 2, 2], window_size=4,
            out_indices=[2, 3, 4], out_features=["stage2", "stage3", "stage4"],
        ),
        text_config=hub.BertConfig(vocab_size=len(words), **heads), d_model=32, encoder_layers=1, decoder_layers=2,
        encoder_attention_heads=2, decoder_attention_heads=2, encoder_ffn_dim=16, decoder_ffn_dim=16, num_queries=12,
        max_text_len=32,
    )  # fmt: skip
    torch.manual_seed(0)
    hub.GroundingDinoForObjectDetection(config).save_pretrained(folder)
    return folder


@pytest.fixture(scope="module")
def sam(hub: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    import torch

    folder = tmp_path_factory.mktemp("sam")
    size = {"longest_edge": 64}, {"height": 64, "width": 64}
    pictures = hub.SamImageProcessor(size=size[0], pad_size=size[1], mask_size=size[0], mask_pad_size=size[1])
    hub.SamProcessor(pictures).save_pretrained(folder)
    config = hub.SamConfig(
        vision_config={"hidden_size": 16, "num_hidden_layers": 1, "num_attention_heads": 2, "image_size": 64,
                       "patch_size": 16, "output_channels": 16, "mlp_dim": 16, "window_size": 2,
                       "num_pos_feats": 8, "global_attn_indexes": [0]},
        prompt_encoder_config={"hidden_size": 16, "image_size": 64, "patch_size": 16, "image_embedding_size": 4,
                               "mask_input_channels": 4},
        mask_decoder_config={"hidden_size": 16, "mlp_dim": 16, "num_hidden_layers": 1, "num_attention_heads": 2,
                             "iou_head_hidden_dim": 16, "iou_head_depth": 1},
    )  # fmt: skip
    torch.manual_seed(0)
    hub.SamModel(config).save_pretrained(folder)
    return folder


def check(localizer: Owlv2 | GroundingDino) -> None:
    """Boxes of the asked labels alone, in the image's pixels, the same again; nothing asked, nothing found."""
    boxes = localizer.boxes(FRAME.rgb, ["mug", "bus_bar"])
    assert boxes and {box.label for box in boxes} <= {"mug", "bus_bar"}
    assert [box.score for box in boxes] == sorted((box.score for box in boxes), reverse=True)
    middles = np.array([0.5 * (box.corners[:2] + box.corners[2:]) for box in boxes])
    assert (np.abs(middles) < 2 * max(SIZE)).all() and middles.max() > 2.0  # pixels, not shares of the image
    again = localizer.boxes(FRAME.rgb, ["mug", "bus_bar"])
    np.testing.assert_array_equal(boxes[0].corners, again[0].corners)
    assert localizer.locate(FRAME, []) == []
    assert all(np.isfinite(one.position).all() for one in localizer.locate(FRAME, ["mug"]))
    with pytest.raises(ConfigError, match="label to look for is empty"):
        localizer.boxes(FRAME.rgb, [" "])


def test_owlv2_finds_any_words(owl: Path) -> None:
    check(Owlv2(OpenWordsConfig(owl, threshold=0.001)))


def test_grounding_dino_finds_any_words(dino: Path) -> None:
    check(GroundingDino(OpenWordsConfig(dino, threshold=0.001)))


def test_sam_masks_what_is_boxed(owl: Path, sam: Path) -> None:
    masks = Sam(sam).masks(FRAME.rgb, [[2.0, 2.0, 20.0, 20.0], [5.0, 5.0, 30.0, 30.0]])
    assert masks.shape == (2, *SIZE) and masks.dtype == bool
    localizer = Owlv2(OpenWordsConfig(owl, sam=sam, threshold=0.001))
    for one in localizer.locate(FRAME, ["mug"]):
        assert one.mask is not None and len(one.points) == one.mask.pixels.sum()


def test_folders_that_hold_no_such_model_are_one_sentence(owl: Path, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"holds no model: it has no config\.json"):
        Owlv2(OpenWordsConfig(tmp_path))
    with pytest.raises(ConfigError, match="of type 'owlv2'; wanted is 'grounding-dino'"):
        GroundingDino(OpenWordsConfig(owl))
    (tmp_path / "config.json").write_text("{")
    with pytest.raises(ConfigError, match="cannot be read as a model's configuration"):
        Owlv2(OpenWordsConfig(tmp_path))
    (tmp_path / "config.json").write_text('{"model_type": "owlv2"}')
    with pytest.raises(ConfigError, match="cannot be loaded"):
        Owlv2(OpenWordsConfig(tmp_path))


def test_without_the_extra_the_line_that_installs_it_is_told(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(__import__("sys").modules, "transformers", None)
    pytest.importorskip("torch", reason="torch is told first where both are absent")
    with pytest.raises(MissingExtra, match=r"'transformers' is not installed; .*golem-humanoid\[vision\]"):
        open_words.load_model(tmp_path, "owlv2", "Owlv2ForObjectDetection", "Owlv2Processor")
