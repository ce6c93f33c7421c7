#!/bin/bash
# Runs a command with ROS, this package and its Python environment.
set -e
source /opt/ros/jazzy/setup.bash
source /opt/tracker_node/env/bin/activate
source /opt/tracker_node/install/local_setup.bash
exec "$@"
