# The library, the command line and the studio, without ROS. From the root of the sources:
#   docker build -f docker/python.Dockerfile -t tracker_node .
#   docker run --rm -v "$PWD:/work" tracker_node --help
FROM python:3.12-slim-bookworm

# EGL by Mesa, to draw without a display.
RUN apt-get update -q \
    && apt-get install -y -q --no-install-recommends libegl1 libgl1-mesa-dri libgl1 \
    && rm -rf /var/lib/apt/lists/*

WORKDIR /opt/tracker_node
COPY requirements/runtime.txt requirements/
RUN pip install --no-cache-dir --no-deps -r requirements/runtime.txt

COPY setup.py setup.cfg pyproject.toml package.xml README.md LICENSE ./
COPY config config
COPY launch launch
COPY resource resource
COPY tracker_node tracker_node
RUN pip install --no-cache-dir ".[studio,data,keypoints]"

# Compiled code and what is written belong to whoever runs it.
RUN useradd --create-home tracker
USER tracker
ENV NUMBA_CACHE_DIR=/home/tracker/.cache/numba
WORKDIR /work
ENTRYPOINT ["tracker_node"]
CMD ["--help"]
