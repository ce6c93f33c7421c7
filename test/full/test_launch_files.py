"""Every launch file, run by the real ``ros2 launch`` until it reaches its state, and ended by Ctrl-C."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from helpers.ros import ros2_env

pytest.importorskip("rclpy", reason="ROS is not installed")

from benchmark.ros._launched import FILES, Stage, stage_in
from helpers.ros.graph import remove_left_segments, ros_context, shared_memory_files

pytestmark = [pytest.mark.ros, pytest.mark.skipif(bool(ros2_env.missing()), reason=ros2_env.missing())]
ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def stage(ros_domain_id: int, tmp_path: Path) -> Iterator[Stage]:
    before = shared_memory_files()
    with ros_context(), stage_in(tmp_path) as stage:
        yield stage
    remove_left_segments(before)


def test_all_files_are_run():
    assert sorted(f"{name}.launch.py" for name in FILES) == sorted(path.name for path in (ROOT / "launch").glob("*.launch.py"))


@pytest.mark.parametrize("name", FILES)
def test_it_reaches_its_state(stage, name):
    FILES[name](stage)
