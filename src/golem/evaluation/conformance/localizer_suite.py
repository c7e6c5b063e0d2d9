"""What a localizer promises: see `golem.capabilities.perception.base`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from golem.capabilities.perception.base import Localizer
from golem.errors import ConfigError, ModuleFault
from golem.evaluation.conformance import samples
from golem.evaluation.conformance.base import Candidate, Inapplicable, check
from golem.evaluation.conformance.suite import Suite, check_fields
from golem.robots.sensors.cameras import HEAD, RIGHT_HAND
from golem.runtime.contract_check import ContractCheck
from golem.types import TICK, Detection, LocalizedObject, Mask, RgbdImage

LABEL = "screw"
UNKNOWN_LABEL = "flux capacitor"


class LocalizerInput(NamedTuple):
    """One frame, and what is looked for in it."""

    frame: RgbdImage
    labels: tuple[str, ...] = (LABEL,)


def asked(module: Localizer, labels: tuple[str, ...]) -> tuple[str, ...]:
    """Return the labels of an input as this module is asked for them.

    One whose attribute `classes` names what it knows, and no screw among it, is asked for the first of those instead.
    """
    classes = tuple(getattr(module, "classes", ())) or (LABEL,)
    return tuple(classes[0] if label == LABEL and LABEL not in classes else label for label in labels)


class LocalizerSuite(Suite):
    """Inputs are frames with labels, answers lists of objects."""

    slot, contracts, forgets = "localizer", (Localizer,), False
    late, takes = True, TICK

    def inputs(self) -> Sequence[LocalizerInput]:
        """Return frames of two cameras that look down on a plate with dark spots."""
        cameras = (HEAD, RIGHT_HAND)
        return [LocalizerInput(samples.image(0.1 * i, cameras[i % 2])) for i in range(6)]

    def edges(self) -> Mapping[str, Sequence[LocalizerInput]]:
        """Return frames in which there is nothing to find, or nothing to measure."""
        frame = samples.image(0.1)
        black = replace(frame, rgb=np.zeros_like(frame.rgb))
        white = replace(frame, rgb=np.full_like(frame.rgb, 255))
        blind = replace(frame, depth=np.zeros_like(frame.depth))
        return {
            "a black image": [LocalizerInput(black)],
            "a white image": [LocalizerInput(white)],
            "an image without depth": [LocalizerInput(blind)],
            "nothing to look for": [LocalizerInput(frame, ())],
        }

    def spoiled(self) -> Mapping[str, LocalizerInput]:
        """Return a frame whose depth holds NaN."""
        frame = samples.image(0.1)
        depth = frame.depth.copy()
        depth[::2] = samples.NAN
        return {"the depth": LocalizerInput(replace(frame, depth=depth))}

    def stale(self) -> Sequence[LocalizerInput]:
        """Return one frame twice."""
        return [self.inputs()[0]] * 2

    def call(self, module: Localizer, given: LocalizerInput) -> list[LocalizedObject]:
        return list(module.locate(given.frame, asked(module, given.labels)))

    def judge(self, contract: ContractCheck, answer: Any) -> None:
        for found in answer:
            contract.kind("a located object", found, LocalizedObject)
            contract.kind("its detection", found.detection, Detection)
            contract.kind("its label", found.detection.label, str)
            contract.number("its score", found.detection.score, minimum=0.0)
            contract.array("its box", found.detection.box, 4)
            contract.array("its centre", found.detection.center, 2)
            check_fields(contract, found, t=(), position=(3,), points=(None, 3))
            if found.mask is not None:
                contract.kind("its mask", found.mask, Mask)
                pixels = int(np.count_nonzero(found.mask.pixels))
                if pixels != len(found.points):
                    raise contract.fault(f"its mask has {pixels} pixels, its cloud {len(found.points)} points")

    def _seen(self, candidate: Candidate) -> list[tuple[LocalizerInput, list[LocalizedObject]]]:
        pairs = zip(self.inputs(), self.answers_of(candidate), strict=True)
        seen = [(given, answer) for given, answer in pairs if answer]
        if not seen:
            raise Inapplicable("it sees nothing in the frames of the suite")
        return seen

    @check
    def remembers_nothing(self, candidate: Candidate) -> None:
        """The same frame and labels give the same objects, whatever it saw before."""
        module = candidate.make()
        self.run(candidate, self.inputs(), module)
        self._compare(candidate, self.run(candidate, self.inputs(), module), "a second look answers otherwise")

    @check
    def finds_what_it_is_asked_for(self, candidate: Candidate) -> None:
        """It returns the labels that it was asked for and no others."""
        for given, answer in self._seen(candidate):
            labels = asked(candidate.make(), given.labels)
            others = {found.label for found in answer} - set(labels)
            if others:
                raise candidate.fault(f"asked for {', '.join(labels)}, it returns {', '.join(others)}")

    @check
    def best_score_comes_first(self, candidate: Candidate) -> None:
        """Objects come in the order of their scores, which lie between 0 and 1."""
        for _, answer in self._seen(candidate):
            scores = [found.detection.score for found in answer]
            if scores != sorted(scores, reverse=True) or scores[0] > 1.0:
                raise candidate.fault(f"its scores are {', '.join(f'{score:.3g}' for score in scores)}")

    @check
    def stamps_are_the_frames(self, candidate: Candidate) -> None:
        """An object carries the time stamp of the frame it was seen in."""
        for given, answer in self._seen(candidate):
            if any(found.t != given.frame.t for found in answer):
                raise candidate.fault(f"an object of the frame of t = {given.frame.t:g} s has another stamp")

    @check
    def leaves_out_what_it_cannot_place(self, candidate: Candidate) -> None:
        """Without valid depth there is no position, and no object."""
        (answer,) = self.run(candidate, self.edges()["an image without depth"])
        if answer:
            raise candidate.fault(f"it places {len(answer)} objects in an image without depth")

    @check
    def refuses_labels_it_does_not_know(self, candidate: Candidate) -> None:
        """A label that it does not know is refused by a `ConfigError`, or found nowhere."""
        given = LocalizerInput(samples.image(0.1), (UNKNOWN_LABEL,))
        try:
            (answer,) = self.run(candidate, [given])
        except ModuleFault as fault:
            if not isinstance(fault.__cause__, ConfigError):
                raise candidate.fault(f"an unknown label ends in {fault.reason}, not in a ConfigError") from fault
            return
        if answer:
            raise candidate.fault(f"it finds {len(answer)} objects called '{UNKNOWN_LABEL}'")
