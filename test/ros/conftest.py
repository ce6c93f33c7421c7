"""Fixtures of the tests with a real ROS graph."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="ROS is not installed")
pytest.importorskip("tracker_msgs", reason="the interface package is not installed")

from tracker_msgs.msg import TrackedState

from helpers.ros.cameras import Cameras, options_of
from helpers.ros.graph import NodeProcess, Probe, remove_left_segments, ros_context, shared_memory_files
from helpers.ros.processes import start
from helpers.ros.samples import write_recording
from tracker_node.ros.tracker.node import TrackerNode

__all__ = ["start"]  # a fixture too


STARTS_PROCESSES = {"launch", "start", "recorded"}  # the fixtures that do


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Nodes as processes of their own take seconds each to start: `make test-long`."""
    for item in items:
        if item.path.is_relative_to(Path(__file__).parent) and STARTS_PROCESSES & set(getattr(item, "fixturenames", ())):
            item.add_marker("long")


@pytest.fixture(scope="session", autouse=True)
def no_segments_left() -> Iterator[None]:
    before = shared_memory_files()
    yield
    remove_left_segments(before)


@pytest.fixture(scope="module")
def ros(no_segments_left: None, ros_domain_id: int) -> Iterator[None]:
    """rclpy in this process; for one module, since others run commands here that start it themselves."""
    with ros_context():
        yield


@pytest.fixture
def probe(ros: None) -> Iterator[Probe]:
    probe = Probe()
    yield probe
    probe.close()


@pytest.fixture
def launch(ros_domain_id: int) -> Iterator[Callable[..., NodeProcess]]:
    """Starts ``tracker_node`` processes; those left at the end are killed."""
    started: list[NodeProcess] = []

    def start(*arguments: str | Path, env: dict[str, str] | None = None) -> NodeProcess:
        started.append(NodeProcess(*arguments, env=env))
        return started[-1]

    yield start
    for process in started:
        process.close()


@pytest.fixture(scope="session")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with 12 image sets of three cameras, rig.yaml, model.yaml and state.yaml; not to be changed."""
    folder = tmp_path_factory.mktemp("recording") / "arm"
    write_recording(folder, 12)
    return folder


@pytest.fixture
def start_tracker(probe: Probe, recording: Path) -> Iterator[Callable[..., tuple[TrackerNode, list[TrackedState], Cameras]]]:
    """Makes an active tracker in this process, its states, and cameras to feed it; options as keywords."""
    nodes: list[TrackerNode] = []

    def start(**changes):
        options = options_of(recording, **changes)
        node = TrackerNode(options)
        nodes.append(node)
        probe.add_node(node)
        states = probe.listen(TrackedState, "tracker/state")
        assert node.start()
        return node, states, Cameras(probe, recording, options.rig)

    yield start
    for node in nodes:
        node.close()
        node.destroy_node()
