"""recording.yaml: what it may say, where its paths begin, and how a mistake is told."""

from pathlib import Path

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tracker_node.errors import FileFormatError
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.loaders.recording_yaml import RecordingFile, load_recording

WHOLE = """
rig: rig.yaml
model: person.yaml
initial_state: ../start.yaml
output: run
cameras: [left, right]
sources: videos/{name}.mp4
keypoints: {files: points, table: table.yaml, first: 3, every_sets: 1}
person: [1, 0.5, 1]
images: {start: 3, end: 20, rate_hz: 50, resize: [320, 240]}
record: {masks: true, overlays: true}
real_time: false
evaluate: {truth: truth.trc, masks: masks.json, name: walk, image_sets: 17, targets: [mpjpe_mm<=60]}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    folder = tmp_path / "recording"
    folder.mkdir()
    for name in ("rig.yaml", "person.yaml", "truth.trc", "masks.json", "../start.yaml", "table.yaml"):
        (folder / name).write_text("")
    (folder / "points").mkdir()
    return folder


def written(folder: Path, text: str) -> Path:
    path = folder / "recording.yaml"
    path.write_text(text)
    return path


def test_paths_begin_at_the_file(folder, monkeypatch):
    recording = load_recording(written(folder, WHOLE))
    assert Path(recording.rig) == folder / "rig.yaml"
    assert Path(recording.initial_state).samefile(folder.parent / "start.yaml")
    assert Path(recording.output) == folder / "run"
    assert Path(recording.sources) == folder / "videos/{name}.mp4"
    assert list(map(Path, recording.evaluate.truth)) == [folder / "truth.trc"]
    assert (recording.images.resize, recording.images.end, recording.cameras) == ((320, 240), 20, ("left", "right"))
    assert (recording.record.masks, recording.record.images, recording.evaluate.targets) == (True, False, ("mpjpe_mm<=60",))
    points = recording.keypoints
    assert (points.files, points.table, points.first) == (str(folder / "points"), str(folder / "table.yaml"), 3)
    assert recording.person == (1.0, 0.5, 1.0)
    monkeypatch.chdir(folder.parent)
    assert load_recording("recording/recording.yaml").rig == "recording/rig.yaml"


def test_what_is_left_out(folder):
    recording = load_recording(written(folder, "rig: rig.yaml\nmodel: person.yaml\noutput: /tmp/elsewhere\n"))
    assert recording.initial_state is None and recording.evaluate is None and recording.sources == {}
    assert recording.output == "/tmp/elsewhere"


def test_a_model_may_be_a_body_by_its_name(folder):
    text = "rig: rig.yaml\nmodel: gait_human\noutput: run\n"
    assert load_model(load_recording(written(folder, text)).model).n_dof == 51
    (folder / "gait_human").touch()  # a file comes first
    assert load_recording(written(folder, text)).model == str(folder / "gait_human")


def test_a_body_of_the_package_that_is_named_as_a_file_is_said(folder):
    told = "expected an existing file, or human, the name of a body of the package, got"
    for text, field in (
        ("rig: rig.yaml\nmodel: human.yaml\noutput: run\n", "model"),
        ("rig: rig.yaml\noutput: run\njoining: {model: human.yaml}\n", "joining.model"),
        ("rig: rig.yaml\noutput: run\nbodies: {anna: {model: human.yaml}}\n", "bodies.anna.model"),
    ):
        with pytest.raises(FileFormatError, match=f"field '{field}': {told}"):
            load_recording(written(folder, text))
    with pytest.raises(FileFormatError, match=rf"human.yaml: field '\(file\)': {told}"):
        load_model(folder / "human.yaml")


def test_sources_by_camera(folder):
    text = "rig: rig.yaml\nmodel: person.yaml\noutput: run\nsources: {left: a.mp4, right: 'v4l2:/dev/video0', top: /abs/b.mp4}\n"
    sources = load_recording(written(folder, text)).sources
    assert sources == {"left": str(folder / "a.mp4"), "right": "v4l2:/dev/video0", "top": "/abs/b.mp4"}


MISTAKES = {
    "rig: rig.yaml": ("rig: other.yaml", "rig", "an existing file"),
    "model: person.yaml": ("", "model", "the body to track, or bodies"),
    "output: run": ("output: run\nmasks: true", "masks", "one of"),
    "sources: videos/{name}.mp4": ("sources: {left: 'ftp://x'}", "sources.left", "a source of a known kind"),
    "videos/{name}.mp4": ("videos/{camera}.mp4", "sources", "{name} or {number}"),
    "start: 3": ("start: 30", "images.end", "more than start"),
    "end: 20": ("end: 20.5", "images.end", "a whole number"),
    "rate_hz: 50": ("rate_hz: -50", "images.rate_hz", "a positive number"),
    "resize: [320, 240]": ("resize: 320x240", "images.resize", "[width, height]"),
    "resize: [320, 240]}": ("resize: [320, 240], shrink: 2}", "images.shrink", "either"),
    "masks: true": ("masks: yes please", "record.masks", "true or false"),
    "overlays: true}": ("compression: zip}", "record.compression", "'none', 'lz4' or 'zstd'"),
    "overlays: true": ("video: true", "record.video", "one of"),
    "real_time: false": ("loop: true", "loop", "no loop"),
    "truth: truth.trc, ": ("truth: [1], ", "evaluate.truth", "a file"),
    "truth.trc": ("else.trc", "evaluate.truth", "an existing file"),
    "image_sets: 17": ("image_sets: -1", "evaluate.image_sets", "a whole number"),
    "name: walk": ("name: ''", "evaluate.name", "a name"),
    "name: walk, ": ("name: walk, lag: fast, ", "evaluate.lag", "'auto' or a number of images"),
    ", image_sets: 17": (", lag: 2000, image_sets: 17", "evaluate.lag", "'auto' or a number of images"),
    "files: points": ("files: nowhere", "keypoints.files", "an existing file"),
    "table: table.yaml": ("table: points", "keypoints.table", "an existing file"),
    "table: table.yaml, ": ("weights: w.tflite, ", "keypoints.weights", "either files or weights"),
    "every_sets: 1": ("every_sets: 0", "keypoints.every_sets", "a whole number, 1 or more"),
    "[1, 0.5, 1]": ("[1, 0.5]", "person", "a place: [x, y, z] in meters"),
    "cameras: [left, right]": ("cameras: []", "cameras", "at least 1"),
}


@pytest.mark.parametrize("right", MISTAKES)
def test_mistakes_name_file_and_field(folder, right):
    wrong, field, expected = MISTAKES[right]
    assert WHOLE.count(right) == 1
    path = written(folder, WHOLE.replace(right, wrong))
    with pytest.raises(FileFormatError) as caught:
        load_recording(path)
    assert (caught.value.file, caught.value.field) == (str(path), field)
    assert expected in str(caught.value)


BODIES = """
rig: rig.yaml
output: run
config: config.yaml
bodies:
  man: {model: person.yaml, initial_state: ../start.yaml, evaluate: {truth: truth.trc}}
  woman: {model: person.yaml, config: own.yaml, person: [1, 0.5, 1]}
