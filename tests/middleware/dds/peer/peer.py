"""A peer on the Python wheel of Cyclone DDS 0.10, Python 3.10; does what peer.c does: peer.py DOMAIN TYPE COUNT."""

import importlib
import sys
import time

from cyclonedds.core import DDSStatus, Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

domain, name, left = int(sys.argv[1]), sys.argv[2], int(sys.argv[3])
package, kind = name.split("::")[0], name.split("::")[-1]
cls = getattr(importlib.import_module(f"{package}.msg.dds_"), kind)
qos = Qos(Policy.Reliability.Reliable(duration(seconds=5)), Policy.History.KeepAll)
participant = DomainParticipant(domain)
writer = DataWriter(participant, Topic(participant, "rt/back", cls), qos)
reader = DataReader(participant, Topic(participant, "rt/there", cls), qos)
end = time.monotonic() + 15.0
while not (
    writer.read_status(DDSStatus.PublicationMatched) and reader.read_status(DDSStatus.SubscriptionMatched)
):
    if time.monotonic() > end:
        sys.exit(72)
    time.sleep(0.001)
print("ready", flush=True)
while left and time.monotonic() < end:
    for sample in reader.take(1):
        if isinstance(sample, cls):
            writer.write(sample)
            left -= 1
    time.sleep(0.001)
time.sleep(0.3)  # the wheel cannot wait for acknowledgements of samples it has just written
sys.exit(71 if left else 0)
