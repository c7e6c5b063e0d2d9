"""The shipped detector: a small heatmap network, trained on our own renders, run by onnxruntime on one thread."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path

import numpy as np
import onnxruntime
from numpy.typing import NDArray

from golem.capabilities.perception.lift import LiftConfig, lift
from golem.capabilities.perception.peaks import find_peaks, normalise
from golem.errors import ConfigError, unknown_name
from golem.types import Detection, LocalizedObject, RgbdImage

SHIPPED = "weights/detector.onnx"


@dataclass(frozen=True, slots=True)
class OnnxDetectorConfig:
    """Options of `OnnxDetector`.

    Attributes:
        weights: an ONNX file written by `golem.training.detector`; the shipped one if absent.
        threshold: smallest score of a detection.
        doubtful: the same by class, where a user can tell by the shape whether to believe it; lower ones only.
        latency: declared time per frame [s]; docs/explanation/detector.md has the measured one.
        lift: how depth is read.
    """

    weights: str | None = None
    threshold: float = 0.3
    doubtful: Mapping[str, float] = field(default_factory=lambda: {"tray": 0.12, "screw": 0.15})
    latency: float = 0.03
    lift: LiftConfig = field(default_factory=LiftConfig)


class OnnxDetector:
    """Parts of a pack, and what stands in a kitchen, in images of any size; deterministic. See `Localizer`."""

    def __init__(self, config: OnnxDetectorConfig | None = None) -> None:
        """Load the network. Raises ConfigError: it is none of ours, or the threshold is not between 0 and 1."""
        self.config = config or OnnxDetectorConfig()
        self.latency = self.config.latency
        if not 0.0 < self.config.threshold < 1.0:
            raise ConfigError(f"The detector's threshold must be between 0 and 1, not {self.config.threshold}.")
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = 1
        options.inter_op_num_threads = 1
        weights = _weights(self.config.weights)
        try:
            self._session = onnxruntime.InferenceSession(weights, options, providers=["CPUExecutionProvider"])
        except Exception as error:  # onnxruntime's errors have no common base
            raise ConfigError(f"The detector's weights {self.config.weights} are not an ONNX network.") from error
        facts = self._session.get_modelmeta().custom_metadata_map
        try:
            self.classes: tuple[str, ...] = tuple(json.loads(facts["classes"]))
            self._mean = np.array(json.loads(facts["mean"]))
            self._std = np.array(json.loads(facts["std"]))
            self._multiple = int(json.loads(facts["multiple"]))
        except KeyError as error:
            raise ConfigError(
                f"{self.config.weights} is not a detector of golem.training.detector: it has no {error}."
            ) from error

    def detect(self, image: NDArray[np.uint8], labels: Sequence[str] | None = None) -> list[Detection]:
        """Return the detections in a (height, width, 3) RGB image, best first; of all classes without `labels`.

        Raises ConfigError: unknown label.
        """
        wanted = set(self.classes if labels is None else labels)
        for label in sorted(wanted - set(self.classes)):
            raise unknown_name("label", label, self.classes)
        x = normalise(image, self._mean, self._std, self._multiple)
        maps = np.asarray(self._session.run(["maps"], {"image": x})[0])[0]
        size = image.shape[1], image.shape[0]
        doubtful = {label: least for label, least in self.config.doubtful.items() if label in wanted}
        found = find_peaks(maps, self.classes, wanted - set(doubtful), self.config.threshold, size)
        for label, least in doubtful.items():
            found += find_peaks(maps, self.classes, {label}, least, size)
        return sorted(found, key=lambda d: -d.score)

    def locate(self, frame: RgbdImage, labels: Sequence[str]) -> list[LocalizedObject]:
        lifted = (lift(frame, detection, self.config.lift) for detection in self.detect(frame.rgb, labels))
        return [found for found in lifted if found is not None]


def _weights(path: str | None) -> bytes:
    if path is None:
        return resources.files("golem.capabilities.perception").joinpath(SHIPPED).read_bytes()
    try:
        return Path(path).expanduser().read_bytes()
    except OSError as error:
        raise ConfigError(f"The detector's weights {path} cannot be read: {error.strerror}.") from error
