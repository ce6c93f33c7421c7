"""Parts of the calibrating commands: options in their units, lines that are printed."""

import argparse
from types import SimpleNamespace

import pytest

from tracker_node.cli.groups import calibrate
from tracker_node.cli.groups.calibrate import body, cameras, scene
from tracker_node.errors import FileFormatError

BOARD = ("--charuco", "4x5", "--square", "0.05")


def parsed(command, *arguments):
    parser = argparse.ArgumentParser()
    next(each for each in calibrate.SUBVERBS if each.name == command).add_arguments(parser)
    return parser.parse_args(list(arguments))


def rig_options(*arguments, videos=("a.mp4",)):
    return cameras._rig_options(parsed("rig", "--videos", *videos, *BOARD, *arguments))


def test_milliseconds_become_seconds():
    options = rig_options("--stamp-sigma-ms", "15", "--tolerance-ms", "8", "--sets", "3")
    assert (options.stamp_sigma_s, options.tolerance_s, options.most_time_steps) == pytest.approx((0.015, 0.008, 3))
    assert rig_options().tolerance_s is None
    assert (rig_options().stamp_sigma_s, rig_options().most_time_steps) == (0.02, 100)


@pytest.mark.parametrize(
    "arguments",
    [("--stamp-sigma-ms", "0"), ("--stamp-sigma-ms", "10000"), ("--tolerance-ms", "-1"), ("--sets", "2"), ("--keep-lenses",)],
)
def test_options_that_nobody_can_mean_are_refused(arguments):
    with pytest.raises(FileFormatError, match=arguments[0]):
        rig_options(*arguments)


def test_clocks_are_exact_for_folders_and_free_for_videos(tmp_path):
    folder = (f"left={tmp_path}",)
    assert rig_options(videos=folder).clocks == rig_options(videos=(str(tmp_path),)).clocks == "exact"
    assert rig_options().clocks == "free"
    assert rig_options("--stamps", "t.csv", videos=folder).clocks == "free"
    assert rig_options("--clocks", "offset", videos=folder).clocks == "offset"


def test_lenses_are_refined_unless_they_are_kept():
    assert rig_options("--lenses", "l.yaml").free_lenses
    assert not rig_options("--lenses", "l.yaml", "--keep-lenses").free_lenses


def test_defaults_of_the_commands():
    args = parsed("body")
    assert (args.joint_sigma_mm, args.y_up, args.sets, args.output) == (None, None, 20, "person.yaml")
    assert parsed("body", "--z-up").y_up is False and parsed("body", "--y-up").y_up
    assert parsed("body", "--no-y-up").y_up is False  # as evaluate has it
    assert parsed("intrinsics", "--videos", "a.mp4", *BOARD).views == 80
    assert parsed("background", "--rig", "r.yaml").images == 25


@pytest.mark.parametrize(
    ("arguments", "comment"),
    [
        (("--model", "x/m.yaml", "--trc", "y/t.trc"), "p, from m.yaml, scaled to t.trc. Units"),
        (("--stature", "1.8"), "p, for a stature of 1.8 m. Units"),
        (("--trc", "t.trc", "--stature", "1.75"), "p, scaled to t.trc, for a stature of 1.75 m. Units"),
    ],
)
def test_a_body_says_where_it_comes_from(arguments, comment):
    text = body._comment("p", parsed("body", *arguments))
    assert text.startswith(comment)
    assert ("humans/measures.py" in text) == ("--model" not in arguments)


def test_lengths_are_told_in_millimetres(capsys):
    segment = SimpleNamespace(name="thigh", measured_m=0.4, expected_m=0.41, used_m=0.405)
    body._print_fit(SimpleNamespace(segments=[segment], size=1.0234, residual_m=0.0052))
    lines = capsys.readouterr().out.splitlines()
    assert lines[1].split() == ["thigh", "400.0", "410.0", "405.0"]
    assert lines[2] == "size 1.023 of the model; joints of the trial fitted to 5.2 mm"


def test_parameters_are_told_in_percent(capsys):
    one = SimpleNamespace(name="girth", value=0.051, sigma=0.012, prior_sigma=0.1)
    contours = SimpleNamespace(rms_px=2.0), SimpleNamespace(rms_px=1.5, count=70)
    body._print_parameters(SimpleNamespace(parameters=[one], overall=contours, n_sets=20))
    lines = capsys.readouterr().out.splitlines()
    assert lines[1].split() == ["girth", "+5.1", "1.2", "10"]
    assert lines[2] == "contours: rms 2.00 -> 1.50 px, 70 lines in 20 image sets"


@pytest.mark.parametrize("images", [2, 0])
def test_a_plate_takes_three_images_at_least(images):
    with pytest.raises(FileFormatError, match="at least 3"):
        scene._run_background(SimpleNamespace(images=images))
