import pytest

from tracker_node.errors import FileFormatError, TrackerError
from tracker_node.model.humans.human import human_model
from tracker_node.model.humans.keypoints import is_person
from tracker_node.runs import config_file
from tracker_node.runs.config_file import config_for, dump_config, load_config
from tracker_node.synthesis.subjects.figure import figure_model
from tracker_node.tracking.config import KEYPOINTS, REGION, TrackerConfig


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


SECTIONS = {
    "/**": {"/tracker", "/lab/tracker", "/lab/anna"},
    "tracker": {"/tracker", "/lab/tracker"},
    "/tracker": {"/tracker"},
    "'*'": {"/tracker"},
    "/lab/*": {"/lab/tracker", "/lab/anna"},
    "lab/anna": {"/lab/anna"},
    "/**/tracker": {"/tracker", "/lab/tracker"},
    "/lab/**": {"/lab/tracker", "/lab/anna"},
    "/la?/anna": set(),
}


@pytest.mark.parametrize("name", SECTIONS)
@pytest.mark.parametrize("node", ["/tracker", "/lab/tracker", "/lab/anna"])
def test_sections_are_the_nodes_that_their_patterns_name(tmp_path, name, node):
    file = tmp_path / "tracker.yaml"
    file.write_text(f"{name}:\n  ros__parameters: {{threads: 3}}\n")
    if node in SECTIONS[name]:
        assert load_config(file, node).threads == 3
    else:
        with pytest.raises(FileFormatError, match=f"expected one of {node}, or a pattern such as /\\*\\*, got"):
            load_config(file, node)


def test_names_of_nodes_may_be_within_namespaces(tmp_path):
    file = tmp_path / "tracker.yaml"
    file.write_text("lab:\n  anna:\n    ros__parameters: {threads: 3}\n  bert:\n    ros__parameters: {threads: 5}\n")
    assert load_config(file, "/lab/bert").threads == 5
    file.write_text("lab:\n  anna:\n    ros__parameters: {threads: 3}\n  bert: 5\n")
    with pytest.raises(FileFormatError, match="'lab/bert'"):
        load_config(file, "/lab/bert")


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


@pytest.fixture
def detector(monkeypatch):
    monkeypatch.setattr(config_file, "usable_weights", lambda: None)


def test_people_are_compared_by_points_too(detector):
    human, thing = human_model(), figure_model()
    assert not is_person(thing)
    assert config_for(None, human).modalities == (REGION, KEYPOINTS)
    assert config_for(None, thing).modalities == (REGION,)
    assert config_for(None, thing, has_points=True).modalities == (REGION, KEYPOINTS)


def test_a_file_that_chooses_modalities_is_obeyed(tmp_path, detector):
    (tmp_path / "p.yaml").write_text("modalities: [region]\n")
    assert config_for(tmp_path / "p.yaml", human_model(), has_points=True).modalities == (REGION,)
    (tmp_path / "q.yaml").write_text("region: {repeats: 3}\n")
    config = config_for(tmp_path / "q.yaml", human_model())
    assert config.modalities == (REGION, KEYPOINTS) and config.region.repeats == 3
    (tmp_path / "r.yaml").write_text("color: {learn_colors: true}\n")
    with pytest.raises(FileFormatError, match=r"r\.yaml: field .color\.learn_colors.: expected modalities with color"):
        config_for(tmp_path / "r.yaml", human_model())


def test_without_the_detector_people_go_by_outlines_and_are_told_why(monkeypatch):
    def missing():
        raise TrackerError("no weights here")

    monkeypatch.setattr(config_file, "usable_weights", missing)
    told = []
    assert config_for(None, human_model(), tell=told.append).modalities == (REGION,)
    assert told == ["outlines alone, without points of people: no weights here"]
    assert config_for(None, human_model(), has_points=True, tell=told.append).modalities == (REGION, KEYPOINTS) and len(told) == 1
