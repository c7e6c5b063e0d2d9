"""SigLIP and CLIP as small networks of the real architecture, with random weights."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from golem import registry
from golem.capabilities.memory.base import Observation
from golem.capabilities.memory.frame_index import FrameIndex, FrameIndexConfig, ImageTextEncoder
from golem.capabilities.perception import open_words
from golem.errors import ConfigError, MissingExtra
from golem.evaluation.conformance import samples

FRAME = samples.image(0.2)
LOOK = Observation(FRAME, (), ("mug",))
SMALL = {"hidden_size": 16, "intermediate_size": 16, "num_hidden_layers": 1, "num_attention_heads": 2}


@pytest.fixture(scope="module")
def clip(hub: Any, letter_tokenizer: Callable[[Path, int], Any], tmp_path_factory: pytest.TempPathFactory) -> Path:
    import torch

    folder = tmp_path_factory.mktemp("clip")
    tokenizer = letter_tokenizer(folder, 24)
    pictures = hub.CLIPImageProcessor(size={"shortest_edge": 32}, crop_size={"height": 32, "width": 32})
    hub.CLIPProcessor(pictures, tokenizer).save_pretrained(folder)
    text = {**SMALL, "vocab_size": 80, "max_position_embeddings": 24, "bos_token_id": 52, "eos_token_id": 53}
    vision = {**SMALL, "image_size": 32, "patch_size": 16}
    torch.manual_seed(0)
    config = hub.CLIPConfig(text_config=text, vision_config=vision, projection_dim=8)
    hub.CLIPModel(config).save_pretrained(folder)
    return folder


@pytest.fixture(scope="module")
def siglip(hub: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    import torch

    tokenizers = pytest.importorskip("tokenizers", reason="comes with transformers")
    folder = tmp_path_factory.mktemp("siglip")
    words = ["<unk>", "<pad>", "a", "photo", "of", "mug", "can"]
    level = tokenizers.models.WordLevel({word: k for k, word in enumerate(words)}, unk_token="<unk>")
    engine = tokenizers.Tokenizer(level)
    engine.pre_tokenizer = tokenizers.pre_tokenizers.Whitespace()
    tokenizer = hub.PreTrainedTokenizerFast(
        tokenizer_object=engine, unk_token="<unk>", pad_token="<pad>", model_max_length=8
    )
    pictures = hub.SiglipImageProcessor(size={"height": 32, "width": 32})
    hub.SiglipProcessor(pictures, tokenizer).save_pretrained(folder)
    text = {**SMALL, "vocab_size": len(words), "max_position_embeddings": 8}
    vision = {**SMALL, "image_size": 32, "patch_size": 16}
    torch.manual_seed(0)
    hub.SiglipModel(hub.SiglipConfig(text_config=text, vision_config=vision)).save_pretrained(folder)
    return folder


def check(network: str, folder: Path) -> None:
    """Unit vectors of one length, that depend on image and words and on nothing else."""
    encoder = ImageTextEncoder(network, folder)  # type: ignore[arg-type]
    mug, can, image = encoder.text("Mug"), encoder.text("can"), encoder.frame(LOOK)
    assert mug.shape == can.shape == image.shape and not np.allclose(mug, can)
    for vector in (mug, can, image):
        assert np.linalg.norm(vector) == pytest.approx(1.0)
    dark = replace(LOOK, frame=replace(FRAME, rgb=np.zeros_like(FRAME.rgb)))
    assert not np.allclose(encoder.frame(dark), image)
    np.testing.assert_array_equal(ImageTextEncoder(network, folder).frame(LOOK), image)  # type: ignore[arg-type]
    memory = registry.create("memory", "frame_index", {"encoder": network, "weights": str(folder), "least": 0.0})
    memory.observe(LOOK)
    places = memory.query("mug")
    assert len(places) <= 1 and (not places or places[0].score == pytest.approx(float(mug @ image)))


def test_clip_compares_images_with_words(clip: Path) -> None:
    check("clip", clip)


def test_siglip_compares_images_with_words(siglip: Path) -> None:
    check("siglip", siglip)


def test_a_network_is_called_by_its_own_name_only(clip: Path) -> None:
    with pytest.raises(ConfigError, match="of type 'clip'; wanted is 'siglip'"):
        FrameIndex(FrameIndexConfig("siglip", clip))


def test_without_weights_a_sentence_says_what_is_missing() -> None:
    with pytest.raises(ConfigError, match="siglip and clip need the folder of theirs"):
        FrameIndexConfig("siglip")
    with pytest.raises(ConfigError, match="'sigclip'.*labels, siglip"):
        registry.create("memory", "frame_index", {"encoder": "sigclip"})


def test_without_the_extra_a_sentence_says_what_installs_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "transformers", None)
    monkeypatch.setitem(__import__("sys").modules, "torch", None)
    assert open_words.EXTRA == "vision"
    with pytest.raises(MissingExtra, match=r"golem-humanoid\[vision\]"):
        FrameIndex(FrameIndexConfig("clip", tmp_path))
