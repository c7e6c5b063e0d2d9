#!/usr/bin/env bash
# ros-rclpy 7.1.6 (ROS 2 Jazzy, Fast DDS 2.14.5, wheels), CPython 3.12: of more than ten goals sent at once, only the
# last ten reach an action server.
#
# Goals are requests of a service: reliable, and yet kept by a history of 10. While the server does not look, each
# further one takes the place of the oldest; a server of one thread does not look while it works on a goal. Nobody says
# so. The futures of the goals that are gone end neither with an answer nor with an error. Remedy: a deeper
# `goal_service_qos_profile` at the server; at the client alone it changes nothing.
#
# Seen: of 30 goals, sent before the server looks, 10 are accepted, numbers 20 to 29, and 20 have no answer after 5 s.
# With a depth of 100 at the server 30 are, with 100 at the client alone 10.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python=$(command -v python3.12 > /dev/null && python3.12 -c 'import sys; print(sys.executable)' 2> /dev/null ||
    PYENV_VERSION=3.12 python3.12 -c 'import sys; print(sys.executable)' 2> /dev/null ||
    PYENV_VERSION=3.12.1 python3.12 -c 'import sys; print(sys.executable)')
"$python" -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check \
    'ros-rclpy[fastrtps]==7.1.6' ros-test-msgs==2.0.3 ros-fastrtps==2.14.5 ros-rmw-fastrtps-cpp==8.4.3 2> /dev/null

cat > "$folder/goals.py" << 'PYTHON'
import time

import rclpy
from rclpy.action import ActionClient, ActionServer
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from test_msgs.action import Fibonacci

DEEP = {"goal_service_qos_profile": QoSProfile(depth=100)}


def accepted(name, server_qos, client_qos):
    """Return the numbers of the goals out of 30 that a server accepts within 5 s."""
    nodes = Node(f"{name}_server"), Node(f"{name}_client")
    executors = [SingleThreadedExecutor() for _ in nodes]
    for executor, node in zip(executors, nodes):
        executor.add_node(node)

    def run(goal):
        goal.succeed()
        return Fibonacci.Result()

    server = ActionServer(nodes[0], Fibonacci, name, run, **server_qos)
    client = ActionClient(nodes[1], Fibonacci, name, **client_qos)
    assert client.wait_for_server(20.0)
    goals = [client.send_goal_async(Fibonacci.Goal(order=k)) for k in range(30)]
    end = time.monotonic() + 5.0
    while time.monotonic() < end:
        for executor in executors:
            executor.spin_once(timeout_sec=0.001)
    found = [k for k, goal in enumerate(goals) if goal.done() and goal.result().accepted]
    client.destroy()
    server.destroy()
    return f"{len(found)}:{found[0]}-{found[-1]}"


rclpy.init()
print(accepted("plain", {}, {}), accepted("server", DEEP, {}), accepted("client", {}, DEEP))
rclpy.try_shutdown()
PYTHON

export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST
found=$(timeout 300 "$folder/venv/bin/python" "$folder/goals.py" 2> /dev/null | tail -1)
echo "goals accepted of 0 to 29: as it is, the server deeper, the client deeper: $found"
[ "$found" = "10:20-29 30:0-29 10:20-29" ]
