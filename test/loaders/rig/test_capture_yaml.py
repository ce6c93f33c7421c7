"""How a camera is to take images: as a file states it, and as the command line changes it."""

import pytest

from tracker_node.camera.rig import CaptureSettings
from tracker_node.errors import FileFormatError, TrackerError
from tracker_node.loaders.rig.capture_yaml import CaptureEntry, capture_entry, changed_settings, split_change


def test_settings_are_there_and_back():
    settings = CaptureSettings(rate_hz=25.0, exposure_us=4000.0, gain=3, controls={"brightness": 5}, publish="mono")
    assert capture_entry(settings).settings() == settings
    assert capture_entry(CaptureSettings()) is None
    assert CaptureEntry().settings() == CaptureSettings()


def test_fields_are_changed_and_others_stay():
    settings = CaptureSettings(rate_hz=25.0, controls={"brightness": 5})
    changes = [("exposure_us", "4000"), ("controls.contrast", "3"), ("gain", "2")]
    changed = changed_settings(settings, changes)
    assert changed == CaptureSettings(rate_hz=25.0, exposure_us=4000.0, gain=2, controls={"brightness": 5, "contrast": 3})
    assert changed_settings(settings, [("controls.brightness", "7")]).controls == {"brightness": 7}
    assert settings.controls == {"brightness": 5}


@pytest.mark.parametrize(
    ("name", "value"), [("other", "1"), ("rate_hz", "-1"), ("publish", "none"), ("control.x", "3"), ("controls", "3")]
)
def test_what_is_wrong_is_named(name, value):
    with pytest.raises(FileFormatError, match=name.partition(".")[0]):
        changed_settings(CaptureSettings(), [(name, value)])


@pytest.mark.parametrize(
    ("text", "change"),
    [
        ("cam1.exposure_us=4000", ("cam1", "exposure_us", "4000")), ("exposure_us=4000", (None, "exposure_us", "4000")),
        ("controls.x=3", (None, "controls.x", "3")), ("cam1.controls.x=a=b", ("cam1", "controls.x", "a=b")),
        ("cam1=3", (None, "cam1", "3")),
    ],
)  # fmt: skip
def test_changes_are_of_one_camera_or_of_all(text, change):
    assert split_change(text, ["cam1", "cam2"]) == change


def test_a_change_has_a_value():
    with pytest.raises(TrackerError, match="expected"):
        split_change("cam1.exposure_us", ["cam1"])
