"""The tracker's parameters: every one described, every mistake named."""

import re
from dataclasses import fields, is_dataclass

import pytest

from tracker_node.errors import FileFormatError
from tracker_node.runs.config_file import migrated
from tracker_node.tracking.config import (
    ALONE,
    JOINT,
    MIXED,
    POINTS_BESIDE,
    SWITCHED,
    TrackerConfig,
    checked_combination,
    describe,
    flatten,
    from_dict,
    updated,
)
from tracker_node.tracking.parameters import numbers, value_of
from tracker_node.tracking.renamed import RENAMED

DESCRIBED = describe()
MODALITIES = {POINTS_BESIDE: ["region", "keypoints"], ALONE: ["color"], MIXED: ["color", "region"], JOINT: ["color", "region"]}


def leaves(cls) -> int:
    return sum(leaves(f.default_factory) if is_dataclass(f.default_factory) else 1 for f in fields(cls))


def with_it(name: str, value: object) -> dict[str, object]:
    """A parameter among modalities that it belongs to."""
    of = DESCRIBED[name]["of"]
    if of and of[0] in SWITCHED:
        switch, _, setting = of[0].partition(": ")
        return {switch: setting == "True" if switch == "floor.enabled" else setting, name: value}
    return {name: value} | ({"modalities": MODALITIES.get(of[0], [of[0]])} if of else {})


def test_every_parameter_is_described_and_keeps_its_default():
    assert len(DESCRIBED) == leaves(TrackerConfig) >= 40
    assert all(value_of(TrackerConfig(), name) == entry["default"] for name, entry in DESCRIBED.items())
    assert flatten(TrackerConfig()).keys() == describe(TrackerConfig()).keys() < DESCRIBED.keys()


@pytest.mark.parametrize("name", DESCRIBED)
def test_a_parameter_is_one_where_a_modality_in_use_has_it(name):
    given = with_it(name, DESCRIBED[name]["default"])
    assert name in describe(from_dict(given)) and name in flatten(from_dict(given))
    others = {"region": ["color"], "chamfer": ["region"], "color": ["texture"], "texture": ["color"]}
    of = DESCRIBED[name]["of"]
    if of:
        without = others | {key: ["color"] for key in SWITCHED}
        wrong = {name: DESCRIBED[name]["default"], "modalities": without.get(of[0], ["chamfer"])}
        with pytest.raises(FileFormatError, match=f"modalities with .*{of[0]}.*, to which it belongs") as caught:
            from_dict(wrong, "my.yaml")
        assert caught.value.field == name


def test_parameters_of_another_base_are_refused_and_come_with_it():
    with pytest.raises(FileFormatError, match=r"expected motion.base: free, to which it belongs, instead of fixed"):
        from_dict({"motion.base": "fixed", "motion.root_angle_noise": 1.0})
    free = from_dict({"motion.root_angle_noise": 3.0})
    fixed = updated(free, {"motion.base": "fixed", "motion.base_angle_sigma_deg": 4.0}, "x")
    assert fixed.motion.base_angle_sigma_deg == 4.0 and "motion.root_angle_noise" not in flatten(fixed)
    assert updated(fixed, {"motion.base": "free"}, "x") == TrackerConfig()


def test_the_place_of_a_floor_is_refused_where_there_is_none():
    with pytest.raises(FileFormatError, match=r"expected floor.enabled: True, to which it belongs, instead of False"):
        from_dict({"floor.height_m": 0.5})
    there = updated(TrackerConfig(), {"floor.enabled": True, "floor.height_m": 0.5}, "x")
    assert there.floor.height_m == 0.5 and updated(there, {"floor.enabled": False}, "x") == TrackerConfig()


@pytest.mark.parametrize("name", RENAMED)
def test_a_name_of_an_earlier_version_is_refused_with_the_present_one(name):
    assert RENAMED[name] in DESCRIBED and name not in DESCRIBED
    with pytest.raises(FileFormatError, match=re.escape(RENAMED[name])) as caught:
        from_dict({name: 1}, "my.yaml")
    assert caught.value.field == name


@pytest.mark.parametrize(
    ("old", "new", "dropped"),
    [
        ({}, {}, []),
        ({"threads": 3, "region": {"clamp": 3.0}}, {"threads": 3, "region.max_log_ratio": 3.0}, []),
        ({"evidence": {"canny_high": 90.0}}, {}, ["chamfer.canny_high"]),
        (
            {"evidence.kind": "both", "evidence.silhouette": "plate", "evidence.scene_sigma": 2.0},
            {"modalities": ["region", "chamfer"], "chamfer.silhouette": "background", "background.sigma": 2.0},
            [],
        ),
        ({"engine": "color", "start.keep": 3}, {"modalities": ["color"], "initialization.candidates": 3}, []),
        (
            {"engine": "color", "color.representation": "affine", "color.search_states": 9, "color.levels": 2},
            {"modalities": ["texture"], "texture.search_states": 9},
            ["texture.levels"],
        ),
        (
            {"engine": "color_then_contour", "color.representation": "scene", "evidence.kind": "chamfer"},
            {"modalities": ["chamfer", "color_over_background"], "combination": "sequential"},
            [],
        ),
        ({"engine": "color_and_contour", "together.passes": 3}, {"modalities": ["region", "color"], "joint.passes": 3}, []),
        ({"modalities": ["color"], "color": {"levels": 3}}, {"modalities": ["color"], "color.levels": 3}, []),
    ],
)
def test_parameters_of_an_earlier_version_are_rewritten(old, new, dropped):
    assert migrated(old) == (new, dropped)
    from_dict(new)


