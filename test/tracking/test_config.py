"""The tracker's parameters: every one described, every mistake named."""

from dataclasses import fields, is_dataclass

import pytest

from tracker_node.errors import FileFormatError
from tracker_node.tracking.config import TrackerConfig, describe, flatten, from_dict, numbers

DESCRIBED = describe()


def leaves(cls) -> int:
    return sum(leaves(f.default_factory) if is_dataclass(f.default_factory) else 1 for f in fields(cls))


def test_every_parameter_is_described_and_keeps_its_default():
    assert {name: entry["default"] for name, entry in DESCRIBED.items()} == flatten(TrackerConfig())
    assert len(DESCRIBED) == leaves(TrackerConfig) >= 40


@pytest.mark.parametrize("name", DESCRIBED)
def test_a_description_says_what_it_is_and_what_may_be(name):
    entry = DESCRIBED[name]
    assert len(entry["doc"]) >= 12
    default = entry["default"]
    assert type(default) in (bool, int, float, str)
    if isinstance(default, str) and entry["choices"]:
        assert default in entry["choices"]
    elif isinstance(default, str):
        assert all(entry["low"] <= value <= entry["high"] for value in numbers(default))
    elif not isinstance(default, bool):
        assert entry["low"] <= default <= entry["high"]
        assert entry["low"] < entry["high"]
    if name.endswith("_px"):
        assert entry["unit"] == "px"
    if name.endswith("_s"):
        assert entry["unit"] == "s"


@pytest.mark.parametrize("name", DESCRIBED)
def test_values_beyond_the_range_are_refused_and_those_at_its_ends_taken(name):
    entry = DESCRIBED[name]
    if isinstance(entry["default"], bool):
        wrong, right = [1, "yes", None], [True, False]
    elif isinstance(entry["default"], str):
        listed = [f"{entry['low']}", f"{entry['high']} {entry['low']}"]
        wrong, right = ["", "other", 3], list(entry["choices"]) or listed
    else:
        kind = type(entry["default"])
        right = [kind(entry["low"]), kind(entry["high"])]
        wrong = [right[0] - 1, right[1] * 2 + 1, True, "1", None, [1], float("nan")]
    for value in right:
        assert flatten(from_dict({name: value}))[name] == value
    for value in wrong:
        with pytest.raises(FileFormatError) as caught:
            from_dict({name: value}, "my.yaml")
        assert (caught.value.file, caught.value.field) == ("my.yaml", name), value


def test_nested_and_dotted_names_are_the_same():
    nested = from_dict({"evidence": {"canny_low": 12}, "threads": 3})
    assert nested == from_dict({"evidence.canny_low": 12.0, "threads": 3})
    assert nested.evidence.canny_low == 12.0
    assert nested.optimizer == TrackerConfig().optimizer
    assert from_dict(flatten(nested)) == nested
    assert from_dict({}) == TrackerConfig()


@pytest.mark.parametrize(
    ("values", "field", "valid"),
    [
        ({"evidence": {"cany_low": 1.0}}, "evidence.cany_low", "canny_low"),
        ({"evidence.cany_low": 1.0}, "evidence.cany_low", "canny_low"),
        ({"thread": 1}, "thread", "threads"),
        ({"evidence": 3}, "evidence", "a mapping"),
        ({"evidence": 3, "evidence.canny_low": 1.0}, "evidence", "a mapping"),
        ({"evidence.canny_low": 1.0, "evidence": 3}, "evidence", "a mapping"),
        ({"threads": {"x": 1}}, "threads", "a int"),
        ({"threads.x": 1}, "threads", "a int"),
    ],
)
def test_mistakes_are_named(values, field, valid):
    with pytest.raises(FileFormatError) as caught:
        from_dict(values, "my.yaml")
    assert (caught.value.file, caught.value.field) == ("my.yaml", field)
    assert valid in str(caught.value)
