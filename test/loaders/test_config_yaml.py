import pytest

from tracker_node.errors import FileFormatError
from tracker_node.loaders.config_yaml import dump_parameters, load_parameters


def test_sections_of_a_ros_file(tmp_path):
    path = tmp_path / "p.yaml"
    path.write_text("""
/**: {ros__parameters: {use_sim_time: true, a: {b: 1, c: 2}}}
other: {ros__parameters: {a: {b: 5}}}
/tracker: {ros__parameters: {a: {c: 3}, d: [1, 2]}}
""")
    assert load_parameters(path) == {"a": {"b": 1, "c": 3}, "d": [1, 2]}
    assert load_parameters(path, "other") == {"a": {"b": 5, "c": 2}}


def test_dotted_names_come_back_nested(tmp_path):
    dump_parameters({"a.b": 1, "a.c": 1e-5, "d": True}, tmp_path / "p.yaml", "two\nlines")
    assert load_parameters(tmp_path / "p.yaml") == {"a": {"b": 1, "c": 1e-5}, "d": True}
    assert (tmp_path / "p.yaml").read_text().startswith("# two\n# lines\n")


def test_a_section_beside_plain_parameters_is_refused(tmp_path):
    (tmp_path / "p.yaml").write_text("/**: {ros__parameters: {}}\nthreads: 3")
    with pytest.raises(FileFormatError, match="'threads'"):
        load_parameters(tmp_path / "p.yaml")
