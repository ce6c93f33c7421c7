# All of it beside ROS 2 Jazzy, built by colcon as docs/install.md has it. From the root of the sources:
#   docker build -f docker/ros.Dockerfile -t tracker_node_ros .
#   docker run --rm --network host --ipc host tracker_node_ros ros2 run tracker_node tracker --help
FROM ros:jazzy-ros-base

SHELL ["/bin/bash", "-euo", "pipefail", "-c"]
RUN apt-get update -q \
    && DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends \
        libegl1 libgl1-mesa-dri libgl1 python3-venv \
        ros-jazzy-robot-state-publisher ros-jazzy-rosbag2-storage-mcap \
    && rm -rf /var/lib/apt/lists/*

WORKDIR /opt/tracker_node
COPY package.xml ./
COPY msgs msgs
RUN apt-get update -q \
    && rosdep update \
    && rosdep install --from-paths . msgs --ignore-src -y \
    && rm -rf /var/lib/apt/lists/*

# What is only on PyPI, in an environment that sees the system's packages.
COPY requirements/runtime.txt requirements/
RUN python3 -m venv --system-site-packages env \
    && touch env/COLCON_IGNORE \
    && env/bin/pip install --no-cache-dir --no-deps -r requirements/runtime.txt

COPY setup.py setup.cfg pyproject.toml README.md LICENSE colcon_defaults.yaml ./
COPY config config
COPY launch launch
COPY resource resource
COPY tracker_node tracker_node
RUN set +u \
    && source /opt/ros/jazzy/setup.bash \
    && source env/bin/activate \
    && colcon build --base-paths . msgs

COPY docker/ros_entrypoint.sh docker/
ENTRYPOINT ["/opt/tracker_node/docker/ros_entrypoint.sh"]
CMD ["ros2", "run", "tracker_node", "tracker_node", "--help"]
