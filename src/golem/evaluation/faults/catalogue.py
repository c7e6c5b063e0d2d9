"""Every fault that is tried, by name."""

from __future__ import annotations

from itertools import chain

from golem.evaluation.faults.class_faults import class_faults
from golem.evaluation.faults.combined_faults import combined_faults
from golem.evaluation.faults.command_faults import command_faults
from golem.evaluation.faults.data_faults import data_faults
from golem.evaluation.faults.device_faults import device_faults
from golem.evaluation.faults.injection import Injection

FAULTS: dict[str, Injection] = {
    fault.name: fault
    for fault in chain(command_faults(), data_faults(), device_faults(), class_faults(), combined_faults())
}
