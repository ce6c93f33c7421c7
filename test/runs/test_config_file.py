import pytest

from tracker_node.errors import FileFormatError
from tracker_node.runs.config_file import dump_config, load_config
from tracker_node.tracking.config import TrackerConfig


def load(tmp_path, text):
    (tmp_path / "tracker.yaml").write_text(text)
    return load_config(tmp_path / "tracker.yaml")


def test_plain_dotted_and_ros_files_say_the_same(tmp_path):
    plain = load(tmp_path, "threads: 1\nmodalities: [chamfer]\nchamfer: {canny_high: 120}\n")
    assert (plain.threads, plain.chamfer.canny_high) == (1, 120.0)
    assert plain.region == TrackerConfig().region
    assert load(tmp_path, "threads: 1\nmodalities: [chamfer]\nchamfer.canny_high: 120\n") == plain
    ros = """
/**:
  ros__parameters: {threads: 4, use_sim_time: true, modalities: [chamfer], chamfer: {canny_high: 120.0}}
camera_ingest:
  ros__parameters: {rate_hz: 30}
tracker:
  ros__parameters: {threads: 1}
"""
    assert load(tmp_path, ros) == plain


def test_everything_comes_back(tmp_path):
    config = TrackerConfig(threads=7)
    dump_config(config, tmp_path / "c.yaml")
    assert load_config(tmp_path / "c.yaml") == config


@pytest.mark.parametrize(("text", "field"), [
    ("thread: 1", "thread"),
    ("threads: 0", "threads"),
    ("threads: many", "threads"),
    ("chamfer: 3", "chamfer"),
    ("chamfer: {canny_high: -1}", "chamfer.canny_high"),
    ("chamfer: {canny_high: .nan}", "chamfer.canny_high"),
    ("chamfer: {canny: 1}", "chamfer.canny"),
    ("chamfer: 3\nchamfer.canny_high: 5", "chamfer"),
    ("chamfer: {canny_high: 5}", "chamfer.canny_high"),
    ("evidence: {canny_high: 5}", "evidence.canny_high"),
    ("engine: color", "engine"),
    ("/**: {ros__parameters: {threads: 0}}", "threads"),
    ("/**: {ros__parameters: 3}", "/**.ros__parameters"),
    ("/**: {ros__parameters: {}}\nthreads: 3", "threads"),
])  # fmt: skip
def test_errors_name_file_and_parameter(tmp_path, text, field):
    with pytest.raises(FileFormatError) as error:
        load(tmp_path, text)
    assert error.value.field == field
    assert "tracker.yaml" in str(error.value)
