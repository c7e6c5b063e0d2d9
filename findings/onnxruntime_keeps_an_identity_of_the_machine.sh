#!/usr/bin/env bash
# onnxruntime 1.31.1, CPython 3.11, Linux: importing it leaves a device identity and a report of the process in the home
# folder; what the package offers to turn that off comes too late.
#
# Since 1.29 the Linux wheels have telemetry. A robot that runs a policy then reports to the library's maker, once its
# network lets it. `onnxruntime.disable_telemetry_events()` can only be called after the import, when identity and
# report exist. In CI nothing is written, so tests show nothing. Remedy: ORT_DISABLE_TELEMETRY=1 in the environment
# before the import.
#
# Seen, without any network: after `import onnxruntime` a `deviceid` of 36 characters and a queue with 1 report; after
# disable_telemetry_events() the same. The identity stays the same in the next process. With CI=1, and with
# ORT_DISABLE_TELEMETRY=1, there is no file.
set -euo pipefail
unshare --net true 2> /dev/null || { echo "run it as root" >&2; exit 2; }
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet onnxruntime==1.31.1 numpy==2.4.6

# Imports it with a home folder of that name, without a network: nothing can be sent.
load() {
    mkdir -p "$folder/$1"
    unshare --net env -i HOME="$folder/$1" "${3:-NONE=}" "$folder/venv/bin/python" -c "import onnxruntime; $2"
}
# What is there: characters of the identity and reports in the queue, or no file.
kept() {
    "$folder/venv/bin/python" - "$folder/$1" << 'PYTHON'
import sqlite3
import sys
from pathlib import Path

files = {file.name: file for file in Path(sys.argv[1]).rglob("*") if file.is_file()}
if files:
    reports = sqlite3.connect(files["onnxruntime.db"]).execute("select count(*) from events").fetchone()[0]
    print(f"{len(files['deviceid'].read_text())}:{reports}:{files['deviceid'].read_text()[:8]}")
else:
    print("none")
PYTHON
}
off="onnxruntime.disable_telemetry_events()"
load home ""
first=$(kept home)
load home ""
again=$(kept home)
load asked "$off"
load ci "" CI=1
load silent "" ORT_DISABLE_TELEMETRY=1
asked=$(kept asked)
found="${first%:*} ${asked%:*} $(kept ci) $(kept silent)"
echo "identity's characters:reports after import, and disable_telemetry_events; with CI, ORT_DISABLE_TELEMETRY: $found"
[ "$found" = "36:1 36:1 none none" ] && [ "${first##*:}" = "${again##*:}" ]