@pytest.mark.parametrize(
    ("modalities", "said"),
    [([], "one or more of"), (["region", "region"], "each once"), (["color", "texture"], "at most one of"), ("region", "a list")],
)
def test_modalities_that_do_not_go_together_are_refused(modalities, said):
    with pytest.raises(FileFormatError, match=said):
        from_dict({"modalities": modalities})


def test_changed_modalities_forget_what_belonged_to_the_others():
    config = from_dict({"region.repeats": 7, "threads": 3})
    changed = updated(config, {"modalities": ["chamfer"], "chamfer.tolerance": 0.1}, "here")
    assert (changed.modalities, changed.chamfer.tolerance, changed.threads) == (("chamfer",), 0.1, 3)
    assert updated(changed, {"modalities": ["region"]}, "here").region == TrackerConfig().region
    mixed = updated(config, {"modalities": ["color", "region"], "combination": "sequential"}, "here")
    assert "combination" in flatten(mixed) and updated(mixed, {"modalities": ["region"]}, "here") == config


@pytest.mark.parametrize("name", DESCRIBED)
def test_a_description_says_what_it_is_and_what_may_be(name):
    entry = DESCRIBED[name]
    assert len(entry["doc"]) >= 12
    default = entry["default"]
    assert type(default) in (bool, int, float, str, tuple)
    if isinstance(default, tuple):
        assert set(default) <= set(entry["choices"])
    elif entry["choices"]:
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
    elif isinstance(entry["default"], tuple):
        wrong, right = ["region", ["other"], 3], [(choice,) for choice in entry["choices"]]
    elif isinstance(entry["default"], str):
        listed = [f"{entry['low']}", f"{entry['high']} {entry['low']}"]
        wrong, right = ["", "other", 3], list(entry["choices"]) or listed
    elif entry["choices"]:
        wrong, right = [min(entry["choices"]) - 1, max(entry["choices"]) + 1, True, "1", None], list(entry["choices"])
    else:
        kind = type(entry["default"])
        right = [kind(entry["low"]), kind(entry["high"])]
        wrong = [right[0] - 1, right[1] * 2 + 1, True, "1", None, [1], float("nan")]
    for value in right:
        assert flatten(from_dict(with_it(name, value)))[name] == (list(value) if isinstance(value, tuple) else value)
    for value in wrong:
        with pytest.raises(FileFormatError) as caught:
            from_dict(with_it(name, 0) | {name: value}, "my.yaml")
        assert (caught.value.file, caught.value.field) == ("my.yaml", name), value


def test_nested_and_dotted_names_are_the_same():
    nested = from_dict({"region": {"inlier_px": 12}, "threads": 3})
    assert nested == from_dict({"region.inlier_px": 12.0, "threads": 3})
    assert nested.region.inlier_px == 12.0
    assert nested.chamfer == TrackerConfig().chamfer
    assert from_dict(flatten(nested)) == nested
    assert from_dict({}) == TrackerConfig()


@pytest.mark.parametrize(
    ("values", "field", "valid"),
    [
        ({"chamfer": {"cany_low": 1.0}}, "chamfer.cany_low", "canny_low"),
        ({"chamfer.cany_low": 1.0}, "chamfer.cany_low", "canny_low"),
        ({"thread": 1}, "thread", "threads"),
        ({"chamfer": 3}, "chamfer", "a mapping"),
        ({"chamfer": 3, "chamfer.canny_low": 1.0}, "chamfer", "a mapping"),
        ({"chamfer.canny_low": 1.0, "chamfer": 3}, "chamfer", "a mapping"),
        ({"threads": {"x": 1}}, "threads", "a int"),
        ({"threads.x": 1}, "threads", "a int"),
    ],
)
def test_mistakes_are_named(values, field, valid):
    with pytest.raises(FileFormatError) as caught:
        from_dict(values, "my.yaml")
    assert (caught.value.file, caught.value.field) == ("my.yaml", field)
    assert valid in str(caught.value)


@pytest.mark.parametrize("modalities", [["keypoints"], ["region", "keypoints"], ["keypoints", "region"]])
def test_points_are_compared_alone_or_with_regions(modalities):
    config = from_dict({"modalities": modalities})
    assert {"keypoints.wobble_m", "motion.neutral_angle", "collision.enabled"} <= describe(config).keys()
    assert checked_combination(config, "my.yaml") is config
    assert ("region.scales" in describe(config)) is ("region" in modalities)


@pytest.mark.parametrize(
    "modalities",
    [["keypoints", "chamfer"], ["region", "chamfer", "keypoints"], ["keypoints", "color"], ["keypoints", "region", "texture"]],
)
def test_points_with_anything_else_are_refused(modalities):
    with pytest.raises(FileFormatError, match="keypoints alone, or with region") as caught:
        from_dict({"modalities": modalities}, "my.yaml")
    assert (caught.value.file, caught.value.field) == ("my.yaml", "modalities")


@pytest.mark.parametrize("name", ["surface_scale", "surface_wobble_m", "silhouette_weight", "silhouette_limit"])
def test_what_points_give_to_outlines_is_no_parameter_of_points_alone(name):
    assert f"keypoints.{name}" in describe(from_dict({"modalities": ["region", "keypoints"]}))
    assert f"keypoints.{name}" not in describe(from_dict({"modalities": ["keypoints"]}))
    with pytest.raises(FileFormatError, match="keypoints with region"):
        from_dict({"modalities": ["keypoints"], f"keypoints.{name}": 1.0})
