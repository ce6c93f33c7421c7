"""Errors that users can mend go from process to process as they are."""

import pickle

import pytest

from tracker_node.errors import (
    CalibrationError,
    FileFormatError,
    MissingExtraError,
    ModelError,
    SourceError,
    TrackerError,
    UnknownNameError,
    extra_module,
)

ERRORS = [
    TrackerError("too short"),
    FileFormatError("rig.yaml", "cameras.cam01.K", "9 numbers", [1.0]),
    UnknownNameError("verb", "trak", ["track", "export"]),
    ModelError("a cycle"),
    CalibrationError("cam01", "no lens"),
    SourceError("cam01.mp4", "no images"),
    MissingExtraError("pandas", "data"),
]


@pytest.mark.parametrize("error", ERRORS, ids=lambda error: type(error).__name__)
def test_an_error_comes_out_of_another_process_as_it_went_in(error):
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error)
    assert str(again) == str(error) and vars(again) == vars(error)


def test_a_missing_package_of_an_extra_is_named_with_the_line_that_installs_it():
    assert extra_module("json", "data").loads("1") == 1
    with pytest.raises(MissingExtraError, match=r"no_such_package is not installed; pip install 'tracker_node\[data\]'"):
        extra_module("no_such_package", "data")


def test_names_of_fields_stay_in_one_line():
    error = FileFormatError("recording.yaml", "sources.cam\n1\x07é", "a path", None)
    assert str(error) == r"recording.yaml: field 'sources.cam\n1\x07é': expected a path, got None"
    assert error.field == "sources.cam\n1\x07é"