"""


def test_several_bodies(folder):
    (folder / "config.yaml").write_text("")
    (folder / "own.yaml").write_text("")
    recording = load_recording(written(folder, BODIES))
    man, woman = recording.of_body("man"), recording.of_body("woman")
    assert (man.output, woman.output) == (str(folder / "run/man"), str(folder / "run/woman")) and not man.bodies
    assert (man.config, woman.config) == (str(folder / "config.yaml"), str(folder / "own.yaml"))
    assert man.evaluate.truth == (str(folder / "truth.trc"),) and woman.evaluate is None
    assert Path(man.initial_state).samefile(folder.parent / "start.yaml") and woman.person == (1.0, 0.5, 1.0)


BODY_MISTAKES = {
    "rig: rig.yaml": ("rig: rig.yaml\nevaluate: {truth: truth.trc}", "evaluate", "got {'truth': ['truth.trc']}"),
    "output: run": ("output: run\nmodel: person.yaml", "model", "nothing beside bodies"),
    "config: config.yaml": ("person: [0, 0, 1]", "person", "where each body has its own, got [0.0, 0.0, 1.0]"),
    "  man: {model": ("  two men: {model", "bodies", "a name of letters, digits and _"),
    "woman: {model": ("man: {model", "", "expected each key once"),
    "truth: truth.trc": ("truth: else.trc", "bodies.man.evaluate.truth", "an existing file"),
    "model: person.yaml, config: own.yaml": ("model: else.yaml", "bodies.woman.model", "an existing file"),
    "config: own.yaml": ("initial_state: ../start.yaml", "bodies.woman.person", "either initial_state or person"),
}


def refused(folder, text, right, wrong, field, expected):
    for name in ("config.yaml", "own.yaml"):
        (folder / name).write_text("")
    assert text.count(right) == 1
    with pytest.raises(FileFormatError) as caught:
        load_recording(written(folder, text.replace(right, wrong)))
    assert expected in str(caught.value) and (not field or caught.value.field == field)


@pytest.mark.parametrize("right", BODY_MISTAKES)
def test_mistakes_in_several_bodies(folder, right):
    refused(folder, BODIES, right, *BODY_MISTAKES[right])


JOINING = BODIES + "joining: {model: person.yaml, most: 2, name: man, gone_s: 3}\n"


def test_people_who_join(folder):
    for name in ("config.yaml", "own.yaml"):
        (folder / name).write_text("")
    recording = load_recording(written(folder, JOINING))
    assert recording.several and list(recording.each()) == ["man", "woman"]
    assert recording.joining.names == ("man_1", "man_2") and recording.joining.gone_s == 3.0
    alone = recording.of_those_who_join()
    assert (alone.model, alone.config) == (str(folder / "person.yaml"), str(folder / "config.yaml"))
    assert recording.models == dict.fromkeys(["man", "woman", "man_1", "man_2"], str(folder / "person.yaml"))
    nobody = "rig: rig.yaml\noutput: run\njoining: {model: person.yaml}\n"
    assert load_recording(written(folder, nobody)).each() == {}


JOINING_MISTAKES = {
    "  man: {model": ("  man_2: {model", "bodies", "another name than those of people who join (man_1, man_2)"),
    "joining: {model: person.yaml": ("joining: {model: else.yaml", "joining.model", "an existing file"),
    "most: 2": ("most: 0", "joining.most", "a whole number, 1 or more"),
    "name: man": ("name: 2 men", "joining.name", "a name of letters, digits and _"),
    "gone_s: 3": ("gone_s: -1", "joining.gone_s", "a positive number"),
    "joining:": ("model: person.yaml\njoining:", "model", "nothing beside bodies or joining"),
}


@pytest.mark.parametrize("right", JOINING_MISTAKES)
def test_mistakes_in_people_who_join(folder, right):
    refused(folder, JOINING, right, *JOINING_MISTAKES[right])


def test_a_loop_is_not_evaluated_whichever_body_asks_for_it(folder):
    (folder / "config.yaml").write_text("")
    (folder / "own.yaml").write_text("")
    with pytest.raises(FileFormatError, match="no loop where the run is evaluated when it is over"):
        load_recording(written(folder, f"{BODIES}\nloop: true\n"))


VALUES = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=8), st.sampled_from(["rig.yaml", ".", ""])),
    lambda inner: st.one_of(st.lists(inner, max_size=3), st.dictionaries(st.text(max_size=6), inner, max_size=3)),
    max_leaves=4,
)
INNER = ("images.end", "images.resize", "record.masks", "evaluate.truth", "evaluate.lag")
FIELDS = st.sampled_from([*RecordingFile.model_fields, *INNER])


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(field=FIELDS, value=VALUES)
def test_anything_in_a_field_is_read_or_refused(folder, field, value):
    contents = yaml.safe_load(WHOLE)
    here = contents
    *groups, last = field.split(".")
    for group in groups:
        here = here[group]
    here[last] = value
    path = written(folder, yaml.safe_dump(contents))
    try:
        load_recording(path)
    except FileFormatError as error:
        assert error.file == str(path) and "\n" not in str(error)


def test_the_recording_of_the_demo(repository, tmp_path):
    """It stands beside the sample's files, which `sample` makes."""
    named = ("rig_refined.yaml", "person.yaml", "initial_state.yaml", "tracker.yaml", "truth.trc", "masks.json")
    for name in named:
        (tmp_path / name).touch()
    path = written(tmp_path, (repository / "config/balancing_recording.yaml").read_text())
    recording = load_recording(path)
    assert recording.record.overlays and recording.record.markers  # what the shipped layouts show
    assert recording.evaluate.image_sets == 100
