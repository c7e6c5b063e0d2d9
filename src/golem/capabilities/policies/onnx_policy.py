"""A policy in a file of its own, as `golem train act` writes it: a network, and what goes into and comes out of it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from golem.capabilities.policies.vectors import ACTION, STATE
from golem.errors import ConfigError, shorten
from golem.types import Array

META = "golem"
"""Key of the ONNX metadata that says, as JSON: `state`, names of the entries that go in; `camera`; `size`, width and
height of its picture; `fps` of the chunk; `relative`, whether palms are seen from where they are when asked."""
POSITIONS = [list(ACTION).index(f"{side}_palm.{axis}") for side in ("left", "right") for axis in "xyz"]
"""Where in an action the palms' positions are."""
MEASURED = [list(STATE).index(list(ACTION)[i]) for i in POSITIONS]
"""Where in a state they are."""


class OnnxPolicy:
    """A network on the CPU, one thread, whose chunks have `fps` actions per second [Hz]; see `ActionPolicy`."""

    def __init__(self, path: Path) -> None:
        """Load it. Raises ConfigError: there is no such file, or it is no policy of this robot."""
        import onnxruntime

        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = 1
        try:
            self._net: Any = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
            about = json.loads(self._net.get_modelmeta().custom_metadata_map[META])
            self._state = [list(STATE).index(name) for name in about["state"]]
            self.camera, self.fps, self._relative = str(about["camera"]), int(about["fps"]), bool(about["relative"])
            self._size = int(about["size"][0]), int(about["size"][1])
        except Exception as error:  # onnxruntime's errors have no common base
            raise ConfigError(f"{path} is no policy of `golem train act`: {shorten(str(error))}.") from error

    def infer(self, observation: Mapping[str, Any]) -> Array:
        state = np.asarray(observation["observation.state"], np.float32)
        picture = np.asarray(observation[f"observation.images.{self.camera}"])
        if picture.shape[1::-1] != self._size:
            picture = np.asarray(cv2.resize(picture, self._size, interpolation=cv2.INTER_AREA))
        fed = {"state": state[self._state][None], "picture": picture.transpose(2, 0, 1)[None].astype(np.float32)}
        actions = np.array(self._net.run(None, fed)[0][0], np.float64)
        if self._relative:
            actions[:, POSITIONS] += state[MEASURED]
        return actions

    def close(self) -> None:
        """Do nothing: there is no connection."""
