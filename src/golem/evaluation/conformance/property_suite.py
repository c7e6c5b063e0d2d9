"""What a source of properties promises: see `golem.capabilities.properties.base`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from golem.capabilities.properties.base import Properties, PropertySource
from golem.errors import ConfigError
from golem.evaluation.conformance.base import Candidate, check
from golem.evaluation.conformance.suite import Suite
from golem.runtime.contract_check import ContractCheck
from golem.types import TICK

LABELS = ("mug", "bowl", "can", "bottle", "mug", "can")
UNKNOWN = "flux capacitor"


class PropertySuite(Suite):
    """Inputs are names, answers properties, or that the name is none it knows."""

    slot, contracts, forgets = "properties", (PropertySource,), False
    late, takes = True, TICK

    def inputs(self) -> Sequence[str]:
        """Return names of common things."""
        return LABELS

    def edges(self) -> Mapping[str, Sequence[str]]:
        """Return names that mean nothing."""
        return {"a name that nobody knows": [UNKNOWN], "no name": [""], "a long name": ["mug " * 200]}

    def call(self, module: PropertySource, given: str) -> Properties | ConfigError:
        """Return what it says, or the refusal."""
        try:
            return module.properties(given)
        except ConfigError as refusal:
            return refusal

    def judge(self, contract: ContractCheck, answer: Any) -> None:
        if not isinstance(answer, ConfigError):
            contract.kind("what it says", answer, Properties)

    @check
    def says_what_it_knows(self, candidate: Candidate) -> None:
        """A name that it does not know is refused with a sentence."""
        answer = candidate.contract.call(self.call, candidate.make(), UNKNOWN)
        if isinstance(answer, ConfigError) and not str(answer).strip().endswith("."):
            raise candidate.fault(f"it refuses a name without a sentence: '{answer}'")
