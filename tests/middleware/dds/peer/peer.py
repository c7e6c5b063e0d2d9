"""A peer on the Python wheel of Cyclone DDS 0.10, Python 3.10; does what peer.c does: peer.py DOMAIN TYPE."""

import importlib
import select
import sys
import time

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

domain, name = int(sys.argv[1]), sys.argv[2]
package, kind = name.split("::")[0], name.split("::")[-1]
cls = getattr(importlib.import_module(f"{package}.msg.dds_"), kind)
qos = Qos(Policy.Reliability.Reliable(duration(seconds=5)), Policy.History.KeepAll)
participant = DomainParticipant(domain)
writer = DataWriter(participant, Topic(participant, "rt/back", cls), qos)
reader = DataReader(participant, Topic(participant, "rt/there", cls), qos)
while not select.select([sys.stdin], [], [], 0)[0]:
    for sample in reader.take(1):
        if isinstance(sample, cls):
            writer.write(sample)
    time.sleep(0.001)
