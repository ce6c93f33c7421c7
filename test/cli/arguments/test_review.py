"""What `review` is asked for: names, files for each run, lags and folders."""

import argparse

import pytest

from tracker_node.cli.evaluate import _check_numbers, lag_of, names_of, one_each, output_folder
from tracker_node.errors import TrackerError
from tracker_node.loaders.recording_yaml import MOST_LAG_IMAGES


@pytest.mark.parametrize(
    ("runs", "given", "names"),
    [
        (["out/a"], [], ["run"]),
        (["out/a"], ["mine"], ["mine"]),
        (["out/a", "out/b"], [], ["a", "b"]),
        (["x/a", "y/b", "z/a"], [], ["x_a", "b", "z_a"]),
        (["run/man/smoothed", "run/woman/smoothed"], [], ["man_smoothed", "woman_smoothed"]),
        (["x/a", "x/b", "x/a"], [], ["a1", "b", "a3"]),
        (["x/a", "y/b"], ["one", "two"], ["one", "two"]),
    ],
)
def test_names_of_runs(runs, given, names):
    assert names_of(runs, given) == names


@pytest.mark.parametrize(
    ("runs", "given", "expected"),
    [
        (["a"], ["x", "y"], "expected one name, got 'x', 'y'"),
        (["a"], [" "], "expected one name, got ' '"),
        (["a", "b"], ["x"], "expected 2 different names"),
        (["a", "b"], ["x", "x"], "expected 2 different names"),
        (["a", "b"], ["x", ""], "expected 2 different names"),
    ],
)
def test_names_that_cannot_be(runs, given, expected):
    with pytest.raises(TrackerError, match=f"--name: {expected}"):
        names_of(runs, given)


@pytest.mark.parametrize(
    ("runs", "given", "result"),
    [
        (["a"], [], [None]),
        (["a"], ["f"], ["f"]),
        (["a"], ["f", "g"], ["g"]),
        (["a", "b"], [], [None, None]),
        (["a", "b"], ["f"], ["f", "f"]),
        (["a", "b"], ["f", "g"], ["f", "g"]),
    ],
)
def test_a_file_for_each_run(runs, given, result):
    assert one_each(runs, given, "--model") == result


def test_files_for_some_of_the_runs_are_refused():
    with pytest.raises(TrackerError, match="--model: expected one file for all runs or 3, got 2"):
        one_each(["a", "b", "c"], ["f", "g"], "--model")


@pytest.mark.parametrize(("text", "lag"), [("auto", None), ("0", 0.0), ("-2.5", -2.5)])
def test_a_lag(text, lag):
    assert lag_of(text) == lag
    assert lag_of(str(MOST_LAG_IMAGES)) == MOST_LAG_IMAGES
    assert lag_of(str(-MOST_LAG_IMAGES)) == -MOST_LAG_IMAGES


@pytest.mark.parametrize("text", ["soon", "nan", "inf", str(MOST_LAG_IMAGES + 0.5), str(-MOST_LAG_IMAGES - 0.5)])
def test_what_is_no_lag(text):
    with pytest.raises(TrackerError, match="--lag: expected 'auto' or a number"):
        lag_of(text)


@pytest.mark.parametrize("name", ["image_sets", "first_image", "pictures"])
def test_numbers_are_not_below_zero(name):
    values = {"image_sets": None, "first_image": 0, "pictures": 0}
    _check_numbers(argparse.Namespace(**values))
    _check_numbers(argparse.Namespace(**values | {name: 3}))
    option = name.replace("_", "-")
    with pytest.raises(TrackerError, match=f"--{option}: expected 0 or more, got -1"):
        _check_numbers(argparse.Namespace(**values | {name: -1}))


def test_the_report_goes_to_the_folder_of_the_only_run(tmp_path):
    assert output_folder(None, [str(tmp_path)]) == tmp_path
    bag = tmp_path / "run.mcap"
    bag.touch()
    assert output_folder(None, [str(bag)]) == tmp_path
    assert output_folder(str(tmp_path / "new" / "one"), [str(bag)]) == tmp_path / "new" / "one"
    assert output_folder(str(tmp_path), ["a", "b"]) == tmp_path


def test_places_that_a_report_cannot_go_to(tmp_path):
    with pytest.raises(TrackerError, match="give --output DIR"):
        output_folder(None, ["a", "b"])
    file = tmp_path / "file"
    file.touch()
    for place in (file, file / "below"):
        with pytest.raises(TrackerError, match="--output: expected a folder that can be written to, got"):
            output_folder(str(place), [str(tmp_path)])
