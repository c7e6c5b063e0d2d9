#!/bin/bash
# Runs a command where ROS 2 and golem_interfaces are known.
set -e
. "/opt/ros/$ROS_DISTRO/setup.bash"
. /opt/golem/install/setup.bash
exec "$@"
