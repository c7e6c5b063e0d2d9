#!/usr/bin/env bash
# rosbags 0.11.9, interfaces of ROS 2 Jazzy (wheels), CPython 3.12: messages with a `char` get a type hash that no ROS
# node has.
#
# In ROS 2 `char` is an alias: rosidl makes it uint8 before it hashes (RIHS01). rosbags hashes a type `char` of its own.
# A program that announces its topics with rosbags' hash then has another type than ROS, and rmw_zenoh matches topics by
# the hash, too. ServiceEventInfo has a char and is part of what the hash of each service is of. Remedy: uint8 for char
# in the type store's `fielddefs`.
#
# Seen: of 131 standard messages 126 have the hash that rosidl wrote beside them. The five others have a char, or Gid in
# them, which has one. With uint8 for char all 131 are equal.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python=$(command -v python3.12 > /dev/null && python3.12 -c 'import sys; print(sys.executable)' 2> /dev/null ||
    PYENV_VERSION=3.12 python3.12 -c 'import sys; print(sys.executable)' 2> /dev/null ||
    PYENV_VERSION=3.12.1 python3.12 -c 'import sys; print(sys.executable)')
"$python" -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check rosbags==0.11.9 numpy==2.4.6
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check --no-deps \
    ros-action-msgs==2.0.3 ros-builtin-interfaces==2.0.3 ros-diagnostic-msgs==5.3.6 ros-geometry-msgs==5.3.6 \
    ros-lifecycle-msgs==2.0.3 ros-nav-msgs==5.3.6 ros-rcl-interfaces==2.0.3 ros-rmw-dds-common==3.1.0 \
    ros-rosgraph-msgs==2.0.3 ros-sensor-msgs==5.3.6 ros-service-msgs==2.0.3 ros-std-msgs==5.3.6 \
    ros-type-description-interfaces==2.0.3 ros-unique-identifier-msgs==2.5.0

cat > "$folder/hashes.py" << 'PYTHON'
import json
import sys
from pathlib import Path

from rosbags.typesys import Stores, get_typestore


def uint8(kind):
    """Return a field's type with uint8 for char."""
    return tuple(uint8(part) if isinstance(part, tuple) else "uint8" if part == "char" else part for part in kind)


def different(store):
    """Return how many messages were compared, and those of another hash than rosidl's."""
    count, found = 0, []
    for file in sorted(Path(sys.prefix, "share").glob("*/msg/*.json")):
        name = f"{file.parts[-3]}/msg/{file.stem}"
        hashes = {entry["type_name"]: entry["hash_string"] for entry in json.loads(file.read_text())["type_hashes"]}
        if name in store.fielddefs:
            count += 1
            if store.hash_rihs01(name) != hashes[name]:
                found.append(file.stem)
    return f"{count}:{','.join(found) or 'none'}"


print(different(get_typestore(Stores.ROS2_JAZZY)), end=" ")
store = get_typestore(Stores.ROS2_JAZZY)
for name, (constants, fields) in store.fielddefs.items():
    store.fielddefs[name] = (constants, [(field, uint8(kind)) for field, kind in fields])
print(different(store))
PYTHON

found=$("$folder/venv/bin/python" "$folder/hashes.py")
echo "messages:those of another hash than rosidl's, as it is and with uint8 for char: $found"
[ "$found" = "131:Gid,NodeEntitiesInfo,ParticipantEntitiesInfo,ServiceEventInfo,Char 131:none" ]
