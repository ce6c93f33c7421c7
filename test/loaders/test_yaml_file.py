"""YAML is that of the core schema of version 1.2, both ways, and within limits."""

import math
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from tracker_node.errors import FileFormatError
from tracker_node.loaders.yaml_file import parse_value, read_mapping, write_mapping


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("0640", 640), ("0o640", 416), ("0x1F", 31), ("-007", -7), ("+3", 3), ("1_000", "1_000"), ("0b11", "0b11"),
        ("1:30", "1:30"), ("1:30.5", "1:30.5"), ("yes", "yes"), ("No", "No"), ("on", "on"), ("off", "off"),
        ("y", "y"), ("true", True),
        ("FALSE", False), ("tRue", "tRue"), ("<<", "<<"), ("~", None), ("", None), ("nULL", "nULL"),
        ("1e3", 1000.0), ("1.", 1.0), (".5", 0.5),
        ("-.inf", -math.inf),
        ("1E-2", 0.01), ("2024-05-01", "2024-05-01"), ("2024-05-01 10:00:00", "2024-05-01 10:00:00"), ("=", "="), ("'12'", "12"),
        ("!!str 12", "12"), ("!!float 12", 12.0), ("!!int 0640", 640),
    ],
)  # fmt: skip
def test_plain_values_are_those_of_yaml_1_2(text: str, value: object) -> None:
    assert parse_value(text) == value
    assert type(parse_value(text)) is type(value)
    assert parse_value(f"[{text or '~'}]") == [value]


@pytest.mark.parametrize("text", ["!!bool yes", "!!timestamp 2024-05-01", "!!binary aGk=", "!!set {a}", "!!python/name:os"])
def test_what_the_core_schema_does_not_know_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "a.yaml"
    path.write_text(f"a: {text}\n")
    with pytest.raises(FileFormatError, match="line 1, column 4"):
        read_mapping(path)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a: " + "9" * 5000, "an integer of more than 1000 digits"),
        ("a: " + "1:" * 2150 + "1", None),  # text
        ("a: " + "[" * 5000, "more than 100 levels"),
        ("a: " + "{b: " * 5000, "more than 100 levels"),
        ("a: 1\n" + "".join(f"{'  ' * i}k:\n" for i in range(3000)), "more than 100 levels|YAML"),
        ("&a [*a]: 1", "YAML"),
        ("a: &a [*a]", "recursive"),
    ],
)
def test_what_a_machine_cannot_hold_is_one_line(tmp_path: Path, text: str, said: str | None) -> None:
    path = tmp_path / "a.yaml"
    path.write_text(text)
    if said is None:
        assert read_mapping(path)["a"].startswith("1:1:")
        return
    with pytest.raises(FileFormatError, match=said) as error:
        read_mapping(path)
    assert len(str(error.value).splitlines()) == 1
    assert len(str(error.value)) < 400


_WORDS = ("yes", "off", "1e3", "0o17", "0640", "1:30", "2024-05-01", "~", "null", ".inf", "0x1f", "=", "<<", "a:b", "#", "", " a")
_SPECIAL = st.sampled_from(_WORDS)
_VALUE = st.one_of(_SPECIAL, st.text(max_size=12), st.integers(), st.floats(allow_nan=False), st.booleans(), st.none())


_KEY = st.one_of(_SPECIAL, st.text(min_size=1, max_size=8))


@given(values=st.dictionaries(_KEY, st.one_of(_VALUE, st.lists(_VALUE, max_size=4)), max_size=5))
def test_what_is_written_is_read_again(tmp_path_factory: pytest.TempPathFactory, values: dict) -> None:
    path = tmp_path_factory.mktemp("yaml") / "a.yaml"
    write_mapping(values, path)
    assert read_mapping(path) == values


@given(text=st.one_of(_SPECIAL, st.text(alphabet="0123456789eExXob.:-+_yn", max_size=8)))
def test_text_is_text_for_readers_of_yaml_1_1_too(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    path = tmp_path_factory.mktemp("yaml") / "a.yaml"
    write_mapping({"a": text}, path)
    assert yaml.safe_load(path.read_text()) == read_mapping(path) == {"a": text}
